"""A smooth surface through offsets that are rough, and where on it they are least.

Which contact comes first may hang on the last digit of a parameter, and a fling doubles such a
difference every few hundredths of a second: in its last half second offsets jump by a centimetre
between neighbouring parameters. So slopes are not taken between two evaluations but through many,
and a frame counts by how well a quadratic goes through what they make of it.
"""

import copy

import numpy as np
from scipy.optimize import least_squares

NOISE = 1e-3  # [m] Of an offset: that of 25 points with 5 mm each.
REACH = 1.0  # Of coordinates around the middle within which the surface is believed.
# Of a coordinate's reach, as an offset of `NOISE`: what no frame shows stays in the middle.
_PULL = 0.02


class Surface:
    """A quadratic without mixed terms for each offset; each frame has its own roughness."""

    def __init__(self, points: np.ndarray, offsets: np.ndarray, frames: np.ndarray):
        """Of offsets (e, n) [m], of frames (n,), at coordinates (e, unknowns) around their mean."""
        self.middle = points.mean(axis=0)
        away = points - self.middle
        design = np.column_stack([np.ones(len(away)), away, away**2])
        solution = np.linalg.lstsq(design, offsets, rcond=None)[0]
        spare = max(len(away) - design.shape[1], 1)
        squares = np.sum((offsets - design @ solution) ** 2, axis=0) / spare
        counts = np.bincount(frames)
        rough = np.bincount(frames, squares) / counts
        self._weights = weights = 1.0 / np.sqrt(NOISE**2 + rough)[frames]
        self._inverse = np.linalg.pinv(design.T @ design)
        self._spread = float(np.sum(squares * weights**2))
        self._constant, linear, square = np.split(solution * weights, [1, 1 + away.shape[1]])
        self._linear, self._square = linear.T, square.T

    def offsets(self, coordinates: np.ndarray) -> np.ndarray:
        """Offsets (n,) at coordinates (unknowns,), each by its noise and roughness."""
        away = coordinates - self.middle
        return self._constant[0] + self._linear @ away + self._square @ away**2

    def through(self, coordinates: np.ndarray, offsets: np.ndarray) -> "Surface":
        """A surface of the same slopes through offsets (n,) [m] at coordinates (unknowns,)."""
        moved = copy.copy(self)
        moved._constant = self._constant + self._weights * offsets - self.offsets(coordinates)
        return moved

    def slopes(self, coordinates: np.ndarray) -> np.ndarray:
        """Of these: (n, unknowns)."""
        return self._linear + 2.0 * self._square * (coordinates - self.middle)

    def spurious(self, coordinates: np.ndarray) -> np.ndarray:
        """What roughness alone adds to the products of slopes (unknowns, unknowns), on average.

        As noise in a regression does: it looks like slopes where there are none.
        """
        away = np.diag(2.0 * (coordinates - self.middle))
        rows = np.column_stack([np.zeros(len(away)), np.eye(len(away)), away])
        return self._spread * rows @ self._inverse @ rows.T

    def least(self, bounds: np.ndarray) -> np.ndarray:
        """Where their squares are least: (unknowns,), within reach and bounds (unknowns, 2)."""
        low = np.maximum(bounds[:, 0], self.middle - REACH)
        high = np.minimum(bounds[:, 1], self.middle + REACH)

        def pulled(x: np.ndarray) -> np.ndarray:
            return np.concatenate([self.offsets(x), _PULL * (x - self.middle)])

        def slopes(x: np.ndarray) -> np.ndarray:
            return np.concatenate([self.slopes(x), _PULL * np.eye(len(x))])

        return least_squares(pulled, self.middle, slopes, bounds=(low, high)).x
