"""Episodes of a dataset: played, and kept in files until all of them are there."""

import io
import json
import pathlib
import shutil
import zipfile
from collections.abc import Mapping
from typing import Any

import dm_env
import gymnasium
import numpy as np

from softgym_mj.exceptions import ResultError
from softgym_mj.jobs.files import read_json, write_json, write_whole
from softgym_mj.policies.factory import Policy

_BETWEEN = "/"  # Part and name of an array: "infos/success".


def play(env: gymnasium.Env, act: Policy, variation: int) -> dict[str, Any]:
    """What happens in an episode of n env steps.

    Minari's own collector does the same, but needs JAX for it.

    Args:
        env: where; its observations are named or not.
        act: the policy.
        variation: index 0..999.

    Returns:
        Arrays over time by name: "observations" and "infos" (n + 1, ...), by names of their own if
        they have such; "actions" (n, size), "rewards", "terminations" and "truncations" (n,).
    """
    observation, info = env.reset(options={"variation": variation})
    timestep = dm_env.restart(_named(observation))
    observations, infos = [observation], [info]
    steps: dict[str, list] = {"actions": [], "rewards": [], "terminations": [], "truncations": []}
    while not (steps["truncations"] and (steps["truncations"][-1] or steps["terminations"][-1])):
        action = act(timestep).astype(env.action_space.dtype)
        observation, *outcome, info = env.step(action)
        timestep = dm_env.transition(outcome[0], _named(observation))
        observations.append(observation)
        infos.append(info)
        for values, value in zip(steps.values(), (action, *outcome), strict=True):
            values.append(value)
    played = {name: np.array(values) for name, values in steps.items()}
    return {**played, "observations": _over_time(observations), "infos": _over_time(infos)}


def _over_time(values: list) -> np.ndarray | dict[str, np.ndarray]:
    """Arrays, or dicts of them, with time as a further axis."""
    if not isinstance(values[0], dict):
        return np.array(values)
    return {name: np.array([value[name] for value in values]) for name in values[0]}


def _named(observation) -> dict:
    """An observation as policies get it."""
    return observation if isinstance(observation, dict) else {"observation": observation}


class KeptEpisodes:
    """A folder with a file for each finished episode: what a killed recording leaves."""

    def __init__(self, path: pathlib.Path, configuration: Mapping[str, Any]):
        """Looks what is there; nothing is written before the first episode.

        Args:
            path: of the folder.
            configuration: everything, JSON-able, that an episode depends on besides its variation.

        Raises:
            ResultError: if the folder is one of another configuration.
        """
        self._path = path
        self._configuration = json.loads(json.dumps(configuration))  # Tuples are lists there.
        self._file = path / "configuration.json"
        if self._file.exists():
            found = read_json(self._file)
            differ = [key for key in configuration if found.get(key) != self._configuration[key]]
            if differ:
                raise ResultError(
                    f"{path} holds episodes of an unfinished recording with another "
                    f"{', '.join(differ)}; finish that, choose another dataset or delete the folder"
                )

    def has(self, variation: int) -> bool:
        """Whether an episode is there."""
        return self._episode_file(variation).exists()

    def episode(self, variation: int) -> dict[str, Any]:
        """An episode as `play` returned it.

        Raises:
            ResultError: if its file is damaged.
        """
        file = self._episode_file(variation)
        try:
            with np.load(file, allow_pickle=False) as content:
                return _nested(dict(content))
        except (OSError, ValueError, zipfile.BadZipFile) as error:
            raise ResultError(f"{file} cannot be read: {error}; delete it") from error

    def add(self, variation: int, episode: Mapping[str, Any]) -> None:
        """Keeps an episode: its file is written whole or not at all."""
        if not self._file.exists():
            write_json(self._file, self._configuration)
        content = io.BytesIO()
        np.savez(content, **_flat(episode))  # type: ignore[arg-type]  # No name is `allow_pickle`.
        write_whole(self._episode_file(variation), content.getvalue())

    def remove(self) -> None:
        """Removes the folder."""
        shutil.rmtree(self._path)

    def _episode_file(self, variation: int) -> pathlib.Path:
        return self._path / "episodes" / f"{variation:04d}.npz"


def _flat(episode: Mapping[str, Any]) -> dict[str, np.ndarray]:
    flat: dict[str, np.ndarray] = {}
    for part, values in episode.items():
        if isinstance(values, dict):
            flat |= {f"{part}{_BETWEEN}{name}": value for name, value in values.items()}
        else:
            flat[part] = values
    return flat


def _nested(flat: Mapping[str, np.ndarray]) -> dict[str, Any]:
    """What `_flat` was made of."""
    episode: dict[str, Any] = {}
    for key, value in flat.items():
        part, _, name = key.partition(_BETWEEN)
        if name:
            episode.setdefault(part, {})[name] = value
        else:
            episode[part] = value
    return episode
