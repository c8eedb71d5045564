"""`FlexGroup`: several flexes with a common numbering of vertices."""

import math
from collections.abc import Sequence

import numpy as np

from softgym_mj.entities.flex import Flex, highest_speed
from softgym_mj.exceptions import InvalidArgumentError

_NONE = np.zeros((0, 3))


class FlexGroup:
    """Flexes whose vertices are numbered consecutively.

    Attributes:
        flexes: Flexes in the order of their vertices.
    """

    def __init__(self, flexes: Sequence[Flex]):
        """Groups flexes of the same scene.

        Args:
            flexes: any number.
        """
        self.flexes = tuple(flexes)

    @property
    def num_points(self) -> int:
        """Number of all vertices."""
        return sum(flex.num_points for flex in self.flexes)

    @property
    def radius(self) -> float:
        """Largest contact radius [m]."""
        return max(flex.radius for flex in self.flexes)

    def owner(self, index: int) -> tuple[Flex, int]:
        """Returns the flex of a vertex, and the vertex's index there."""
        for flex in self.flexes:
            if index < flex.num_points:
                return flex, index
            index -= flex.num_points
        raise InvalidArgumentError("index", index + self.num_points, f"0..{self.num_points - 1}")

    def resting_height(self, index: int) -> float:
        """Returns the height [m] of a vertex that rests on the floor: the radius of its flex."""
        return self.owner(index)[0].radius

    @property
    def vertex_ids(self) -> np.ndarray:
        """Indices (num_points,) of the vertices among all flex vertices of the model."""
        return np.concatenate([flex.vertex_ids for flex in self.flexes])

    def points(self) -> np.ndarray:
        """Returns current vertex positions (num_points, 3) [m] in the world, a fresh array."""
        return np.concatenate([_NONE, *(flex.points() for flex in self.flexes)])

    def fastest(self) -> float:
        """Returns the speed [m/s] of the fastest vertex."""
        return max(float(highest_speed(flex.slide_velocities)) for flex in self.flexes)

    def most_strained(self) -> float:
        """Returns the largest relative elongation of an edge; 0 without edges."""
        return max((float(np.max(flex.edge_strain())) for flex in self.flexes), default=0.0)

    def displacements_from(self, point: np.ndarray) -> np.ndarray:
        """Returns vertex positions (..., num_points, 3) [m] relative to points (..., 3)."""
        offsets = [flex.displacements_from(point) for flex in self.flexes]
        return offsets[0] if len(offsets) == 1 else np.concatenate(offsets, axis=-2)

    def vertex(self, index: int) -> np.ndarray:
        """Returns the current position (3,) [m] of one vertex."""
        flex, index = self.owner(index)
        return flex.vertex(index)

    def hold(self, index: int) -> None:
        """Makes a vertex follow `drive` only, not the physics."""
        flex, index = self.owner(index)
        flex.hold(index)

    def release(self, index: int) -> None:
        """Restores the mass of a held vertex; it keeps the velocity of the last `drive`."""
        flex, index = self.owner(index)
        flex.release(index)

    def release_all(self) -> None:
        """Releases all held vertices."""
        for flex in self.flexes:
            flex.release_all()

    def largest_gap(self, first: int, second: int) -> float:
        """Returns the largest distance [m] of two held vertices; infinite if unconnected."""
        (flex, first), (other, second) = self.owner(first), self.owner(second)
        return flex.largest_gap(first, second) if flex is other else math.inf

    def is_overloaded(self, index: int, goal: np.ndarray) -> bool:
        """Returns whether a held vertex with target `goal` (3,) [m] is released under load."""
        flex, index = self.owner(index)
        return flex.is_overloaded(index, goal)

    def drive(self, index: int, target: np.ndarray, duration: float) -> None:
        """Moves a held vertex to `target` (3,) [m], reached after `duration` [s]."""
        flex, index = self.owner(index)
        flex.drive(index, target, duration)
