"""`BatchEpisodes`: starts, steps and resets environments that are rows of arrays on a device."""

from collections.abc import Callable, Hashable, Mapping, Sequence
from typing import Any

import numpy as np
from gymnasium.vector import AutoresetMode

from softgym_mj.batch.device import Device
from softgym_mj.batch.solver import NOT_FINITE
from softgym_mj.envs.environment import Environment
from softgym_mj.envs.gymnasium_env import SoftGymEnv
from softgym_mj.envs.snapshots import Snapshot
from softgym_mj.exceptions import LifecycleError, check_count, cpu_only, import_extra
from softgym_mj.metrics import Array, Measures
from softgym_mj.robots.grip import may_be
from softgym_mj.robots.gripper import HELD
from softgym_mj.tasks.shared.base import Task
from softgym_mj.tasks.shared.batches import check_batch
from softgym_mj.tasks.shared.observations import STATES
from softgym_mj.tasks.shared.state import Episode, State
from softgym_mj.vector.backend import MOST_ENVIRONMENTS, Backend, check_running, clipping
from softgym_mj.vector.batch.cameras import IMAGES, Cameras
from softgym_mj.vector.batch.cloth import ClothBatch
from softgym_mj.vector.batch.fluid import FluidBatch
from softgym_mj.vector.batch.initial_states import MANY, SOON, InitialStateCache
from softgym_mj.vector.batch.next_episodes import NextEpisodes
from softgym_mj.vector.batch.padded_rows import PaddedRows
from softgym_mj.vector.batch.physics import BatchPhysics
from softgym_mj.vector.variation_sampler import VariationSampler

_FOLLOWED = (AutoresetMode.NEXT_STEP, AutoresetMode.SAME_STEP)  # Modes with automatic resets.


