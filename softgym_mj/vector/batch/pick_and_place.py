"""`PickAndPlaceBatch`: the rules of `PixelPickAndPlace` for a batch of environments."""

import itertools
from collections.abc import Callable
from typing import Any

import numpy as np

from softgym_mj.batch.device import Device
from softgym_mj.metrics import Array, constant
from softgym_mj.robots.grip import GripCommand
from softgym_mj.robots.pick_and_place import CLOSED, routes, shown_points
from softgym_mj.vector.batch.pickers import PickerBatch


class PickAndPlaceBatch(PickerBatch):
    """Pickers whose actions are routes of different length; finished environments wait.

    Attributes:
        moving: Whether an environment makes this sim step (num_envs,) bool.
    """

    def __init__(
        self, state: dict[str, Any], device: Device, num_envs: int, radius: float, reach: float
    ):
        """Allocates routes.

        Args:
            state, radius, reach: As in `PickerBatch`; "view" are cameras for `shown_points`.
            device: Device of the arrays.
            num_envs: Number of environments.
        """
        super().__init__(state, device.xp, 1, radius, reach)
        self._device = device
        parts = len(CLOSED)
        # Displacement per sim step [m], and sim steps until the end of each part.
        self._steps = device.zeros((num_envs, parts, 1, 3), "float64")
        self._ends = device.zeros((num_envs, parts), "float64")
        self._done = device.zeros((num_envs,), "float64")  # Sim steps so far.
        self.moving = device.zeros((num_envs,), "bool")

    @property
    def longest(self) -> int:
        """Sim steps of the longest route; reads from the device."""
        return int(self._device.get(self._ends).max())

    def command(self, actions: Array) -> None:
        xp, state = self._xp, self._state
        low, high = (state["workspace"][:, None, i] for i in range(2))
        points = shown_points(state["view"], actions[:, :2], state["radius"])
        ends = low + self._radius, high - self._radius
        steps, numbers = zip(*routes(state["center"], points, actions, *ends), strict=True)
        self._steps[...] = xp.stack(steps, axis=1)
        self._ends[...] = xp.stack([*itertools.accumulate(numbers)], axis=1)
        self._done[...] = 0.0
        state["sim_steps"] = xp.astype(self._ends[:, -1], state["sim_steps"].dtype)

    def plan(self, offsets: Callable[[Array], Array], present: Array) -> None:
        xp, parts = self._xp, len(CLOSED)
        self.moving[...] = self._done < self._ends[:, -1]
        part = xp.sum(xp.astype(self._done[:, None] >= self._ends, xp.int64), axis=1)
        part = xp.clip(part, max=parts - 1)[:, None]
        step = xp.take_along_axis(self._steps, part[..., None, None], axis=1)[:, 0]
        closed = constant(np.array(CLOSED), step)[part]
        step = xp.where(self.moving[:, None, None], step, 0.0)
        self._command = GripCommand(step, closed & self.moving[:, None])
        self._done[...] = self._done + 1.0
        super().plan(offsets, present)
