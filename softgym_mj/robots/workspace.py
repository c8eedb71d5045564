"""Workspaces of actors, and their start positions."""

import dataclasses

import numpy as np

from softgym_mj.validation import typed


@typed
@dataclasses.dataclass(frozen=True)
class Workspace:
    """Axis-aligned box [m] that contains the bodies, not just the centers, of grippers.

    Fingers of hands keep a clearance from the floor at Z = 0; it is reduced by the depth of a box
    that extends below the floor, at most to that of grasps by friction.
    """

    low: tuple[float, float, float]
    high: tuple[float, float, float]

    def centered_at(self, x: float, y: float) -> "Workspace":
        """Returns a box of the same size with horizontal center (x, y), at the same heights."""
        half = [(high - low) / 2 for low, high in zip(self.low, self.high, strict=True)]
        return Workspace(
            (x - half[0], y - half[1], self.low[2]), (x + half[0], y + half[1], self.high[2])
        )


@typed
@dataclasses.dataclass(frozen=True)
class ToolStart:
    """Start of an actor.

    Attributes:
        point: (3,) [m] around which grippers start, higher if the object is in their way; for a
            cup, its position.
        workspace: workspace of grippers.
        held: vertices that grippers hold from the start, one each; grippers then start above them.
    """

    point: tuple[float, float, float]
    workspace: Workspace
    held: tuple[int, ...] = ()

    @classmethod
    def over(cls, points: np.ndarray, height: float, workspace: Workspace) -> "ToolStart":
        """Returns a start `height` [m] above the middle of the bounding box of points (n, 3) [m].

        The workspace is centered there.
        """
        x, y = ((points.min(axis=0) + points.max(axis=0))[:2] / 2).tolist()
        return cls((x, y, height), workspace.centered_at(x, y))
