"""Where actors move, and where an episode finds them."""

import dataclasses

import numpy as np

from softgym_mj.validation import typed


@typed
@dataclasses.dataclass(frozen=True)
class Workspace:
    """Axis-aligned box [m] that the bodies (not the centres) of the grippers stay in."""

    low: tuple[float, float, float]
    high: tuple[float, float, float]

    def centred_at(self, x: float, y: float) -> "Workspace":
        """The same extents with its horizontal centre at (x, y); heights are kept."""
        half = [(high - low) / 2 for low, high in zip(self.low, self.high, strict=True)]
        return Workspace(
            (x - half[0], y - half[1], self.low[2]), (x + half[0], y + half[1], self.high[2])
        )


@typed
@dataclasses.dataclass(frozen=True)
class ToolStart:
    """Where an actor is when an episode starts.

    Attributes:
        point: (3,) [m] around which grippers start, higher if the object is in their way; where a
            cup stands.
        workspace: of grippers.
        held: the vertices that grippers hold from the start, one each, wherever these are: then
            they start above them.
    """

    point: tuple[float, float, float]
    workspace: Workspace
    held: tuple[int, ...] = ()

    @classmethod
    def over(cls, points: np.ndarray, height: float, workspace: Workspace) -> "ToolStart":
        """`height` [m] above the middle of the bounding box of `points` (n, 3) [m].

        The workspace is centred there.
        """
        x, y = ((points.min(axis=0) + points.max(axis=0))[:2] / 2).tolist()
        return cls((x, y, height), workspace.centred_at(x, y))
