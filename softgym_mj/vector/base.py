"""`VectorEnv`: many environments at once, in worker processes; `gymnasium.make_vec` makes it."""

import copy
import functools
import itertools
import multiprocessing
import os
from collections.abc import Callable, Iterable, Mapping, Sequence
from typing import Any, NoReturn

import gymnasium
import numpy as np
from gymnasium.vector import AutoresetMode
from gymnasium.vector.utils import (
    CloudpickleWrapper,
    batch_space,
    create_shared_memory,
    read_from_shared_memory,
)

from softgym_mj import registry
from softgym_mj.envs.gymnasium_env import SoftGymEnv
from softgym_mj.exceptions import (
    EpisodeEndedError,
    NotCopyableError,
    OutOfRangeError,
    check_count,
    check_name,
)
from softgym_mj.rendering.offscreen import has_rendered
from softgym_mj.vector.arguments import MASK, checked_actions, options_of_each, seed_of_each
from softgym_mj.vector.pool import WorkerPool

_MODES = {mode.value: mode for mode in AutoresetMode}


def make_vector_env(task: str | registry.TaskRecord, **kwargs: Any) -> "VectorEnv":
    """A `VectorEnv` of a task; `gymnasium.make_vec("softgym_mj/SpreadCloth-v0", ...)` calls it.

    Args:
        task: task name or record.
        **kwargs: of `VectorEnv` (num_envs, num_workers, autoreset_mode, context) and of
            `SoftGymEnv` (render_mode, split, observation, actor, ...).
    """
    # Another process has not necessarily registered the same tasks.
    if isinstance(task, str) and task in registry.TASKS:
        task = registry.TASKS[task]
    names = ("num_envs", "num_workers", "autoreset_mode", "context")
    own = {name: kwargs.pop(name) for name in names if name in kwargs}
    return VectorEnv(functools.partial(SoftGymEnv, task, **kwargs), **own)


