"""Material frames of ropes: unit directors across their edges."""

import itertools

import numpy as np


def transported(points: np.ndarray, first: np.ndarray, twist: float = 0.0) -> np.ndarray:
    """Returns directors (n - 1, 3) of the edges of a rope.

    The first one is carried along by parallel transport and rolled by a twist that is uniform along
    the rope (Bergou et al., "Discrete elastic rods", 2008).

    Args:
        points: Vertices (n, 3) [m].
        first: Direction (3,) whose part across the first edge is the first director.
        twist: Angle [rad] of the last director relative to transport without twist.
    """
    edges = np.diff(points, axis=0)
    lengths = np.linalg.norm(edges, axis=1)
    tangents = edges / lengths[:, None]
    director = first - (first @ tangents[0]) * tangents[0]
    found = [director / np.linalg.norm(director)]
    for a, b in itertools.pairwise(tangents):
        axis = np.cross(a, b)
        carried = found[-1] + np.cross(axis, found[-1])
        carried += np.cross(axis, np.cross(axis, found[-1])) / max(1.0 + a @ b, 1e-9)
        carried -= (carried @ b) * b
        found.append(carried / np.linalg.norm(carried))
    along = np.concatenate([[0.0], np.cumsum((lengths[:-1] + lengths[1:]) / 2.0)])
    roll = (twist * along / max(along[-1], 1e-12))[:, None]
    carried = np.array(found)
    return np.cos(roll) * carried + np.sin(roll) * np.cross(tangents, carried)
