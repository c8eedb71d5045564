"""Folder of an evaluation: its episodes and provenance."""

import pathlib
from collections.abc import Mapping
from typing import Any

from softgym_mj.exceptions import StoreError
from softgym_mj.policies.exported import SUFFIX
from softgym_mj.policies.saved import SEED
from softgym_mj.storage.files import read_json, write_json
from softgym_mj.storage.store import JSON, Store

# Entries of a configuration that may grow: a new seed may have a policy file of its own.
_GROWS = ("variations", "seeds", "policy_sha256")


def open_folder(path: pathlib.Path, configuration: Mapping[str, Any]) -> Store:
    """Opens or creates the folder of a configuration; returns its store by (variation, seed).

    Args:
        path: New folder, or one of the same configuration except for variations, seeds and names of
            the policy's files.
        configuration: Value of `Configuration.as_json`.

    Raises:
        StoreError: if the folder has episodes of another configuration or a damaged file.
    """
    store, file = _store(path, configuration), path / "provenance.json"
    result = {} if store.is_empty() or not file.exists() else read_json(file)
    there = store.claimed_for().get("policy")
    if there != configuration["policy"]:
        configuration = _renamed(configuration, there, result.get("policy_sha256", {}))
        store = _store(path, configuration)
    differ = store.differences()
    if "policy" in differ:
        differ[differ.index("policy")] = f"policy ({there!r}, not {configuration['policy']!r})"
    if not differ and result.get("specification", store.digest) != store.digest:
        raise StoreError(f"{file} belongs to another evaluation; delete it")
    known, hashes = result.get("policy_sha256", {}), configuration["policy_sha256"]
    changed = [name for name, value in hashes.items() if known.get(name, value) != value]
    if changed:
        differ.append(f"content of {', '.join(changed)}")
    if differ:
        raise StoreError(
            f"{path} holds an evaluation with different {', '.join(differ)}: choose a new folder, "
            f"such as --out {path}_2, or delete {path}"
        )
    store.claim()
    write_json(file, {"specification": store.digest, "policy_sha256": known | hashes})
    return store


def _store(path: pathlib.Path, configuration: Mapping[str, Any]) -> Store:
    fixed = {name: value for name, value in configuration.items() if name not in _GROWS}
    return Store(path / "episodes", fixed, JSON)


def _renamed(
    configuration: Mapping[str, Any], there: str | None, known: Mapping[str, str]
) -> Mapping[str, Any]:
    """Returns a configuration with the policy's name in the folder, if its files are the same.

    Args:
        configuration: Value of `Configuration.as_json`.
        there: Name of the folder's policy; None without one.
        known: SHA-256 of the folder's policy files, by name.
    """
    here, seeds = configuration["policy"], configuration["seeds"]
    if there is None or not (here.endswith(SUFFIX) and there.endswith(SUFFIX)):
        return configuration
    if (SEED in here) != (SEED in there):
        return configuration
    own, names = configuration["policy_sha256"], (here, there)
    pairs = [[name.replace(SEED, str(seed)) for name in names] for seed in seeds]
    hashes = {theirs: own[ours] for ours, theirs in pairs}
    shared = hashes.keys() & known.keys()
    if not shared or any(hashes[name] != known[name] for name in shared):
        return configuration
    return {**configuration, "policy": there, "policy_sha256": hashes}
