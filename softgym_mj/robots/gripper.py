"""`Gripper`: the actors that hold vertices of a flex."""

import abc
from collections.abc import Sequence

import numpy as np
from dm_control.composer.observation import observable

from softgym_mj.robots.base import Actor
from softgym_mj.robots.workspace import ToolStart, Workspace

HELD = "held"  # The observation: uint8 (grippers,), 1 for each gripper that holds something.


# [m] At the start, of grippers' centres above the object: a picker's radius and 1 cm.
CLEARANCE = 0.06


class Gripper(Actor):
    """One or more grippers that hold vertices of a deformable object.

    Actors that move grippers by displacement use four entries of the action a gripper: (dx, dy, dz)
    as a fraction of the largest displacement in a sim step along the world axes, and grip (> 0
    closes, <= 0 opens).
    """

    # [m] Of a gripper's centre above a vertex that hangs from it.
    hold_height = 0.05
    # [m] From which two grippers do not get into each other's way, whatever side they come from.
    least_distance = 0.0

    @property
    @abc.abstractmethod
    def num_grippers(self) -> int:
        """Number of grippers."""

    def begin(self, start: ToolStart, vertices: np.ndarray) -> None:
        """Starts an episode where a task wants it, with the object at `vertices` (n, 3) [m]."""
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
        """Which of the points (num_grippers, 3) [m] each gripper should hold."""
        return list(range(len(points)))

    @abc.abstractmethod
    def take(self, vertices: Sequence[int]) -> None:
        """Closes the grippers on these vertices, one each, wherever they are."""

    @abc.abstractmethod
    def default_positions(self, point: np.ndarray) -> np.ndarray:
        """Start positions (num_grippers, 3) [m] around a reset point (3,) [m]."""

    @abc.abstractmethod
    def positions(self) -> np.ndarray:
        """Gripper centres (num_grippers, 3) [m]."""

    def commanded_positions(self) -> np.ndarray:
        """Where the grippers are told to be (num_grippers, 3) [m]; they may lag behind."""
        return self.positions()

    def within_reach(self, i: int, point: np.ndarray) -> np.ndarray:
        """Where gripper `i` goes to when it is told to go to a point (3,) [m] of the workspace."""
        return point

    def proprioception(self) -> np.ndarray:
        """The gripper centres (x, y, z each) [m]."""
        return self.positions().ravel()

    @property
    def senses(self) -> dict[str, int]:
        return {f"gripper {i} (x, y, z) [m]": 3 for i in range(self.num_grippers)}

    @property
    @abc.abstractmethod
    def held(self) -> np.ndarray:
        """Vertex index that each gripper holds, -1 where none: (num_grippers,) int."""

    def own_observables(self, height: int, width: int) -> dict[str, observable.Observable]:
        held = observable.Generic(lambda physics: (self.held >= 0).astype(np.uint8))
        return {**super().own_observables(height, width), HELD: held}

    def diagnostics(self) -> dict[str, float | int]:
        return {"picks_held": int(np.count_nonzero(self.held >= 0))}
