"""`AttachGrips` and `FrictionGrips`: the rules of grasps for the hands of a batch."""

import math
from collections.abc import Callable, Mapping
from typing import Any

from softgym_mj.metrics import Array, lengths
from softgym_mj.robots.arm.grasps import DRAW_SPEED, PICK_DISTANCE, PRESSING
from softgym_mj.robots.base import SIM_STEP
from softgym_mj.robots.grip import NONE, GripCommand, GripLimits
from softgym_mj.vector.batch.pickers import PickerBatch


class HandGrips(PickerBatch):
    """Grips of hands."""

    def __init__(self, state: dict[str, Any], xp: Any, hands: Mapping[str, Array]):
        """Configures the hands.

        Args:
            state: As in `PickerBatch`.
            xp: Array namespace.
            hands: Arrays of `Hands` by name before each sim step; "closed" is whether they grip.
        """
        super().__init__(state, xp, hands["points"].shape[1], 0.0, PICK_DISTANCE)
        self._hands = hands

    def command(self, actions: Array) -> None:
        closed = self._hands["closed"]
        closed[...] = actions.reshape((*closed.shape, -1))[..., -1] > 0.0


class AttachGrips(HandGrips):
    """The rules of `AttachGrasp`: vertices attached to tool points."""

    def plan(self, offsets: Callable[[Array], Array], present: Array) -> None:
        xp, state, closed = self._xp, self._state, self._hands["closed"]
        tools = self._hands["points"]
        state["center"] = xp.asarray(tools, copy=True)
        self._command = GripCommand(xp.zeros_like(tools), closed)
        super().plan(offsets, present)
        distances = xp.clip(lengths(state["offset"]), min=1e-9)
        drawn = xp.clip(1.0 - DRAW_SPEED * SIM_STEP / distances, min=0.0)
        moves = xp.any(state["held"] >= 0, axis=1)[:, None]
        state["offset"] = state["offset"] * xp.where(moves, drawn, 1.0)[..., None]

    def _limits(self) -> GripLimits:
        anywhere = self._xp.full_like(self._state["center"], math.inf)
        return GripLimits(-anywhere, anywhere, self._reach)

    def _ahead(self) -> Array:
        return self._hands["points"] + SIM_STEP * self._hands["velocities"]


class FrictionGrips(HandGrips):
    """The rules of `FrictionGrasp`: vertices that both pads of a hand press on."""

    def sense(self, tools: Array, offsets: Callable[[Array], Array], pushes: Array) -> None:
        """Ends a sim step, outside of graphs.

        Args:
            tools: Tool points (num_envs, n, 3) [m].
            offsets: As in `plan`.
            pushes: `ClothBatchSolver.pushes` of the pads (num_envs, n, pads, vertices).
        """
        xp, state = self._xp, self._state
        pinched = xp.all(pushes < -PRESSING, axis=2) & self._hands["closed"][..., None]
        distances = xp.where(pinched, lengths(offsets(tools)), math.inf)
        nearest = xp.argmin(distances, axis=-1)
        before = state["held"]
        index = xp.clip(before, min=0)[..., None]
        stays = (before >= 0) & xp.take_along_axis(pinched, index, axis=-1)[..., 0]
        found = xp.where(stays, before, xp.where(xp.any(pinched, axis=-1), nearest, NONE))
        ended = xp.astype((before >= 0) & (found < 0), state["dropped"].dtype)
        state["dropped"][...] = state["dropped"] + xp.sum(ended, axis=1)
        state["held"][...] = found
