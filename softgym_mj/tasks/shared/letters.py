"""Letters of RopeConfiguration, as polylines of the rope's length."""

import itertools

import numpy as np
from scipy.interpolate import CubicSpline

from softgym_mj.entities.rope import LENGTH

# [m] Points (X, Y) along the center lines of SoftGym's letters, upright in the top view
# (docs/softgym.md E).
_CURVES = {
    "S": ((0.060, 0.051), (0.027, 0.089), (-0.023, 0.091), (-0.060, 0.057), (-0.042, 0.016),
          (0.008, 0.003), (0.053, -0.018), (0.059, -0.067), (0.016, -0.090), (-0.035, -0.085),
          (-0.067, -0.046)),
    "O": ((0.003, 0.091), (-0.048, 0.075), (-0.079, 0.030), (-0.076, -0.021), (-0.057, -0.068),
          (-0.009, -0.091), (0.045, -0.082), (0.078, -0.039), (0.081, 0.016), (0.060, 0.066),
          (0.013, 0.093)),
    "C": ((0.087, 0.054), (0.056, 0.093), (0.008, 0.103), (-0.037, 0.082), (-0.063, 0.040),
          (-0.070, -0.010), (-0.059, -0.051), (-0.028, -0.087), (0.020, -0.098), (0.067, -0.083),
          (0.087, -0.038)),
    "U": ((-0.066, 0.113), (-0.070, 0.072), (-0.070, 0.022), (-0.070, -0.029), (-0.049, -0.074),
          (-0.002, -0.088), (0.047, -0.079), (0.069, -0.037), (0.069, 0.013), (0.069, 0.064),
          (0.075, 0.112)),
}  # fmt: skip
# The strokes of an M are straight: its corners suffice.
_M = ((-0.082, -0.096), (-0.075, 0.088), (0.005, -0.090), (0.075, 0.088), (0.082, -0.102))
LETTERS = ("S", "O", "M", "C", "U")

_FINE = 2000  # Samples of a curve: its length is then accurate to 1e-6.


def _center_line(name: str) -> np.ndarray:
    """Returns many points (n, 2) [m] along a letter."""
    if name == "M":
        corners = np.array(_M)
        return np.concatenate([np.linspace(a, b, _FINE) for a, b in itertools.pairwise(corners)])
    points = np.array(_CURVES[name])
    chord = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(points, axis=0), axis=1))])
    return CubicSpline(chord, points)(np.linspace(0.0, chord[-1], _FINE))


def letter(name: str, count: int) -> np.ndarray:
    """Returns vertices (count, 2) [m] of a rope in the shape of a letter, about the origin.

    Every letter has the rope's natural length, and its vertices are evenly spaced. SoftGym takes
    the first 41 points of an M of 61, and drops inner points of the others or adds midpoints.
    """
    line = _center_line(name)
    length = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(line, axis=0), axis=1))])
    places = np.linspace(0.0, length[-1], count)
    points = np.column_stack([np.interp(places, length, line[:, k]) for k in range(2)])
    points *= LENGTH / length[-1]
    return points - points.mean(axis=0)
