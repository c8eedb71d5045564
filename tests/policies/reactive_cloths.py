"""A flat cloth and what reactive experts see of it, for tests."""

import numpy as np

from softgym_mj.entities.cloth import Cloth

DIMS = (65, 81)  # 0.4 m by 0.5 m: 13 rows and 11 columns.
BELOW = [0.0, 0.0, -0.05]  # [m] Offset of a held vertex.


def flat(dims=DIMS):
    """Returns vertices (n, 3) [m] of a flat cloth."""
    return Cloth(dims=dims, fidelity="fast").flat()


def seen(points, pickers, held=(0, 0), dims=DIMS, number=400):
    """Returns "full" and "markov" of vertices, pickers that hold them at `BELOW`, and grips."""
    corners = points[Cloth(dims=dims, fidelity="fast").corners]
    padding = np.zeros((number - len(points), 3))
    grips = [[grip, *(BELOW if grip == 1 else np.zeros(3))] for grip in held]
    parts = points, padding, pickers, corners, pickers, grips
    return np.concatenate([np.ravel(part) for part in parts])
