"""`Gripper`: base of the actors that hold vertices of a flex."""

import abc
import functools
from collections.abc import Sequence

import numpy as np
from dm_control.composer.observation import observable

from softgym_mj.entities.flex import Flex
from softgym_mj.entities.flex_group import FlexGroup
from softgym_mj.metrics import Array
from softgym_mj.robots.base import ActionSpace, BodyActor
from softgym_mj.robots.grip import NONE, GripCommand, remembered
from softgym_mj.robots.holding import Holding
from softgym_mj.robots.workspace import ToolStart, Workspace
from softgym_mj.validation import as_array, as_finite

HELD = "held"  # Observation: uint8 (grippers,), 1 for each gripper that holds a vertex.
MAX_DISPLACEMENT = 0.01  # [m] per axis and sim step: 1 m/s per axis (docs/softgym.md 2.1).
# [m] Height of grippers' centers above the object at the start: a picker's radius and 1 cm.
CLEARANCE = 0.06


DISPLACEMENTS = tuple(
    (f"d{axis}", "m", f"-{MAX_DISPLACEMENT:g} to {MAX_DISPLACEMENT:g} per sim step")
    for axis in "xyz"
)


def gripper_actions(number: int, moves: Sequence[tuple[str, str, str]]) -> ActionSpace:
    """Returns the action space of grippers: for each its moves, then grip.

    Args:
        number: number of grippers.
        moves: name, unit and range of each move.
    """
    entries = [
        (f"gripper {i}, {name}", unit, ends)
        for i in range(number)
        for name, unit, ends in (*moves, ("grip", "", "above 0 closes, otherwise opens"))
    ]
    size = len(moves) + 1
    switches = tuple(range(size - 1, size * number, size))
    return ActionSpace(tuple(entries), f"{number} gripper(s) x {size}", switches)


