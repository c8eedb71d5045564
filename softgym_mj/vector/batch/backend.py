"""`BatchBackend`: simulates environments of one task as rows of arrays on a device."""

import math
from collections.abc import Callable, Hashable, Mapping, Sequence
from typing import Any

import gymnasium
import numpy as np
from array_api_compat import is_torch_array
from gymnasium.vector import AutoresetMode

from softgym_mj.batch.device import Device
from softgym_mj.batch.solver import NOT_FINITE
from softgym_mj.envs.gymnasium_env import SoftGymEnv
from softgym_mj.envs.snapshots import Snapshot
from softgym_mj.exceptions import InvalidArgumentError, LifecycleError, check_count
from softgym_mj.metrics import Array, Measures
from softgym_mj.robots.grip import may_be
from softgym_mj.robots.gripper import HELD
from softgym_mj.tasks.shared.observations import STATES
from softgym_mj.tasks.shared.state import Episode, State
from softgym_mj.vector.backend import (
    MOST_ENVIRONMENTS,
    Backend,
    check_running,
    checked_actions,
    clipping,
)
from softgym_mj.vector.batch.cameras import IMAGES, Cameras
from softgym_mj.vector.batch.cloth import ClothBatch
from softgym_mj.vector.batch.fluid import FluidBatch
from softgym_mj.vector.batch.initial_states import MANY, SOON, InitialStateCache
from softgym_mj.vector.batch.next_episodes import NextEpisodes
from softgym_mj.vector.batch.padded_rows import PaddedRows
from softgym_mj.vector.batch.physics import BatchPhysics
from softgym_mj.vector.variation_sampler import VariationSampler

_FOLLOWED = (AutoresetMode.NEXT_STEP, AutoresetMode.SAME_STEP)  # Modes with automatic resets.


