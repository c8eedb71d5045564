"""`BatchBackend`: simulates environments of one task as rows of arrays on a device."""

import math
from collections.abc import Callable, Mapping, Sequence
from typing import Any

import gymnasium
import numpy as np
from array_api_compat import is_torch_array

from softgym_mj.envs.snapshots import Snapshot
from softgym_mj.exceptions import InvalidArgumentError, cpu_only
from softgym_mj.metrics import Array
from softgym_mj.robots.gripper import HELD
from softgym_mj.tasks.shared.observations import STATES
from softgym_mj.vector.backend import checked_actions
from softgym_mj.vector.batch.cameras import IMAGES
from softgym_mj.vector.batch.episodes import BatchEpisodes


class BatchBackend(BatchEpisodes):
    """Backend of a batch: what environments observe, their snapshots and action sequences."""

    def begin(self, function: Callable[..., Any], *args: Any) -> Callable[[], Any]:
        outcome = function(*args)
        return lambda: outcome

    def close(self) -> None:
        self._example.close()

    def checked(self, actions: Any) -> Array:
        """Checks actions; of tensors only shape and type, so that nothing waits for the device.

        Tensors are clipped to [-1, 1] without a warning, and values that are not finite end the
        episode of their environment. With `clip_actions=False` tensors are read and checked, too.
        Environments in NumPy arrays check tensors on the CPU as they check NumPy arrays.
        """
        like = self._actions
        is_tensor = is_torch_array(actions)
        if not is_tensor or (isinstance(like, np.ndarray) and actions.device.type == "cpu"):
            checked = checked_actions(actions, self.num_envs, self.action_space, self.clipped)
            return self._device.put(checked.astype(float))
        shape = self.num_envs, *(self.action_space.shape or ())
        if actions.device != like.device:
            raise InvalidArgumentError("actions.device", str(actions.device), f"{like.device}")
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
        self._check_started()
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
        if name == "set_wrapper_attr":
            raise cpu_only(f"set_attr{arguments[0][0]}")
        getattr(self._example, name)  # Raises an AttributeError if there is none on the CPU either.
        raise cpu_only(f"name={name!r}")
