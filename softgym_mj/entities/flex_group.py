"""`FlexGroup`: several flexes as one, for what handles vertices whatever they belong to."""

import math
from collections.abc import Sequence

import numpy as np

from softgym_mj.entities.flex import Flex, highest_speed
from softgym_mj.exceptions import InvalidArgumentError

_NONE = np.zeros((0, 3))


class FlexGroup:
    """Flexes whose vertices are numbered on from one to the next."""

    def __init__(self, flexes: Sequence[Flex]):
        """Joins flexes that are, or will be, in the same scene.

        Args:
            flexes: any number.
        """
        self._flexes = tuple(flexes)

    @property
    def flexes(self) -> tuple[Flex, ...]:
        """The flexes, in the order of their vertices."""
        return self._flexes

    @property
    def num_points(self) -> int:
        """Number of vertices of all."""
        return sum(flex.num_points for flex in self._flexes)

    @property
    def radius(self) -> float:
        """Largest contact radius [m]."""
        return max(flex.radius for flex in self._flexes)

    def owner(self, index: int) -> tuple[Flex, int]:
        """The flex that a vertex belongs to, and its index there."""
        for flex in self._flexes:
            if index < flex.num_points:
                return flex, index
            index -= flex.num_points
        raise InvalidArgumentError("index", index + self.num_points, f"0..{self.num_points - 1}")

    def resting_height(self, index: int) -> float:
        """Height [m] of a vertex that rests on the floor: the radius of its flex."""
        return self.owner(index)[0].radius

    @property
    def vertex_ids(self) -> np.ndarray:
        """Indices (num_points,) of the vertices among all flex vertices of the model."""
        return np.concatenate([flex.vertex_ids for flex in self._flexes])

    def points(self) -> np.ndarray:
        """Current vertex positions (num_points, 3) [m] in the world frame, a fresh array."""
        return np.concatenate([_NONE, *(flex.points() for flex in self._flexes)])

    def fastest(self) -> float:
        """Speed [m/s] of the fastest vertex."""
        return max(float(highest_speed(flex.slide_velocities)) for flex in self._flexes)

    def most_strained(self) -> float:
        """Largest relative elongation of an edge; 0 without any."""
        return max((float(np.max(flex.edge_strain())) for flex in self._flexes), default=0.0)

    def offsets(self, point: np.ndarray) -> np.ndarray:
        """Vertex positions (..., num_points, 3) [m] relative to points (..., 3)."""
        offsets = [flex.offsets(point) for flex in self._flexes]
        return offsets[0] if len(offsets) == 1 else np.concatenate(offsets, axis=-2)

    def vertex(self, index: int) -> np.ndarray:
        """Current position (3,) [m] of one vertex."""
        flex, index = self.owner(index)
        return flex.vertex(index)

    def hold(self, index: int) -> None:
        """Makes a vertex follow `drive` alone: physics no longer moves it."""
        flex, index = self.owner(index)
        flex.hold(index)

    def release(self, index: int) -> None:
        """Gives a held vertex its own mass back; it keeps the velocity it was driven at."""
        flex, index = self.owner(index)
        flex.release(index)

    def release_all(self) -> None:
        """Releases every vertex that is held."""
        for flex in self._flexes:
            flex.release_all()

    def largest_gap(self, first: int, second: int) -> float:
        """How far apart [m] two held vertices may be moved; infinite if nothing connects them."""
        (flex, first), (other, second) = self.owner(first), self.owner(second)
        return flex.largest_gap(first, second) if flex is other else math.inf

    def slips(self, index: int, goal: np.ndarray) -> bool:
        """Whether a held vertex slips out of its gripper, which takes it to `goal` (3,) [m]."""
        flex, index = self.owner(index)
        return flex.slips(index, goal)

    def drive(self, index: int, target: np.ndarray, duration: float) -> None:
        """Sets a held vertex on its way to `target` (3,) [m], reached after `duration` [s]."""
        flex, index = self.owner(index)
        flex.drive(index, target, duration)