class Gripper(BodyActor):
    """One or more grippers that hold vertices of a deformable object.

    The action has four entries for each gripper: (dx, dy, dz) as a fraction of the largest
    displacement in a sim step along the world axes, and grip (> 0 closes, <= 0 opens). Grippers
    stay within `limits`.

    A subclass's `_build` sets `_mjcf_root`, `_holding` and, by `_set_workspace`, the workspace.
    """

    # [m] Height of a gripper's center above a vertex that hangs from it.
    hold_height = 0.05
    # Argument of tasks that sets the number of grippers.
    counted_by = "num_pickers"
    # Whether an action is a displacement of grippers (`displacing`).
    displaces = True
    # Whether it also has rotations (`Arms.posing`).
    turns = False
    # [m] Distance from which two grippers do not obstruct each other, whatever side they come from.
    least_distance = 0.0

    _holding: Holding
    _low: np.ndarray
    _high: np.ndarray

    @property
    def num_grippers(self) -> int:
        """Number of grippers."""
        return len(self._holding.grips.held)

    @functools.cached_property
    def actions(self) -> ActionSpace:
        return gripper_actions(self.num_grippers, DISPLACEMENTS)

    @property
    def held(self) -> np.ndarray:
        """Vertex index that each gripper holds, -1 where none: (num_grippers,) int."""
        return np.maximum(self._holding.grips.held, NONE)

    @property
    def limits(self) -> tuple[np.ndarray, np.ndarray]:
        """Lowest and highest gripper center (3,) [m] of the workspace.

        Arms may not reach as far: see `within_reach`.
        """
        return self._low, self._high

    def manipulate(self, target: Flex | FlexGroup) -> None:
        self._target = target
        self._holding.manipulate(target)

    # ------------------------------------------------------------------ start

    def begin(self, start: ToolStart, vertices: np.ndarray) -> None:
        """Starts an episode at a task's start, with the object at `vertices` (n, 3) [m]."""
        if start.held:
            corners = np.array(start.held)
            held = corners[self.order(vertices[corners])]
            self.place(vertices[held] + [0.0, 0.0, self.hold_height], start.workspace)
            self.take(held.tolist())
            return
        highest = start.workspace.high[2] - 2 * CLEARANCE
        clear = min(float(vertices[:, 2].max()), highest) + CLEARANCE
        x, y, height = start.point
        positions = self.default_positions(np.array([x, y, max(height, clear)]))
        self.place(positions, start.workspace)

    @abc.abstractmethod
    def place(self, positions: np.ndarray, workspace: Workspace) -> None:
        """Starts an episode: grippers open at `positions` (num_grippers, 3) [m] in `workspace`."""

    def order(self, points: np.ndarray) -> list[int]:
        """Returns which of the points (num_grippers, 3) [m] each gripper should hold.

        Raises:
            InvalidArgumentError: for another shape, or a number that is not finite.
        """
        return [*range(len(as_finite("points", points, (self.num_grippers, 3))))]

    @abc.abstractmethod
    def take(self, vertices: Sequence[int]) -> None:
        """Closes the grippers on these vertices, one each, wherever they are."""

    @abc.abstractmethod
    def default_positions(self, point: np.ndarray) -> np.ndarray:
        """Returns start positions (num_grippers, 3) [m] around a reset point (3,) [m]."""

    def _set_workspace(self, workspace: Workspace) -> None:
        """Stores a workspace, and in `_low` and `_high` the `limits` that follow from it."""
        self._workspace = workspace

    # ------------------------------------------------------------------ motion

    def commands(self, actions: Array) -> GripCommand:
        """Returns the command per sim step for actions (..., action_size), NumPy or PyTorch."""
        each = actions.reshape((*actions.shape[:-1], self.num_grippers, 4))
        return GripCommand(MAX_DISPLACEMENT * each[..., :3], each[..., 3] > 0.0)

    def command(self, action: np.ndarray) -> None:
        self._command = self.commands(action)

    def displacing(self, fractions: np.ndarray, grips: Sequence[bool] | np.ndarray) -> np.ndarray:
        """Returns the action (action_size,) that moves grippers only, for one that `displaces`.

        Args:
            fractions: fractions of `MAX_DISPLACEMENT` along X, Y and Z in a sim step (num_grippers,
                3).
            grips: whether each gripper closes (num_grippers,).

        Raises:
            InvalidArgumentError: for another shape.
        """
        fractions, grips = self._checked(grips, fractions=fractions)
        return np.column_stack([fractions, np.where(grips, 1.0, -1.0)]).ravel()

    def _checked(self, grips: object, **moves: object) -> list[np.ndarray]:
        """Returns moves (num_grippers, 3), then grips (num_grippers,), as arrays.

        Raises:
            InvalidArgumentError: for another shape.
        """
        number = self.num_grippers
        arrays = [as_array(name, move, (number, 3)) for name, move in moves.items()]
        return [*arrays, as_array("grips", grips, (number,))]

    @abc.abstractmethod
    def positions(self) -> np.ndarray:
        """Returns gripper centers (num_grippers, 3) [m]."""

    def commanded_positions(self) -> np.ndarray:
        """Returns commanded positions of the grippers (num_grippers, 3) [m], which arms may lag."""
        return self.positions()

    def within_reach(self, i: int, point: np.ndarray) -> np.ndarray:
        """Returns where gripper `i` goes if commanded to a point (3,) [m] of the workspace."""
        return point

    def proprioception(self) -> np.ndarray:
        """Returns the gripper centers (x, y, z each) [m]."""
        return self.positions().ravel()

    @property
    def senses(self) -> dict[str, int]:
        return {f"gripper {i} (x, y, z) [m]": 3 for i in range(self.num_grippers)}

    def remembered(self) -> np.ndarray:
        """Returns the grips as `grip.remembered` does (4 * num_grippers,)."""
        return remembered(self._holding.grips)

    @property
    def remembers(self) -> dict[str, int]:
        names = {
            "grip (1 holds, -1 released under load, else 0)": 1,
            "position of the held vertex relative to it (x, y, z) [m]": 3,
        }
        return {
            f"gripper {i}, {name}": size
            for i in range(self.num_grippers)
            for name, size in names.items()
        }

    def own_observables(self, height: int, width: int) -> dict[str, observable.Observable]:
        held = observable.Generic(lambda physics: (self.held >= 0).astype(np.uint8))
        return {**super().own_observables(height, width), HELD: held}

    def diagnostics(self) -> dict[str, float | int]:
        return {
            "picks_held": int(np.count_nonzero(self.held >= 0)),
            "dropped": int(self._holding.grips.dropped),
            "yielded": self._holding.yielded,
        }

    # ------------------------------------------------------------------ snapshots

    def get_state(self) -> dict[str, np.ndarray]:
        workspace = np.array([self._workspace.low, self._workspace.high])
        return {**self._holding.get_state(), "workspace": workspace}

    def set_state(self, state: dict[str, np.ndarray]) -> None:
        self._holding.set_state(state)
        low, high = state["workspace"]
        self._set_workspace(Workspace(tuple(low), tuple(high)))
