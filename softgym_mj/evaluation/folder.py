"""The folder of an evaluation: a file for each finished episode, a journal of a planned one."""

import pathlib
from collections.abc import Mapping
from typing import Any

from softgym_mj.evaluation.machine import machine
from softgym_mj.exceptions import ResultError
from softgym_mj.jobs.files import read_json, write_json


class Folder:
    """What an evaluation has done so far."""

    def __init__(self, path: pathlib.Path, configuration: Mapping[str, Any]):
        """Makes a folder one of this configuration.

        Args:
            path: of the folder; new, without an episode, or of the same configuration but for
                variations and seeds.
            configuration: as `Configuration.as_json` returns it.

        Raises:
            ResultError: if it holds episodes of another configuration, or a damaged file.
        """
        self._path = path
        file = path / "configuration.json"
        grows = ("variations", "seeds")
        own = {key: configuration[key] for key in configuration if key not in grows}
        own["machines"] = [machine()]
        if file.exists() and any((path / "episodes").glob("*")):
            own = self._merged(read_json(file), own)
        self.machines: list[dict] = own["machines"]
        write_json(file, own)

    def _merged(self, found: Mapping[str, Any], own: Mapping[str, Any]) -> dict[str, Any]:
        """The configuration of both evaluations: more policies of a kind, or machines."""
        fixed = [key for key in own if key not in ("policy_sha256", "machines")]
        differ = [key for key in fixed if found.get(key) != own[key]]
        known, hashes = found.get("policy_sha256", {}), own["policy_sha256"]
        changed = [name for name, value in hashes.items() if known.get(name, value) != value]
        if changed:
            differ.append(f"content of {', '.join(changed)}")
        if differ:
            raise ResultError(
                f"{self._path} holds an evaluation with another {', '.join(differ)}; choose "
                "another folder or delete it"
            )
        machines = found.get("machines", [])
        more = [other for other in own["machines"] if other not in machines]
        return {**own, "policy_sha256": known | hashes, "machines": machines + more}

    def episode(self, variation: int, seed: int) -> dict | None:
        """A finished episode."""
        file = self._file(variation, seed)
        return read_json(file) if file.exists() else None

    def add(self, episode: Mapping[str, Any]) -> None:
        """Keeps a finished episode."""
        write_json(self._file(episode["variation"], episode["seed"]), episode)

    def journal(self, variation: int, seed: int) -> pathlib.Path:
        """File for the plans of an episode."""
        return self._file(variation, seed).with_suffix(".jsonl")

    def finish(self, result: Mapping[str, Any]) -> None:
        """Writes the result."""
        write_json(self._path / "result.json", result)

    def _file(self, variation: int, seed: int) -> pathlib.Path:
        return self._path / "episodes" / f"{variation:04d}_seed{seed}.json"
