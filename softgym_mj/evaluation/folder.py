"""Folder of an evaluation: its episodes and provenance."""

import pathlib
from collections.abc import Mapping
from typing import Any

from softgym_mj.exceptions import StoreError
from softgym_mj.storage.files import read_json, write_json
from softgym_mj.storage.store import JSON, Store

# Entries of a configuration that may grow: a new seed may have a policy file of its own.
_GROWS = ("variations", "seeds", "policy_sha256")


def open_folder(path: pathlib.Path, configuration: Mapping[str, Any]) -> Store:
    """Opens or creates the folder of a configuration; returns its store by (variation, seed).

    Args:
        path: New folder, or one of the same configuration except for variations and seeds.
        configuration: Value of `Configuration.as_json`.

    Raises:
        StoreError: if the folder has episodes of another configuration or a damaged file.
    """
    fixed = {name: value for name, value in configuration.items() if name not in _GROWS}
    store = Store(path / "episodes", fixed, JSON)
    file = path / "provenance.json"
    differ = store.differences()
    result = {} if store.is_empty() or not file.exists() else read_json(file)
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
