"""`PickerBatch`: the rules of `Picker` and `Attachment` for a batch of environments."""

from collections.abc import Callable
from typing import Any

from softgym_mj.metrics import Array, lengths
from softgym_mj.robots.grip import (
    SLIPPED,
    GripCommand,
    GripLimits,
    GripState,
    kept_in_order,
    may_be,
    step_grips,
)

# Returns the largest allowed distance (num_envs,) [m] of pairs of vertices (num_envs,).
Gap = Callable[[Array, Array], Array]


class PickerBatch:
    """Pickers of a batch: updates rows of the arrays in `Picker.get_state`."""

    def __init__(
        self,
        state: dict[str, Any],
        xp: Any,
        number: int,
        radius: float,
        reach: float,
        commands: Callable[[Array], GripCommand] | None = None,
    ):
        """Configures the pickers.

        Args:
            state: Dict with their arrays after a reset; a step replaces arrays in it.
            xp: Array namespace.
            number: Number of pickers per environment.
            radius: Radius of the spheres [m].
            reach: Largest distance at which they grasp a vertex [m].
            commands: As `Gripper.commands`; None for a subclass that overrides `command`.
        """
        self._state, self._xp, self._number = state, xp, number
        self._radius, self._reach, self._commands = radius, reach, commands
        self._command: GripCommand | None = None

    @property
    def grips(self) -> GripState:
        """State of all grips; `dropped` counts the holds that have ended."""
        return GripState(*(self._state[name] for name in GripState._fields))

    def _set(self, grips: GripState) -> None:
        self._state.update(grips._asdict())

    def command(self, actions: Array) -> None:
        """Starts an env step with actions (num_envs, n)."""
        assert self._commands is not None, "a subclass commands otherwise"
        self._command = self._commands(actions)

    def plan(self, offsets: Callable[[Array], Array], present: Array) -> None:
        """Starts a sim step; the arguments are those of `step_grips`."""
        assert self._command is not None, "a command comes first"
        xp, before = self._xp, self._state["held"]
        self._set(step_grips(self.grips, self._command, offsets, present, self._limits()))
        takes = (before < 0) & (self._state["held"] >= 0)
        if not may_be(xp, takes):
            return
        order = xp.asarray(self._state["order"], copy=True)
        for i in range(self._number):  # Grasps in the same step are ordered by picker.
            order[:, i] = xp.where(takes[:, i], xp.max(order, axis=1) + 1, order[:, i])
        self._state["order"] = order

    def _limits(self) -> GripLimits:
        low, high = (self._state["workspace"][:, None, i] for i in range(2))
        return GripLimits(low + self._radius, high - self._radius, self._reach)

    def goals(self, resting_height: Array) -> Array:
        """Returns targets of held vertices (num_envs, pickers, 3) [m]; undefined if none is held.

        Args:
            resting_height: Height of vertices on the floor (num_envs,) [m].
        """
        goals = self._ahead() + self._state["offset"]
        goals[..., 2] = self._xp.maximum(goals[..., 2], resting_height[:, None])
        return goals

    def _ahead(self) -> Array:
        """Returns the grippers' centers (num_envs, pickers, 3) [m] after the next physics step."""
        return self._state["center"]

    def release_overloaded(self, goals: Array, slips: Array, gap: Gap) -> None:
        """Releases vertices that slip, and later holds that pull too far from earlier ones.

        Args:
            goals: Result of `goals`.
            slips: Whether a vertex exceeds the holding force or the tracking error
                (num_envs, pickers) bool.
            gap: Largest allowed distances of pairs of vertices.
        """
        xp, order = self._xp, self._state["order"]
        self._slip(slips & (self._state["held"] >= 0))
        holds = self._state["held"] >= 0
        last = xp.max(order, axis=1)[:, None] + 1
        ranks = xp.argsort(xp.where(holds, order, last), axis=1, stable=True)
        held = xp.take_along_axis(self._state["held"], ranks, axis=1)
        goals = xp.take_along_axis(goals, ranks[..., None], axis=1)
        kept = kept_in_order(
            [held[:, i] >= 0 for i in range(self._number)],
            lambda first, second: lengths(goals[:, first] - goals[:, second]),
            lambda first, second: gap(held[:, first], held[:, second]),
            lambda mask: may_be(xp, mask),
        )
        back = xp.argsort(ranks, axis=1, stable=True)
        self._slip(holds & ~xp.take_along_axis(xp.stack(kept, axis=1), back, axis=1))

    def _slip(self, which: Array) -> None:
        """Releases holds in a mask (num_envs, pickers) bool under load."""
        if not may_be(self._xp, which):
            return
        state, xp = self._state, self._xp
        number = xp.sum(xp.astype(which, state["yielded"].dtype), axis=1)
        state["yielded"] = state["yielded"] + number
        state["dropped"] = state["dropped"] + number
        state["held"] = xp.where(which, SLIPPED, state["held"])
