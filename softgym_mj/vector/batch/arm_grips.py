"""`ArmGrips`: the rules of `AttachGrasp` for the hands of a batch of environments."""

import math
from collections.abc import Callable, Mapping
from typing import Any

from softgym_mj.metrics import Array, lengths
from softgym_mj.robots.arm.fingers import OUT_OF_THE_WAY
from softgym_mj.robots.arm.grasps import DRAW_SPEED, PICK_DISTANCE
from softgym_mj.robots.arm.models import Arm
from softgym_mj.robots.base import SIM_STEP
from softgym_mj.robots.grip import GripCommand, GripLimits
from softgym_mj.vector.batch.pickers import PickerBatch


class ArmGrips(PickerBatch):
    """The rules of `AttachGrasp`: vertices attached to tool points, and pads that push."""

    def __init__(self, state: dict[str, Any], xp: Any, hands: Mapping[str, Array], arm: Arm):
        """Configures the hands.

        Args:
            state: As in `PickerBatch`.
            xp: Array namespace.
            hands: Arrays of `Hands` by name before each sim step; "closed" is whether they grip.
            arm: Kind of arm.
        """
        super().__init__(state, xp, hands["points"].shape[1], 0.0, PICK_DISTANCE)
        self._hands, self._arm = hands, arm

    def command(self, actions: Array) -> None:
        closed = self._hands["closed"]
        closed[...] = actions.reshape((*closed.shape, -1))[..., -1] > 0.0

    def plan(self, offsets: Callable[[Array], Array], present: Array) -> None:
        xp, state, hands = self._xp, self._state, self._hands
        tools, closed = hands["points"], hands["closed"]
        state["center"] = xp.asarray(tools, copy=True)
        self._command = GripCommand(xp.zeros_like(tools), closed)
        super().plan(offsets, present)
        distances = xp.where(present[:, None], lengths(offsets(tools)), math.inf)
        opened = xp.min(hands["fingers"], axis=-1) > sum(self._arm.finger_range) / 2
        clear = opened & (xp.min(distances, axis=-1) > OUT_OF_THE_WAY)
        state["solid"] = ~closed & (state["solid"] | clear)
        distances = xp.clip(lengths(state["offset"]), min=1e-9)
        drawn = xp.clip(1.0 - DRAW_SPEED * SIM_STEP / distances, min=0.0)
        moves = xp.any(state["held"] >= 0, axis=1)[:, None]
        state["offset"] = state["offset"] * xp.where(moves, drawn, 1.0)[..., None]

    def _limits(self) -> GripLimits:
        anywhere = self._xp.full_like(self._state["center"], math.inf)
        return GripLimits(-anywhere, anywhere, self._reach)

    def _ahead(self) -> Array:
        return self._hands["points"] + SIM_STEP * self._hands["velocities"]
