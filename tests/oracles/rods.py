"""Twist of a rod with explicit frames (Bergou et al., 2008), writhe, Greenhill's moment."""

import itertools
import math

import numpy as np


def unit(a: np.ndarray) -> np.ndarray:
    """Vectors (..., 3) of length 1."""
    return a / np.linalg.norm(a, axis=-1, keepdims=True)


def transported(frame: np.ndarray, a: np.ndarray, b: np.ndarray) -> np.ndarray:
    """A vector (3,) after the smallest rotation that turns the unit vector `a` to `b`."""
    axis = np.cross(a, b)
    return frame + np.cross(axis, frame) + np.cross(axis, np.cross(axis, frame)) / (1.0 + a @ b)


def angle_between(u: np.ndarray, v: np.ndarray, axis: np.ndarray) -> float:
    """Right-handed angle [rad] about a unit vector `axis` from `u` to `v`."""
    return math.atan2(np.cross(u, v) @ axis, u @ v)


def reference_twist(points: np.ndarray, first: np.ndarray, last: np.ndarray) -> float:
    """Angle [rad] within pi of the last edge's director relative to the first one's.

    Args:
        points: Vertices (n, 3).
        first, last: Directors (3,) across the first and the last edge.
    """
    tangents, frame = unit(np.diff(points, axis=0)), first
    for a, b in itertools.pairwise(tangents):
        frame = transported(frame, a, b)
    return angle_between(frame, last, tangents[-1])


def writhe(points: np.ndarray) -> float:
    """Writhe of a closed polygon (n, 3): the Gauss integral of each pair of edges.

    Klenin and Langowski, "Computation of writhe in modeling of supercoiled DNA", 2000, method 1a.
    """
    a, total = points, 0.0
    b, size = np.roll(points, -1, axis=0), len(points)
    for i in range(size):
        for j in range(i + 2, size if i else size - 1):
            r12, r34 = b[i] - a[i], b[j] - a[j]
            r13, r14, r23, r24 = a[j] - a[i], b[j] - a[i], a[j] - b[i], b[j] - b[i]
            normals = [
                np.cross(r13, r14),
                np.cross(r14, r24),
                np.cross(r24, r23),
                np.cross(r23, r13),
            ]
            if min(map(np.linalg.norm, normals)) < 1e-14:
                continue
            n = [unit(normal) for normal in normals]
            area = sum(math.asin(np.clip(n[k] @ n[(k + 1) % 4], -1, 1)) for k in range(4))
            total += area * np.sign(np.cross(r34, r12) @ r13)
    return total / (2.0 * math.pi)


def greenhill(tension: float) -> float:
    """Critical moment, times length over bending stiffness, of a rod clamped at both ends.

    The smallest m with a solution of w'''' - i m w'' - t w'' = 0, w = w' = 0 at both ends (Love,
    1927), where t is the tension times squared length over bending stiffness.
    """

    def determinant(m: float) -> float:
        """The determinant of the conditions, times a factor that makes it real."""
        root = np.sqrt(complex(4.0 * tension - m * m))
        a, b = (1j * m + root) / 2.0, (1j * m - root) / 2.0
        rows = [[1, 0, 1, 1], [0, 1, a, b], [1, 1, np.exp(a), np.exp(b)],
                [0, 1, a * np.exp(a), b * np.exp(b)]]  # fmt: skip
        return float((np.linalg.det(np.array(rows)) / (a - b) * np.exp(-(a + b) / 2.0)).real)

    moments = 2.0 * math.sqrt(tension) + np.arange(0.01, 20.0, 0.01)
    signs = np.sign([determinant(m) for m in moments])
    return float(moments[1:][np.diff(signs) != 0.0][0])
