"""Smooth surface through rough residuals, and its minimum.

Which contact comes first may depend on the last digit of a parameter, and a fling doubles such a
difference every few hundredths of a second: in its last half second, residuals jump by a centimeter
between neighboring parameters. Slopes are therefore fitted to many evaluations instead of two, and
a frame is weighted by how well a quadratic fits its residuals.
"""

import copy

import numpy as np
from scipy.optimize import least_squares

NOISE = 1e-3  # [m] Noise of a residual: that of the mean of 25 points with 5 mm each.
REACH = 1.0  # Coordinates around the middle within which the surface is valid.
# A coordinate at its reach counts as this much of a residual of `NOISE`: what no frame determines
# stays in the middle.
_REGULARIZATION = 0.02


class Surface:
    """Quadratic without mixed terms for each residual; each frame has its own roughness."""

    def __init__(self, points: np.ndarray, residuals: np.ndarray, frames: np.ndarray):
        """Fits residuals (e, n) [m] of frames (n,) at coordinates (e, unknowns)."""
        self.middle = points.mean(axis=0)
        away = points - self.middle
        design = np.column_stack([np.ones(len(away)), away, away**2])
        solution = np.linalg.lstsq(design, residuals, rcond=None)[0]
        spare = max(len(away) - design.shape[1], 1)
        squares = np.sum((residuals - design @ solution) ** 2, axis=0) / spare
        counts = np.bincount(frames)
        rough = np.bincount(frames, squares) / counts
        self._weights = weights = 1.0 / np.sqrt(NOISE**2 + rough)[frames]
        self._inverse = np.linalg.pinv(design.T @ design)
        self._spread = float(np.sum(squares * weights**2))
        self._constant, linear, square = np.split(solution * weights, [1, 1 + away.shape[1]])
        self._linear, self._square = linear.T, square.T

    def residuals(self, coordinates: np.ndarray) -> np.ndarray:
        """Returns residuals (n,) at coordinates (unknowns,), divided by noise and roughness."""
        away = coordinates - self.middle
        return self._constant[0] + self._linear @ away + self._square @ away**2

    def shifted_through(self, coordinates: np.ndarray, residuals: np.ndarray) -> "Surface":
        """Returns this surface shifted to residuals (n,) [m] at coordinates (unknowns,)."""
        moved = copy.copy(self)
        moved._constant = self._constant + self._weights * residuals - self.residuals(coordinates)
        return moved

    def jacobian(self, coordinates: np.ndarray) -> np.ndarray:
        """Returns the Jacobian (n, unknowns) of `residuals` at coordinates (unknowns,)."""
        return self._linear + 2.0 * self._square * (coordinates - self.middle)

    def spurious(self, coordinates: np.ndarray) -> np.ndarray:
        """Returns the expected J^T J (unknowns, unknowns) due to roughness alone.

        Noise in a regression looks like slopes where there are none.
        """
        away = np.diag(2.0 * (coordinates - self.middle))
        rows = np.column_stack([np.zeros(len(away)), np.eye(len(away)), away])
        return self._spread * rows @ self._inverse @ rows.T

    def minimum(self, bounds: np.ndarray) -> np.ndarray:
        """Returns the least-squares point (unknowns,) within reach and bounds (unknowns, 2)."""
        low = np.maximum(bounds[:, 0], self.middle - REACH)
        high = np.minimum(bounds[:, 1], self.middle + REACH)

        def regularized(x: np.ndarray) -> np.ndarray:
            return np.concatenate([self.residuals(x), _REGULARIZATION * (x - self.middle)])

        def jacobian(x: np.ndarray) -> np.ndarray:
            return np.concatenate([self.jacobian(x), _REGULARIZATION * np.eye(len(x))])

        return least_squares(regularized, self.middle, jacobian, bounds=(low, high)).x
