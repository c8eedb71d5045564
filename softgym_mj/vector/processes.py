"""`ProcessBackend`: environments in worker processes, each of which steps its share in turn."""

import copy
import multiprocessing
import os
from collections.abc import Callable, Mapping, Sequence
from typing import Any

import cloudpickle
import gymnasium
import numpy as np
from gymnasium import spaces
from gymnasium.vector import AutoresetMode
from gymnasium.vector.utils import create_shared_memory, read_from_shared_memory

from softgym_mj.envs.snapshots import Snapshot
from softgym_mj.exceptions import InvalidArgumentError, check_count, check_name
from softgym_mj.parallel.executors import MOST_PROCESSES
from softgym_mj.vector.backend import MOST_ENVIRONMENTS, Backend, check_running, clipping
from softgym_mj.vector.pool import WorkerPool
from softgym_mj.vector.variation_sampler import VariationSampler
from softgym_mj.vector.worker import OUTCOME

# Modules that a fork server imports once for all workers. None opens OpenGL, which does not survive
# a fork.
_PRELOADED = [
    "softgym_mj.vector.worker",
    "softgym_mj.envs.environment",
    "softgym_mj.envs.gymnasium_env",
]


class ProcessBackend(Backend):
    """Backend of worker processes; observations and images come through shared memory."""

    sampler: VariationSampler

    def __init__(
        self,
        make: Callable[[], gymnasium.Env],
        num_envs: int,
        *,
        num_workers: int | None = None,
        context: str | None = None,
    ):
        """Starts the workers.

        Args:
            make: Makes an environment that accepts the options of `SoftGymEnv.reset`.
            num_envs: Number of environments, 1 or more.
            num_workers: Number of processes, as in `make_vec`.
            context: Start method of processes, as in `make_vec`.

        Raises:
            InvalidArgumentError: If an argument is invalid.
        """
        self.num_envs = check_count("num_envs", num_envs, 1, MOST_ENVIRONMENTS)
        if num_workers is None:
            num_workers = min(num_envs, num_cores())
        self.num_workers = check_count("num_workers", num_workers, 1, min(num_envs, MOST_PROCESSES))
        known = multiprocessing.get_all_start_methods()
        if context is None:
            context = "forkserver" if "forkserver" in known else "spawn"
        check_name("context", context, known)
        try:
            pickled = cloudpickle.dumps(make)
        except Exception as error:  # Whatever the classes of the arguments raise.
            raise InvalidArgumentError(
                f"the environments cannot be sent to worker processes: {error}; an argument or the "
                "custom task cannot be pickled"
            ) from error
        example = make()
        self.observation_space, self.action_space = example.observation_space, example.action_space
        self.metadata, self.render_mode = example.metadata, example.render_mode
        self.clipped = clipping(example)
        example.close()
        methods: Any = multiprocessing.get_context(context)
        if context == "forkserver":
            methods.set_forkserver_preload(_PRELOADED)
        shown = spaces.Tuple((self.observation_space, OUTCOME))
        memory = create_shared_memory(shown, num_envs, methods)
        views: Any = read_from_shared_memory(shown, memory, num_envs)
        self._observations, self._outcomes = views
        self._infos: dict[int, Mapping[str, Any]] = {}
        bounds = np.linspace(0, num_envs, num_workers + 1).round()
        self._workers = np.searchsorted(bounds, np.arange(num_envs), "right") - 1
        self._pool = WorkerPool(methods, num_workers, pickled, shown, memory)

    def begin(self, function: Callable[..., Any], *args: Any) -> Callable[[], Any]:
        return self._pool.begin(function, *args)

    def close(self) -> None:
        self._pool.close()

    def _ask(self, calls: Mapping[int, tuple]) -> dict[int, Any]:
        """Calls methods of environments, in parallel across workers; returns their answers."""
        shares: dict[int, dict[int, tuple]] = {}
        for i, call in calls.items():
            shares.setdefault(int(self._workers[i]), {})[i] = call
        answers = self._pool.ask(shares).values()
        return {i: answer for share in answers for i, answer in share.items()}

    def reset(self, variations: Mapping[int, int]) -> None:
        self._infos |= self._ask({i: ("start", index) for i, index in variations.items()})

    def restore(self, snapshots: Mapping[int, Snapshot]) -> None:
        self._infos |= self._ask({i: ("restore", snapshot) for i, snapshot in snapshots.items()})

    def advance(self, actions: Any, mode: AutoresetMode) -> tuple[Any, Any, Any, Any, Any]:
        everyone, ended = np.ones(self.num_envs, bool), self._ended()
        if mode == AutoresetMode.DISABLED:
            check_running(ended)
        starts = self._drawn(ended & (mode == AutoresetMode.NEXT_STEP))
        steps = {i: ("step", action) for i, action in enumerate(actions)}
        self._infos |= self._ask(steps | {i: ("start", v) for i, v in starts.items()})
        rewards, terminated, truncated = self._outcomes.T.copy()
        ended, last = self._ended(), {}
        if mode == AutoresetMode.SAME_STEP and ended.any():
            last = self.last(self.observe(), self.infos(ended), ended)
            self.reset(self._drawn(ended))
        outcome = rewards, terminated.astype(bool), truncated.astype(bool)
        return self.observe(), *outcome, last | self.infos(everyone)

    def _drawn(self, mask: np.ndarray) -> dict[int, int]:
        """Returns variations of the next episodes by index of the environment."""
        return {i: self.sampler.next(i) for i in np.flatnonzero(mask).tolist()}

    def _ended(self) -> np.ndarray:
        """Which episodes have ended, (num_envs,) bool."""
        return self._outcomes[:, 1:].any(axis=1)

    def observe(self) -> Any:
        return copy.deepcopy(self._observations)

    def infos(self, mask: np.ndarray) -> dict[str, Any]:
        return _by_name({i: self._infos[i] for i in np.flatnonzero(mask).tolist()}, self.num_envs)

    def get_state(self) -> list[Snapshot]:
        return [snapshot for snapshot, _ in self.call("get_state", [((), {})] * self.num_envs)]

    def call(self, name: str, arguments: Sequence[tuple[Sequence, Mapping]]) -> tuple[Any, ...]:
        return tuple(
            self._ask({i: ("call", name, *own) for i, own in enumerate(arguments)}).values()
        )


def num_cores() -> int:
    """Returns the number of cores that this process may use."""
    if hasattr(os, "sched_getaffinity"):
        return len(os.sched_getaffinity(0))
    return os.cpu_count() or 1


def _by_name(infos: Mapping[int, Mapping[str, Any]], number: int) -> dict[str, Any]:
    """Returns Gymnasium's infos by name: values (number, ...), and masks "_name" (number,)."""
    named: dict[str, Any] = {}
    for key in dict.fromkeys(key for info in infos.values() for key in info):
        own = {i: info[key] for i, info in infos.items() if key in info}
        first = next(iter(own.values()))
        if isinstance(first, dict):
            named[key] = _by_name(own, number)
        elif isinstance(first, (int, float, np.number, np.ndarray)):
            named[key] = np.zeros((number, *np.shape(first)), np.asarray(first).dtype)
            named[key][list(own)] = list(own.values())
        else:
            named[key] = np.full(number, None, object)
            for i, value in own.items():
                named[key][i] = value
        named[f"_{key}"] = np.zeros(number, bool)
        named[f"_{key}"][list(own)] = True
    return named
