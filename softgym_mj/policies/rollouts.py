"""`Rollouts`: returns of many action sequences from one state, by any executor or on a device.

A snapshot restores an episode exactly, so that the returns do not depend on who computes them.
"""

import functools
import json
import pickle
from collections.abc import Mapping
from typing import Any, Protocol

import numpy as np
from dm_control.rl.control import PhysicsError
from gymnasium.vector.utils import CloudpickleWrapper

from softgym_mj import registry
from softgym_mj.envs.environment import Environment, Snapshot
from softgym_mj.envs.gymnasium_env import SoftGymEnv
from softgym_mj.envs.load import load
from softgym_mj.jobs.executors import Executor, SerialExecutor
from softgym_mj.registry import TaskRecord
from softgym_mj.vector.batch.backend import BatchBackend
from softgym_mj.vector.make import make_place

# Calls for each worker at a time: enough to even out sequences that take longer than others.
CALLS_PER_WORKER = 3


class Rollouts(Protocol):
    """Plays action sequences in copies of an environment."""

    def returns(self, snapshot: Snapshot, sequences: np.ndarray) -> np.ndarray:
        """Undiscounted returns (n,) of action sequences (n, horizon, size) from a state.

        A sequence counts up to the end of the episode.
        """


class ExecutorRollouts(Rollouts):
    """One after the other in as many environments as an executor has workers."""

    def __init__(self, task: str | TaskRecord, settings: Mapping[str, object], executor: Executor):
        """Chooses what is played.

        Args:
            task: task name or record: what is registered now, whatever replaces it later.
            settings: keyword arguments of the task that JSON can hold.
            executor: where they are played.
        """
        self._key = sent_to(executor, task), json.dumps(dict(settings), sort_keys=True)
        self._executor = executor

    def returns(self, snapshot: Snapshot, sequences: np.ndarray) -> np.ndarray:
        workers = self._executor.number
        number = 1 if workers == 1 else min(len(sequences), CALLS_PER_WORKER * workers)
        parts = np.array_split(sequences, number)
        calls = [(*self._key, snapshot, part) for part in parts]
        return np.concatenate(self._executor.all(play_sequences, calls))


class DeviceRollouts(Rollouts):
    """All at once, as rows of arrays on a device: see `vector.make_vec`."""

    def __init__(self, task: str | TaskRecord, settings: Mapping[str, object], device: str):
        """Chooses what is played.

        Args:
            task, settings: as of `ExecutorRollouts`.
            device: "host" or "cuda".
        """
        arguments: dict[str, Any] = {"observation": "reduced", **settings}
        self._make = functools.partial(SoftGymEnv, registry.find(task), split="all", **arguments)
        self._device = device
        self._backends: dict[int, BatchBackend] = {}  # By the number of sequences.

    def returns(self, snapshot: Snapshot, sequences: np.ndarray) -> np.ndarray:
        number = len(sequences)
        if number not in self._backends:
            place = make_place(self._device, number)
            self._backends = {number: BatchBackend(self._make(), number, place)}
        return self._backends[number].replay(snapshot, sequences)


def sent_to(executor: Executor, task: str | TaskRecord) -> TaskRecord | bytes:
    """A task as calls of this executor take it: pickled, with its class if no module has it.

    Other processes have not necessarily registered it.
    """
    record = registry.find(task)
    if isinstance(executor, SerialExecutor):
        return record
    return pickle.dumps(CloudpickleWrapper(record))  # type: ignore[arg-type]  # Wraps anything.


def play_sequences(
    task: TaskRecord | bytes, settings: str, snapshot: Snapshot, sequences: np.ndarray
) -> np.ndarray:
    """Returns (n,) of sequences (n, horizon, size), in an environment that is kept.

    Nothing is worse than a sequence with which the simulation diverges.
    """
    env = kept_environment(task, settings)
    returns = np.zeros(len(sequences))
    for i, actions in enumerate(sequences):
        env.set_state(snapshot)
        try:
            for action in actions:
                timestep = env.step(action)
                returns[i] += timestep.reward
                if timestep.last():
                    break
        except PhysicsError:
            returns[i] = -np.inf
    return returns


@functools.lru_cache(maxsize=1)
def kept_environment(task: TaskRecord | bytes, settings: str) -> Environment:
    """This process's environment of a task: to be used for one thing at a time.

    A task that is registered again is another one: its record is.

    Args:
        task: as `sent_to` returns it.
        settings: keyword arguments as JSON; the observation is "reduced" unless they name one.
    """
    record = pickle.loads(task).fn if isinstance(task, bytes) else task
    arguments = {"observation": "reduced", **json.loads(settings)}
    return load(record, split="all", **arguments)
