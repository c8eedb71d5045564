"""`Rollouts`: returns of many action sequences from one state, on any executor.

Snapshots are exact, so that returns do not depend on the worker that computes them.
"""

import functools
import json
import pickle
from collections.abc import Generator, Mapping, Sequence
from typing import Any, Protocol, TypeVar

import numpy as np
from gymnasium.vector.utils import CloudpickleWrapper

from softgym_mj import registry
from softgym_mj.envs.environment import Environment
from softgym_mj.envs.load import load
from softgym_mj.envs.snapshots import Snapshot
from softgym_mj.parallel.executors import Executor, SerialExecutor
from softgym_mj.registry import TaskRecord

# Calls per worker: several balance sequences of different duration.
CALLS_PER_WORKER = 3

T = TypeVar("T")
Trial = tuple[Snapshot, np.ndarray]  # Initial state and action sequences (n, horizon, size).
Asking = Generator[Trial, np.ndarray, T]  # Yields trials and is sent their returns (n,).


class Rollouts(Protocol):
    """Plays action sequences in copies of an environment."""

    def returns(self, snapshot: Snapshot, sequences: np.ndarray) -> np.ndarray:
        """Computes undiscounted returns (n,) of action sequences (n, horizon, size) from a state.

        A sequence ends with the episode.
        """

    def all(self, trials: Sequence[Trial]) -> list[np.ndarray]:
        """Computes the returns of several trials of the same horizon."""
        return [self.returns(*trial) for trial in trials]


class ExecutorRollouts(Rollouts):
    """Rollouts on an executor, one environment per worker."""

    def __init__(self, task: str | TaskRecord, settings: Mapping[str, object], executor: Executor):
        """Sets the executor, and the task with its keyword arguments, which JSON can hold."""
        self._key = sent_to(executor, task), json.dumps(dict(settings), sort_keys=True)
        self._executor = executor

    def returns(self, snapshot: Snapshot, sequences: np.ndarray) -> np.ndarray:
        workers = self._executor.number
        number = 1 if workers == 1 else min(len(sequences), CALLS_PER_WORKER * workers)
        parts = np.array_split(sequences, number)
        calls = [(*self._key, snapshot, part) for part in parts]
        return np.concatenate(self._executor.all(play_sequences, calls))


def answered(askers: Sequence[Asking[T]], rollouts: Rollouts) -> list[T]:
    """Runs generators that yield trials and plays these together; returns the final values."""
    result: dict[int, T] = {}
    answers: dict[int, Any] = dict.fromkeys(range(len(askers)))  # None starts a generator.
    while True:
        trials: dict[int, Trial] = {}
        for i, answer in answers.items():
            try:
                trials[i] = askers[i].send(answer)
            except StopIteration as end:
                result[i] = end.value
        if not trials:
            return [result[i] for i in range(len(askers))]
        answers = dict(zip(trials, rollouts.all([*trials.values()]), strict=True))


def sent_to(executor: Executor, task: str | TaskRecord) -> TaskRecord | bytes:
    """Returns a task as an argument for calls of an executor.

    Worker processes may not have registered the task, so they get its pickled record, which
    includes the class if no module defines it.
    """
    record = registry.find(task)
    if isinstance(executor, SerialExecutor):
        return record
    return pickle.dumps(CloudpickleWrapper(record))  # type: ignore[arg-type]  # Wraps anything.


def received(task: TaskRecord | bytes) -> TaskRecord:
    """Returns the record of a value of `sent_to`."""
    return pickle.loads(task).fn if isinstance(task, bytes) else task


def play_sequences(
    task: TaskRecord | bytes, settings: str, snapshot: Snapshot, sequences: np.ndarray
) -> np.ndarray:
    """Computes returns (n,) of sequences (n, horizon, size) in this process's environment.

    The return is -inf if the simulation diverges.
    """
    env = kept_environment(task, settings)
    returns = np.zeros(len(sequences))
    for i, actions in enumerate(sequences):
        env.set_state(snapshot)
        for action in () if snapshot.ended else actions:  # After the end, a step would reset.
            timestep = env.step(action)
            returns[i] += timestep.reward
            if timestep.last():
                break
        if env.diverged:
            returns[i] = -np.inf
    return returns


@functools.lru_cache(maxsize=1)
def kept_environment(task: TaskRecord | bytes, settings: str) -> Environment:
    """Returns this process's cached environment of a value of `sent_to` and settings as JSON."""
    arguments = {"observation": "reduced", **json.loads(settings)}
    return load(received(task), split="all", **arguments)
