"""`Rollouts`: returns of many action sequences from one state, by any executor.

A snapshot restores an episode exactly, so that the returns do not depend on who computes them.
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

# Calls for each worker at a time: enough to even out sequences that take longer than others.
CALLS_PER_WORKER = 3

T = TypeVar("T")
Trial = tuple[Snapshot, np.ndarray]  # A state, and action sequences (n, horizon, size) from there.
Asking = Generator[Trial, np.ndarray, T]  # Yields trials and is sent their returns (n,).


class Rollouts(Protocol):
    """Plays action sequences in copies of an environment."""

    def returns(self, snapshot: Snapshot, sequences: np.ndarray) -> np.ndarray:
        """Undiscounted returns (n,) of action sequences (n, horizon, size) from a state.

        A sequence counts up to the end of the episode.
        """

    def all(self, trials: Sequence[Trial]) -> list[np.ndarray]:
        """The returns of each of some trials, whose horizon is the same."""
        return [self.returns(*trial) for trial in trials]


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


def answered(askers: Sequence[Asking[T]], rollouts: Rollouts) -> list[T]:
    """What generators return whose trials are played, those of all together."""
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
        for action in actions:
            timestep = env.step(action)
            returns[i] += timestep.reward
            if timestep.last():
                break
        if env.diverged:
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
