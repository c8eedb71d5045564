"""Cloth and ropes as walls of the water in slow numpy: the oracle for `plugin/flex_boundary.cc`.

One particle after the other looks at every element of every flex, in double precision. Points
nearest to triangles are found by projection on the plane and on the sides, not as in the plugin.
"""

import dataclasses

import numpy as np

# As in plugin/flex_boundary.cc and plugin/flex_neighbors.cc, where the reasons are.
REACH = 0.75
DIG_OUT = 0.1
NEAREST = 0.1
PUSHES = 6
CARRIED = (1.0, 0.3, 0.1, 0.01)
TIE = 1e-4
TOUCHING = 1e-9


def closest(point: np.ndarray, corners: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """The nearest points of triangles to a point.

    Args:
        point: (3,) or one for each triangle, (m, 3) [m].
        corners: (m, 3, 3) [m]. A segment is a triangle that has its second end twice.

    Returns:
        Weights (m, 3) of the corners, and distances (m,) [m].
    """
    m = len(corners)
    weights, distance = np.zeros((m, 3)), np.full(m, np.inf)

    def offer(candidate: np.ndarray, valid: np.ndarray) -> None:
        length = np.linalg.norm(point - np.einsum("mk,mkd->md", candidate, corners), axis=1)
        better = valid & (length < distance)
        weights[better], distance[better] = candidate[better], length[better]

    a, b, c = corners[:, 0], corners[:, 1], corners[:, 2]
    normal = np.cross(b - a, c - a)
    squared = (normal**2).sum(axis=1)
    safe = np.where(squared > 0, squared, 1.0)
    inside = np.stack(
        [
            (np.cross(v - u, point - u) * normal).sum(axis=1) / safe
            for u, v in ((b, c), (c, a), (a, b))
        ],
        axis=1,
    )
    offer(inside, (inside >= 0).all(axis=1) & (squared > 0))
    for first, second in ((0, 1), (1, 2), (2, 0)):
        u, side = corners[:, first], corners[:, second] - corners[:, first]
        length = (side**2).sum(axis=1)
        along = ((point - u) * side).sum(axis=1) / np.where(length > 0, length, 1.0)
        candidate = np.zeros((m, 3))
        candidate[:, second] = np.clip(along, 0.0, 1.0)
        candidate[:, first] = 1 - candidate[:, second]
        offer(candidate, np.ones(m, bool))
    return weights, distance


def _normals(corners: np.ndarray) -> np.ndarray:
    """Unit normals (m, 3) of triangles; zero for segments."""
    normal = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    length = np.linalg.norm(normal, axis=1, keepdims=True)
    return normal / np.where(length > 0, length, 1.0)


@dataclasses.dataclass(frozen=True)
class Flexes:
    """All elements of a model's flexes, and their vertices at the start and end of a step."""

    elements: np.ndarray  # (m, 3) indices of vertices; a segment has its second one twice.
    radius: np.ndarray  # (m,) [m]
    start: np.ndarray  # (n, 3) [m]
    end: np.ndarray  # (n, 3) [m]

    @property
    def surface(self) -> np.ndarray:
        """Which elements are triangles (m,)."""
        return self.elements[:, 1] != self.elements[:, 2]

    def at(self, fraction: float) -> np.ndarray:
        """Corners (m, 3, 3) after a fraction of the step."""
        return (self.start + fraction * (self.end - self.start))[self.elements]


NO_FLEXES = Flexes(np.zeros((0, 3), int), np.zeros(0), np.zeros((0, 3)), np.zeros((0, 3)))


@dataclasses.dataclass(frozen=True)
class Nearest:
    """The cloth nearest to a particle."""

    distance: float = np.inf  # To its surface [m].
    facing: float = 0.0  # Squared cosine of the angle to its normal: less than 1 beyond a rim.
    normal: np.ndarray = dataclasses.field(default_factory=lambda: np.zeros(3))
    element: int = -1
    weights: np.ndarray = dataclasses.field(default_factory=lambda: np.zeros(3))


def find_nearest(fluid, flexes: Flexes, corners: np.ndarray, x: np.ndarray) -> Nearest:
    """The cloth nearest to a particle at x (3,), with elements at `corners` (m, 3, 3)."""
    weights, length = closest(x, corners)
    distance = np.where(flexes.surface & (length >= TOUCHING), length - flexes.radius, np.inf)
    if distance.min(initial=np.inf) >= REACH * fluid.radius:
        return Nearest()
    offset = x - np.einsum("mk,mkd->md", weights, corners)
    normal = offset / np.maximum(length, TOUCHING)[:, None]
    facing = (normal * _normals(corners)).sum(axis=1) ** 2
    tied = distance < distance.min() + TIE * fluid.spacing
    e = int(np.argmax(np.where(tied, facing, -1.0)))
    return Nearest(distance[e], facing[e], normal[e], e, weights[e])


class Contact:
    """Elements that move in a substep, seen from one particle."""

    def __init__(
        self, fluid, contact: float, flexes: Flexes, before: np.ndarray, after: np.ndarray
    ):
        """Args: corners (m, 3, 3) of all elements at the start and end of the substep [m]."""
        self._fluid, self._flexes = fluid, flexes
        self._before, self._after = before, after
        self._hold = flexes.radius + contact

    def _meets(self, e: int, origin: np.ndarray, way: np.ndarray, distance: float) -> bool:
        """Whether the way comes near the element, by small steps in time."""
        nearest = NEAREST * min(distance, self._hold[e])
        corners = self._before[e] - origin
        move = self._after[e] - self._before[e] - way
        speed = np.linalg.norm(move, axis=1).max()
        if speed <= distance - nearest or distance < TOUCHING:
            return False
        time = 0.0
        while distance >= nearest:
            time += 0.9 * (distance - 0.5 * nearest) / speed
            if time >= 1:
                return False
            _, (distance,) = closest(np.zeros(3), (corners + time * move)[None])
        return True

    def _push(self, e: int, origin: np.ndarray, x: np.ndarray) -> np.ndarray:
        """Displacement (3,) that keeps a particle on its way to `x` out of an element."""
        hold, dig_out = self._hold[e], DIG_OUT * self._fluid.spacing
        (weights,), (length,) = closest(origin, self._before[e : e + 1])
        offset = origin - weights @ self._before[e]
        if self._meets(e, origin, x - origin, length):
            height = offset @ _normals(self._before[e : e + 1])[0]
            if abs(height) > NEAREST * length:
                direction = np.sign(height) * _normals(self._after[e : e + 1])[0]
                gap = direction @ (x - self._after[e, 0])
            else:
                direction = offset / length
                gap = direction @ (x - weights @ self._after[e])
        else:
            (foot,), (gap,) = closest(x, self._after[e : e + 1])
            direction = (x - foot @ self._after[e]) / max(gap, TOUCHING)
        return max(min(hold, length + dig_out) - gap, 0.0) * direction

    def collide(
        self, origin: np.ndarray, target: np.ndarray, nearest: Nearest, pressure_push: float
    ):
        """Returns the end (3,) of a particle's path from `origin` to `target`."""
        move = np.linalg.norm(self._after - self._before, axis=2).max(axis=1)
        x, hardest, element, weights = target, 0.0, nearest.element, nearest.weights
        for _ in range(PUSHES):
            feet, distance = closest(x, self._after)
            reach = self._hold + move + np.linalg.norm(x - origin)
            deepest, push = -1, np.zeros(3)
            for e in np.flatnonzero(distance < reach).tolist():
                candidate = self._push(e, origin, x)
                if np.linalg.norm(candidate) > np.linalg.norm(push):
                    deepest, push = e, candidate
            length = float(np.linalg.norm(push))
            if length <= TOUCHING:
                break
            x = x + push
            if length > hardest:
                hardest, element, weights = length, deepest, feet[deepest]
        if hardest == 0 and pressure_push == 0:
            return x
        total = x - target
        normal = total / max(np.linalg.norm(total), TOUCHING) if hardest else nearest.normal
        slide = x - origin - weights @ (self._after[element] - self._before[element])
        slide = slide - (slide @ normal) * normal
        pressed = np.linalg.norm(total) + pressure_push
        return (
            x
            - min(self._fluid.friction * pressed / max(np.linalg.norm(slide), TOUCHING), 1) * slide
        )

    def _passes(self, origin: np.ndarray, x: np.ndarray) -> bool:
        _, distance = closest(origin, self._before)
        surface = np.flatnonzero(self._flexes.surface).tolist()
        return any(self._meets(e, origin, x - origin, distance[e]) for e in surface)

    def guard(self, origin: np.ndarray, x: np.ndarray) -> np.ndarray:
        """`x` (3,), or a place beside the nearest triangle if the way leads through a cloth."""
        if not self._passes(origin, x):
            return x
        weights, distance = closest(origin, self._before)
        e = int(np.argmin(np.where(self._flexes.surface, distance, np.inf)))
        offset = origin - weights[e] @ self._before[e]
        offset = _frame(self._after[e]) @ _frame(self._before[e]).T @ offset
        for share in CARRIED:
            x = weights[e] @ self._after[e] + share * offset
            if not self._passes(origin, x):
                break
        return x


def _frame(corners: np.ndarray) -> np.ndarray:
    """A rotation (3, 3) that turns with a triangle (3, 3)."""
    side, normal = corners[1] - corners[0], _normals(corners[None])[0]
    side = side / np.linalg.norm(side)
    return np.column_stack([side, np.cross(normal, side), normal])