class VectorEnv(gymnasium.vector.VectorEnv):
    """Environments in a few worker processes, each of which steps its share one by one.

    Observations, images among them, come through shared memory. An error in a worker is raised
    here with its own type; where it comes out of `step`, some have taken the step and others have
    not. A call that is interrupted (Ctrl-C, an alarm) is still carried out by all of them.
    """

    def __init__(
        self,
        make: Callable[[], gymnasium.Env],
        num_envs: int = 1,
        *,
        num_workers: int | None = None,
        autoreset_mode: str | AutoresetMode = AutoresetMode.NEXT_STEP,
        context: str | None = None,
    ):
        """Starts the workers.

        Args:
            make: makes an environment.
            num_envs: number of environments, 1 or more.
            num_workers: number of processes, 1..num_envs; by default one a core. Two a core balance
                variations that differ a lot in cost, as those of water do; each costs some time.
            autoreset_mode: what follows the last step of an episode. "NextStep": the next step
                resets, ignores its action and has reward 0. "SameStep": the last step returns the
                first observation of the next episode, and its own in info["final_obs"] and
                info["final_info"]. "Disabled": you reset, with options={"reset_mask": ended}.
            context: how processes start: "fork", "forkserver" or "spawn". By default Python's own
                way, but "forkserver" rather than "fork" once this process has rendered, as OpenGL
                does not survive a fork. The latter two need `if __name__ == "__main__":` in a
                script.

        Raises:
            OutOfRangeError, UnknownNameError: for a bad argument.
        """
        check_count("num_envs", num_envs, 1)
        if num_workers is None:
            num_workers = min(num_envs, _num_cores())
        check_count("num_workers", num_workers, 1, num_envs)
        if not isinstance(autoreset_mode, AutoresetMode):
            check_name("autoreset_mode", autoreset_mode, _MODES)
            autoreset_mode = _MODES[autoreset_mode]
        if context is not None:
            check_name("context", context, multiprocessing.get_all_start_methods())
        elif multiprocessing.get_start_method() == "fork" and has_rendered():
            context = "forkserver"
        example = make()
        self.num_envs, self._mode = num_envs, autoreset_mode
        self.metadata = {**example.metadata, "autoreset_mode": autoreset_mode}
        self.render_mode = example.render_mode
        self.single_observation_space = example.observation_space
        self.single_action_space = example.action_space
        self.observation_space = batch_space(example.observation_space, num_envs)
        self.action_space = batch_space(example.action_space, num_envs)
        example.close()
        self._ended = np.zeros(num_envs, bool)
        methods: Any = multiprocessing.get_context(context)
        space = self.single_observation_space
        self._shared = create_shared_memory(space, num_envs, methods)
        self._observations = read_from_shared_memory(space, self._shared, num_envs)
        bounds = np.linspace(0, num_envs, num_workers + 1).round().astype(int)
        self._shares = [slice(*pair) for pair in itertools.pairwise(bounds)]
        wrapped = CloudpickleWrapper(make)
        self._pool = WorkerPool(
            methods, [(wrapped, share, autoreset_mode, self._shared) for share in self._shares]
        )

    @property
    def num_workers(self) -> int:
        """Number of processes."""
        return len(self._shares)

    def reset(self, *, seed: int | Sequence[int | None] | None = None, options=None):
        """Starts episodes.

        Args:
            seed: of the first environment, the next has one more, or a sequence of all seeds.
            options: of `SoftGymEnv.reset`, for all; a "variation" can also be a sequence of one for
                each environment, a "state" always is. "reset_mask" (num_envs,) bool: who is to be
                reset.

        Returns:
            Observations and infos of all, arrays by name.

        Raises:
            OutOfRangeError, UnknownNameError, SnapshotError: for bad seeds or options.
        """
        seeds = seed_of_each(seed, self.num_envs)
        options = dict(options or {})
        mask = np.asarray(options.pop(MASK, np.ones(self.num_envs, bool)))
        if mask.shape != (self.num_envs,) or mask.dtype != bool or not mask.any():
            valid = f"({self.num_envs},) bool, at least one of them true"
            raise OutOfRangeError(MASK, mask, valid)
        return self._pool.run(self._reset, seeds, options_of_each(options, self.num_envs), mask)

    def _reset(self, seeds: list[int | None], options: list[dict[str, Any]], mask: np.ndarray):
        calls = {
            i: ("reset", seeds[share], options[share], mask[share])
            for i, share in enumerate(self._shares)
            if mask[share].any()
        }
        answers = self._pool.ask(calls)
        for i in np.flatnonzero(mask):
            self._ended[i] = "state" in options[i] and options[i]["state"][0].ended
        infos = _joined([(self._shares[i], answer) for i, answer in answers.items()], self.num_envs)
        return copy.deepcopy(self._observations), infos

    def step(self, actions: np.ndarray):
        """Applies actions (num_envs, n) in [-1, 1].

        Returns:
            Observations, rewards (num_envs,), terminated, truncated (num_envs,) bool, infos.

        Raises:
            EpisodeEndedError: if an episode has ended and nothing resets by itself.
            InvalidActionError: for a bad action; no environment is stepped then.
        """
        return self._pool.run(
            self._step, checked_actions(actions, self.num_envs, self.single_action_space)
        )

    def _step(self, actions: np.ndarray):
        if self._mode == AutoresetMode.DISABLED and self._ended.any():
            ended = np.flatnonzero(self._ended).tolist()
            raise EpisodeEndedError(
                f"episodes of environments {ended} have ended: call reset(options="
                '{"reset_mask": terminated | truncated}) before step()'
            )
        calls = {i: ("step", actions[share]) for i, share in enumerate(self._shares)}
        answers = list(self._pool.ask(calls).values())
        rewards, terminated, truncated = (
            np.concatenate([answer[k] for answer in answers]) for k in range(3)
        )
        self._ended = terminated | truncated
        infos = _joined(
            [(s, answer[3]) for s, answer in zip(self._shares, answers, strict=True)],
            self.num_envs,
        )
        return copy.deepcopy(self._observations), rewards, terminated, truncated, infos

    def render(self) -> tuple[Any, ...] | None:
        """What `render` of each environment returns."""
        return self.call("render")

    def get_state(self) -> list[Any]:
        """A snapshot of each environment, as of `SoftGymEnv.get_state`, for `set_state`."""
        return list(self.call("get_state"))

    def set_state(self, states: Sequence[Any]):
        """Restores snapshots, of any vector environment or of single ones of the same kind.

        Returns:
            Observations and infos of all, arrays by name.
        """
        return self.reset(options={"state": states})

    def call(self, name: str, *args: Any, **kwargs: Any) -> tuple[Any, ...]:
        """What a method, or an attribute, of each environment returns."""
        calls = {i: ("call", name, args, kwargs) for i in range(self.num_workers)}
        answers = self._pool.run(self._pool.ask, calls)
        return tuple(value for answer in answers.values() for value in answer)

    def get_attr(self, name: str) -> tuple[Any, ...]:
        """An attribute of each environment."""
        return self.call(name)

    def set_attr(self, name: str, values: Any) -> None:
        """Sets an attribute of each environment: to its own of a list or tuple, or to the same."""
        if not isinstance(values, (list, tuple)):
            values = [values] * self.num_envs
        if len(values) != self.num_envs:
            raise OutOfRangeError("values", values, f"{self.num_envs} of them")
        calls = {i: ("set_attr", name, values[share]) for i, share in enumerate(self._shares)}
        self._pool.run(self._pool.ask, calls)

    def close_extras(self, **kwargs: Any) -> None:
        """Ends the workers."""
        self._pool.close()

    def __del__(self):
        if hasattr(self, "_pool"):
            self.close()

    def __reduce__(self) -> NoReturn:
        raise NotCopyableError(
            "a VectorEnv can be neither copied nor pickled, as its environments live in processes "
            "of their own: make another one and use other.set_state(envs.get_state())"
        )


def _num_cores() -> int:
    """Cores that this process may use."""
    if hasattr(os, "sched_getaffinity"):
        return len(os.sched_getaffinity(0))
    return os.cpu_count() or 1


def _joined(parts: Iterable[tuple[slice, Mapping[str, Any]]], number: int) -> dict[str, Any]:
    """Infos of all environments from those of shares; zeros, or None, where a share has none."""
    parts = list(parts)
    joined: dict[str, Any] = {}
    for share, infos in parts:
        for key, values in infos.items():
            if isinstance(values, dict):
                if key not in joined:
                    own = [(place, part[key]) for place, part in parts if key in part]
                    joined[key] = _joined(own, number)
                continue
            if key not in joined:
                empty = None if values.dtype == object else 0
                joined[key] = np.full((number, *values.shape[1:]), empty, values.dtype)
            joined[key][share] = values
    return joined