class BatchBackend(Backend):
    """Backend of a batch; the task's own functions compute rewards and observations of all rows.

    No step waits for the device: the initial states of next episodes are stored there in advance,
    and the counts of used ones are read some steps later.
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
            raise InvalidArgumentError("render_mode", example.render_mode, "None, on this device")
        self._example, self._device, self._xp = example, device, device.xp
        self._task, self.horizon = example.dm_env.task, example.horizon
        self._names = _observations(example)
        self.num_envs = check_count("num_envs", num_envs, 1, MOST_ENVIRONMENTS)
        kind = ClothBatch if self._task.flexes.flexes else FluidBatch
        self._physics: BatchPhysics = kind(example.dm_env, num_envs, device)
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

    def begin(self, function: Callable[..., Any], *args: Any) -> Callable[[], Any]:
        outcome = function(*args)
        return lambda: outcome

    def close(self) -> None:
        self._example.close()

    # ------------------------------------------------------------------ episodes

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

    @property
    def _episode(self) -> Episode:
        return Episode(**self._rows.whole["episode"])

    def _look(self) -> None:
        """Reads the state and measures it."""
        # The number of points of the largest model of these episodes.
        whole = self._rows.whole
        sizes = [points.shape[1] for points in whole["episode"]["points"].values()]
        self._state = self._physics.task_state(max(sizes))
        self._measures = self._task.measure(self._state, self._episode)
        self._strains = self._physics.strains()
        whole["strain"] = self._xp.maximum(whole["strain"], self._strains)

    def checked(self, actions: Any) -> Array:
        """Checks actions; of tensors only shape and type, so that nothing waits for the device.

        Tensors are clipped to [-1, 1] without a warning, and values that are not finite end the
        episode of their environment. With `clip_actions=False` tensors are read and checked, too.
        """
        if not is_torch_array(actions):
            checked = checked_actions(actions, self.num_envs, self.action_space, self.clipped)
            return self._device.put(checked.astype(float))
        shape = self.num_envs, *(self.action_space.shape or ())
        like = self._actions
        if type(like) is not type(actions) or actions.device != like.device:
            raise InvalidArgumentError(
                "actions", f"on {actions.device}", "on the environments' device"
            )
        if tuple(actions.shape) != shape or not actions.is_floating_point():
            raise InvalidArgumentError(
                f"actions are {actions.dtype}{tuple(actions.shape)}; expected real numbers {shape}."
            )
        actions = actions.detach().double()
        if self.clipped is None:
            checked_actions(self._device.get(actions), self.num_envs, self.action_space)
        return self._xp.clip(actions, -1.0, 1.0)

    def replay(self, trials: Sequence[tuple[Snapshot, np.ndarray]]) -> np.ndarray:
        """Returns the undiscounted returns (num_envs,) of action sequences from states.

        A sequence counts up to the end of its episode. The return is minus infinity if the
        simulation diverges.

        Args:
            trials: States, each with sequences (m, steps, n) to play; num_envs sequences in all.
        """
        origins = [self._origin(i, snapshot) for i, (snapshot, _) in enumerate(trials)]
        counts = [len(sequences) for _, sequences in trials]
        rows, first, left = np.repeat(origins, counts, axis=0).T
        self._start(dict(enumerate(rows.tolist())), dict(enumerate(first.tolist())))
        actions = np.concatenate([sequences for _, sequences in trials])
        xp, left = self._xp, self._device.put(left)
        returns = self._device.zeros((self.num_envs,), "float64")
        for k in range(min(actions.shape[1], max(origin[2] for origin in origins))):
            _, rewards, diverged, _, _ = self.advance(self._device.put(actions[:, k]), None)
            total = xp.where(diverged, -math.inf, returns + rewards)
            returns = xp.where(k < left, total, returns)
        return self._device.get(returns)

    def _origin(self, i: int, snapshot: Snapshot) -> tuple[int, int, int]:
        """Returns the cache rows of snapshot `i` and of its variation, and the env steps left.

        A snapshot is read once as long as it is the same object: reading costs more than a step of
        an environment, and planners try many samples from one.
        """
        if i not in self._origins or self._origins[i][0] is not snapshot:
            # Keys start at `num_envs`: `restore` uses those below.
            row, variation = self._initial_states.restored(self.num_envs + i, snapshot)
            left = 0 if snapshot.ended else self.horizon - snapshot.step_count
            self._origins[i] = snapshot, (row, self._initial_states.row(variation), left)
        return self._origins[i][1]

    def advance(self, actions: Any, mode: AutoresetMode | None) -> tuple[Any, Any, Any, Any, Any]:
        """Makes an env step; with mode None ended episodes continue."""
        if not self._started.all():
            raise LifecycleError("no episode has started: call reset() first")
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
        device repeats sim steps one by one.
        """
        repeat, steps = self._device.repeat, self._task.action_repeat
        if self._task.actor.sim_steps is None:
            parts = self._command, *[self._sim_step] * steps
            return repeat(key, lambda: self._kept(*parts, lambda: self._outcome(mode)))
        repeat(key, lambda: self._kept(self._command), "command")
        for _ in range(self._physics.sim_steps(steps)):
            repeat(key, lambda: self._kept(self._sim_step), "sim step")
        return repeat(key, lambda: self._kept(lambda: self._outcome(mode)), "outcome")

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
        xp, at, flags = self._xp, self._at, self._physics.flags
        self._physics.sim_step()
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

    # ------------------------------------------------------------------ what is seen

    def observe(self) -> Any:
        seen = {name: self._seen(name) for name in self._names if name not in IMAGES}
        if self._cameras.names:
            points, poses = self._physics.points(self._task.max_points), self._physics.poses()
            seen |= self._cameras.draw(self._rows.whole["view"], points, poses)
        if isinstance(self.observation_space, gymnasium.spaces.Dict):
            return {name: seen[name] for name in self.observation_space}
        return seen[self._names[0]]

    def _seen(self, name: str) -> Array:
        assert self._state is not None, "after a reset"
        if name == HELD:
            return self._physics.holds()
        value = STATES[name].value(self._task, self._state, self._episode)
        space = self.observation_space
        own = space[name] if isinstance(space, gymnasium.spaces.Dict) else space
        return self._xp.astype(value, getattr(self._xp, np.dtype(own.dtype).name))

    def infos(self, mask: Array) -> dict[str, Any]:
        assert self._state is not None and self._measures is not None, "after a reset"
        xp, whole = self._xp, self._rows.whole
        found = {
            **self._task.describe(self._state, self._episode, self._measures),
            **self._physics.info(self._strains, whole["strain"]),
            **{f"domain_{name}": values for name, values in whole.get("domain", {}).items()},
            "variation": whole["episode"]["variation"],
            "physics_warnings": self._at["warnings"],
            "diverged": self._at["diverged"],
        }
        mask = self._device.put(mask) if isinstance(mask, np.ndarray) else mask
        named: dict[str, Any] = {}
        for name, values in found.items():
            named[name] = xp.where(mask, values, xp.zeros_like(values))
            named[f"_{name}"] = xp.asarray(mask, copy=True)
        return named

    def last(self, observations: Any, infos: dict[str, Any], ended: Array) -> dict[str, Any]:
        if isinstance(ended, np.ndarray):
            return super().last(observations, infos, ended)
        return {"final_obs": observations, "final_info": infos,
                "_final_obs": ended, "_final_info": ended}  # fmt: skip

    # ------------------------------------------------------------------ snapshots

    def get_state(self) -> list[Snapshot]:
        names = ("variation", "strain", "count", "ended")
        each = zip(*(self._device.get(array).tolist() for array in self._read()), strict=True)
        return [
            self._initial_states.snapshot(
                *self._physics.get_state(i), **dict(zip(names, values, strict=True))
            )
            for i, values in enumerate(each)
        ]

    def _read(self) -> tuple[Array, ...]:
        whole = self._rows.whole
        return whole["episode"]["variation"], whole["strain"], self._at["count"], self._at["ended"]

    def restore(self, snapshots: Mapping[int, Snapshot]) -> None:
        rows, first, counts = {}, {}, {}
        for i, snapshot in snapshots.items():
            rows[i], variation = self._initial_states.restored(i, snapshot)
            first[i] = self._initial_states.row(variation)
            counts[i] = self.horizon if snapshot.ended else snapshot.step_count
        self._start(rows, first, counts)

    def call(self, name: str, arguments: Sequence[tuple[Sequence, Mapping]]) -> tuple[Any, ...]:
        if name == "horizon":
            return (self.horizon,) * self.num_envs
        if name == "shorten":
            steps = np.array([int(share * self.horizon) for (share,), _ in arguments])
            self._at["count"] += self._device.put(steps)
            return (None,) * self.num_envs
        raise InvalidArgumentError("name", name, "'horizon' or 'shorten', on this device")


def _observations(example: SoftGymEnv) -> tuple[str, ...]:
    """Returns the names of observations.

    Raises:
        InvalidArgumentError: If batches do not support one of them.
    """
    names, known = tuple(example.dm_env.observation_spec()), (*STATES, HELD, *IMAGES)
    for name in names:
        if name not in known:
            raise InvalidArgumentError("observation", name, known)
    return names