class BatchEpisodes(Backend):
    """Episodes of a batch: initial states, steps and automatic resets.

    The task's own functions compute the measures of all rows. No step waits for the device: the
    initial states of next episodes are stored there in advance, and the counts of used ones are
    read some steps later.
    """

    sampler: VariationSampler

    def __init__(
        self,
        example: SoftGymEnv,
        num_envs: int,
        device: Device,
        make: Callable[[], SoftGymEnv] | None = None,
    ):
        """Takes ownership of an example environment, which provides initial states.

        Args:
            example: Example environment.
            num_envs: Number of environments.
            device: Device of the batch.
            make: Makes such an environment in other processes.

        Raises:
            InvalidArgumentError: If the task or a setting is not supported in batches.
        """
        if example.render_mode is not None:
            raise cpu_only(f"render_mode={example.render_mode!r}")
        self._example, self._device, self._xp = example, device, device.xp
        self._task, self.horizon = example.dm_env.task, example.horizon
        self._names = _observations(example)
        self.num_envs = check_count("num_envs", num_envs, 1, MOST_ENVIRONMENTS)
        self._physics = _physics_class(self._task)(example.dm_env, num_envs, device)
        self._cameras = Cameras(example.dm_env, self._names, num_envs, self._physics, device)
        self._initial_states = InitialStateCache(
            example.dm_env, self._physics, self._cameras, device, make
        )
        self._rows = PaddedRows(num_envs, device)
        self._rows.whole["physics"] = self._physics.state
        self.observation_space = example.observation_space
        self.action_space = example.action_space
        self.metadata, self.render_mode = example.metadata, example.render_mode
        self.clipped = clipping(example)
        # Arrays that a step changes: rows of `InitialStateCache` of these episodes and of the next,
        # env steps, automatic resets and warnings so far, and whether the episode has ended or
        # diverged.
        numbers, truths = ("row", "next", "count", "used", "warnings"), ("ended", "diverged")
        self._at = {
            **{name: device.zeros((num_envs,), "int64") for name in numbers},
            **{name: device.zeros((num_envs,), "bool") for name in truths},
        }
        self._rows.whole["at"] = self._at
        self._actions = device.zeros((num_envs, *(self.action_space.shape or ())), "float64")
        self._everyone = device.put(np.ones(num_envs, bool))
        self._started = np.zeros(num_envs, bool)
        self._next_episodes = NextEpisodes(num_envs)
        self._origins: dict[int, tuple[Snapshot, tuple[int, int, int]]] = {}  # Cache of `replay`.
        self._strains: Array = None  # Largest current edge strain.
        self._state: State | None = None
        self._measures: Measures | None = None

    def expect(self, variations: Sequence[int]) -> None:
        """Reads initial states in parallel if the environments will soon use most of them."""
        if self.num_envs >= MANY and len(variations) <= SOON * self.num_envs:
            self._initial_states.prepare(variations)

    def reset(self, variations: Mapping[int, int]) -> None:
        self._initial_states.prepare(variations.values())
        rows = {i: self._initial_states.row(variation) for i, variation in variations.items()}
        self._start(rows, rows)

    def _start(
        self,
        rows: Mapping[int, int],
        first: Mapping[int, int],
        counts: Mapping[int, int] | None = None,
    ) -> None:
        """Starts episodes.

        Args:
            rows: Rows of `InitialStateCache` by index of the environment.
            first: Rows of the initial states of their variations.
            counts: Env steps so far; None means zero.
        """
        which, at, of, count = np.zeros(self.num_envs, bool), *np.zeros((3, self.num_envs), int)
        which[[*rows]], at[[*rows]], of[[*rows]] = True, [*rows.values()], [*first.values()]
        if counts is not None:
            count[[*counts]] = [*counts.values()]
        self._started |= which
        put, xp = self._device.put, self._xp
        mask, at, of, count = put(which), put(at), put(of), put(count)
        self._rows.fit(self._initial_states.rows)
        with self._rows.kept():
            self._at["row"] = xp.where(mask, of, self._at["row"])
            self._take(mask, at)
            self._at["count"] = xp.where(mask, count, self._at["count"])
            self._at["ended"] = xp.where(mask, count >= self.horizon, self._at["ended"])
            self._look()

    def _take(self, which: Array, rows: Array) -> None:
        """Starts environments `which` (num_envs,) at cached initial states `rows` (num_envs,)."""
        xp = self._xp
        if not may_be(xp, which):
            return
        self._rows.take(which, self._initial_states.rows, rows)
        self._at["count"] = xp.where(which, 0, self._at["count"])
        self._at["warnings"] = xp.where(which, 0, self._at["warnings"])
        for name in ("ended", "diverged"):
            self._at[name] = self._at[name] & ~which

    def _check_started(self) -> None:
        if not self._started.all():
            raise LifecycleError("no episode has started: call reset() first")

    @property
    def _episode(self) -> Episode:
        return Episode(**self._rows.whole["episode"])

    def _look(self) -> None:
        """Reads the state and measures it."""
        # The number of points of the largest model of these episodes.
        whole = self._rows.whole
        sizes = [points.shape[1] for points in whole["episode"]["points"].values()]
        self._state = self._physics.task_state(max(sizes))
        if self._measures is None:
            names = [name for name in self._names if name in STATES]
            started = int(np.argmax(self._started))
            check_batch(self._task, self._state, self._episode, names, started)
        self._measures = self._task.measure(self._state, self._episode)
        self._strains = self._physics.strains()
        whole["strain"] = self._xp.maximum(whole["strain"], self._strains)

    def advance(self, actions: Any, mode: AutoresetMode | None) -> tuple[Any, Any, Any, Any, Any]:
        """Makes an env step; with mode None ended episodes continue."""
        self._check_started()
        if mode == AutoresetMode.DISABLED:
            check_running(self._device.get(self._at["ended"]))
        elif mode in _FOLLOWED:
            self._offer()
        self._actions[...] = actions
        self._rows.fit(self._initial_states.rows)
        grown = self._rows.grown, self._initial_states.rows.grown
        key = mode, *grown, self._physics.changed, self._cameras.changed
        found = self._advanced(mode, key)
        if mode in _FOLLOWED:
            self._next_episodes.follow(self._device.copy(self._at["used"]))
        return found

    def _advanced(self, mode: AutoresetMode | None, key: Hashable) -> Any:
        """Computes the result of `advance` from arrays whose addresses depend on `key` only.

        With actions of variable duration the number of sim steps changes from step to step, so the
        device repeats sim steps one by one; likewise with parts that graphs cannot replay.
        """
        repeat, steps, physics = self._device.repeat, self._task.action_repeat, self._physics
        if self._task.actor.sim_steps is None and not physics.is_interleaved:
            parts = self._command, *[self._sim_step] * steps
            return repeat(key, lambda: self._kept(*parts, lambda: self._outcome(mode)))
        repeat(key, lambda: self._kept(self._command), "command")
        for _ in range(physics.sim_steps(steps)):
            physics.begin_sim_step()
            repeat(key, lambda: self._kept(self._sim_step), "sim step")
        physics.finish()
        last = self._note, lambda: self._outcome(mode)
        return repeat(key, lambda: self._kept(*last), "outcome")

    def _kept(self, *parts: Callable[[], Any]) -> Any:
        """Calls functions, keeps arrays at their addresses, returns the last function's result.

        None is returned as ().
        """
        with self._rows.kept():
            *_, found = [part() for part in parts]
        return () if found is None else found

    def _command(self) -> None:
        xp, at = self._xp, self._at
        unknown = xp.any(~xp.isfinite(self._actions), axis=-1)
        self._physics.command(xp.where(unknown[:, None], 0.0, self._actions))
        at["warnings"], at["diverged"] = at["warnings"] + xp.astype(unknown, xp.int64), unknown

    def _sim_step(self) -> None:
        self._physics.sim_step()
        self._note()

    def _note(self) -> None:
        """Applies the failures of a sim step."""
        xp, at, flags = self._xp, self._at, self._physics.flags
        # MuJoCo counts one warning per sim step with a failure, up to the one that ends the
        # episode.
        wrong = (flags != 0) & ~at["diverged"]
        at["warnings"] = at["warnings"] + xp.astype(wrong, xp.int64)
        at["diverged"] = at["diverged"] | ((flags & NOT_FINITE) != 0)
        flags[...] = 0

    def _outcome(self, mode: AutoresetMode | None) -> tuple[Any, Any, Any, Any, Any]:
        """Returns the result of `advance`, after all sim steps."""
        xp, at = self._xp, self._at
        starts = at["ended"] & (mode == AutoresetMode.NEXT_STEP)
        diverged, warnings = at["diverged"] & ~starts, at["warnings"]
        count = at["count"] + 1
        # A diverged episode ends in its initial state so that measures are finite.
        self._use(starts)
        self._take(starts | diverged, at["row"])
        at["count"] = xp.where(starts, 0, count)
        at["warnings"] = xp.where(starts, 0, warnings)
        at["diverged"] = diverged
        truncated = (at["count"] >= self.horizon) & ~diverged
        ended = diverged | truncated
        at["ended"] = ended
        self._look()
        assert self._measures is not None
        rewards = xp.where(starts, 0.0, self._measures.reward)
        last: dict[str, Any] = {}
        if mode == AutoresetMode.SAME_STEP and may_be(xp, ended):
            last = self.last(self.observe(), self.infos(ended), ended)
            self._use(ended)
            self._take(ended, at["row"])
            self._look()
        return self.observe(), rewards, diverged, truncated, last | self.infos(self._everyone)

    def _use(self, which: Array) -> None:
        """Replaces episodes in a mask (num_envs,) bool by the prepared next ones."""
        at, xp = self._at, self._xp
        at["row"] = xp.where(which, at["next"], at["row"])
        at["used"] = at["used"] + xp.astype(which, at["used"].dtype)

    def _offer(self) -> None:
        """Prepares the next episodes of environments that have used their prepared one."""
        changed = self._next_episodes.changed(self.sampler)
        if not changed:
            return
        self._initial_states.prepare(changed.values())
        which, rows = np.zeros(self.num_envs, bool), np.zeros(self.num_envs, int)
        which[[*changed]] = True
        rows[[*changed]] = [*map(self._initial_states.row, changed.values())]
        mask, rows = self._device.put(which), self._device.put(rows)
        self._at["next"][...] = self._xp.where(mask, rows, self._at["next"])

    def settle(self) -> None:
        self._next_episodes.settle(self._device.get(self._at["used"]), self.sampler)


def _physics_class(task: Task) -> Callable[[Environment, int, Device], BatchPhysics]:
    is_water = not task.flexes.flexes
    if not task.actor.wrists:
        return FluidBatch if is_water else ClothBatch
    module, name = ("cup_arms", "CupArmBatch") if is_water else ("arms", "ArmClothBatch")
    return getattr(import_extra(f"softgym_mj.vector.batch.{module}", "JAX", "gpu-arms"), name)


def _observations(example: SoftGymEnv) -> tuple[str, ...]:
    """Returns the names of observations.

    Raises:
        InvalidArgumentError: If batches do not support one of them.
    """
    names, known = tuple(example.dm_env.observation_spec()), (*STATES, HELD, *IMAGES)
    for name in names:
        if name not in known:
            raise cpu_only(f"observation={name!r}")
    return names
