"""Expert of SpreadCloth: drags the cloth out by a side, then moves misplaced vertices."""

import math
from collections.abc import Iterator

import numpy as np

from softgym_mj.native.arithmetic import length, product
from softgym_mj.policies.experts.cloth_expert import LIFT, TRAVEL_HEIGHT
from softgym_mj.policies.experts.crumpled_cloth_expert import CrumpledClothExpert
from softgym_mj.policies.experts.picker_expert import OPEN, PASSED, SLOW

PACE = 0.06  # [m] Distance of the pickers per env step while the cloth is dragged.
TAUT = 0.97  # Fraction of the natural length above which the cloth counts as stretched out.


class SpreadCloth(CrumpledClothExpert):
    """Grasps the ends of a side, drags the cloth out, then moves misplaced vertices."""

    redo, holds = 0.8, 4

    def _pairs(self) -> list[list[tuple[int, int, float]]]:
        """Returns the two sides of either direction, as (corner, corner, length [m])."""
        p1, p2, p3, p4 = self._env.task.cloth.corners.tolist()
        width, depth = self._env.task.cloth.size
        return [[(p1, p2, depth), (p3, p4, depth)], [(p1, p3, width), (p2, p4, width)]]

    def _handles(self) -> list[int]:
        """Returns the vertices on the edges."""
        vertices = self._env.task.cloth.arrays["grid"]
        return np.setdiff1d(vertices, vertices[1:-1, 1:-1]).tolist()

    def _hold_worth(self, a: int, b: int) -> float:
        """Returns the distance of the vertices minus the extent of the cloth behind them [m]."""
        # Cloth behind them hangs in front of the rest and finally covers it.
        flat = self._env.task.cloth.flat()[:, :2]
        across = flat[b] - flat[a]
        width = length(across)
        sides = product(flat - flat[a], np.array([-across[1], across[0]])) / width
        return width - min(float(sides.max()), float(-sides.min()))

    def _places(self) -> np.ndarray:
        """Returns the flat cloth (n, 3) [m], either side up, fitted to most of the cloth."""
        vertices = self._target.points()
        fits = []
        for mirror in (1.0, -1.0):
            flat = self._env.task.cloth.flat() * [1.0, mirror, 1.0]
            residual = np.ones(len(flat))
            for _ in range(20):  # Iteratively reweighted Procrustes: folds are outliers.
                laid = _fitted(flat[:, :2], vertices[:, :2], 1.0 / (0.02 + residual))
                placed = np.column_stack([laid, flat[:, 2]])
                residual = np.linalg.norm(placed - vertices, axis=1)
            fits.append((math.fsum(map(math.log, 0.02 + residual)), placed))
        return min(fits, key=lambda fit: fit[0])[1]

    def _lay(self, grips: list[bool]) -> Iterator[np.ndarray]:
        """Stretches the held side along Y and pulls the cloth along X, down to the floor."""
        low, high = self._actor.limits
        center = (low + high) / 2
        flat, (a, b) = self._env.task.cloth.flat(), self._actor.held
        width = length(flat[b] - flat[a])
        across = (flat[b] - flat[a]) / width
        away = flat - (flat[a] + flat[b]) / 2
        away = np.linalg.norm(away - product(away, across)[:, None] * across, axis=1)
        depth, tail = away.max(), np.flatnonzero(away > away.max() - 0.01)
        offset = (self._target.points()[[a, b]] - self._actor.positions()) * [1.0, 1.0, 0.0]
        sign = np.sign(self._target.vertex(a)[1] - self._target.vertex(b)[1]) or 1.0
        line = np.array([[0.0, sign * width / 2, 0.0], [0.0, -sign * width / 2, 0.0]])

        def tail_x() -> float:
            return float(self._target.points()[tail, 0].mean() - center[0])

        def now_x() -> float:
            return float((self._actor.positions() + offset)[:, 0].mean() - center[0])

        def pose(x: float, z: float) -> np.ndarray:
            goals = line - offset + center + [x, 0.0, 0.0]
            goals[:, 2] = z
            return goals

        way = -1.0 if tail_x() > 0.0 else 1.0
        edge = high[0] - center[0]  # Hands that are apart along Y reach less far along X.
        while edge > PACE and not self._gets_to(line + center + [way * edge, 0.0, low[2]]):
            edge -= PACE / 2
        yield from self._move(self._raised(high[2]), grips, LIFT, PASSED)
        yield from self._move(pose(tail_x(), high[2]), grips, LIFT, PASSED / 2)
        # Carry the tail so far back that the spread cloth is in the middle of the workspace.
        while way * tail_x() > -depth / 2 and way * now_x() > -edge + PACE:
            yield self._step(pose(now_x() - way * PACE, high[2]), grips, LIFT)
        x, anchor, taut = now_x(), tail_x(), 0
        while taut < 2 and way * x < edge:
            x += way * PACE
            # The arc of a tail that sticks to the floor; otherwise it slides.
            height = np.sqrt(max(depth**2 - max(way * (x - anchor), 0.0) ** 2, 0.0))
            yield self._step(pose(x, np.clip(height, low[2], high[2])), grips)
            taut += way * (now_x() - tail_x()) > TAUT * depth
        yield from self._move(pose(x, low[2]), grips, SLOW)
        yield self._step(self._raised(TRAVEL_HEIGHT), OPEN)


def _fitted(points: np.ndarray, goals: np.ndarray, weights: np.ndarray) -> np.ndarray:
    """Returns points (n, 2) [m], rotated and translated to fit their goals (n, 2) best.

    Least squares have a closed form in the plane: the angle of the sum of w p* g, with centered
    points p and goals g as complex numbers.
    """
    weights = (weights / weights.sum())[:, None]
    center = (weights * goals).sum(axis=0)
    points = points - (weights * points).sum(axis=0)
    (x, y), (u, v) = points.T, (weights * (goals - center)).T
    angle = math.atan2((x * v - y * u).sum(), (x * u + y * v).sum())
    cosine, sine = math.cos(angle), math.sin(angle)
    return center + np.column_stack([cosine * x - sine * y, sine * x + cosine * y])
