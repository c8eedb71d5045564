"""Scene of the rags' recordings: a rag that hangs from two grippers over a table."""

import numpy as np

from softgym_mj.reality import primitives
from softgym_mj.reality.meshes import Mesh

TABLE = 0.2  # [m] Height of the table's top.
# [m] Initial bulge of a rag: a flat one would be compressed instead of bending.
BULGE = 1e-3


def corners(mesh: Mesh) -> tuple[int, int]:
    """Returns the vertices of a flat mesh at z = 0 that the left and right gripper hold.

    They are the outermost ones towards +Y at -X and +X.
    """
    x, y = mesh.points[:, 0], mesh.points[:, 1]
    return int(np.argmin(x - y)), int(np.argmax(x + y))


def hung(mesh: Mesh) -> np.ndarray:
    """Returns vertices (n, 3) [m] of a flat rag that hangs down between the open grippers.

    It bulges towards +Y by 1 mm in the middle between them.
    """
    middle = sum(primitives.GRIPPER_X) / 2.0
    left, right = mesh.points[list(corners(mesh))]
    y, z = primitives.START
    share = (mesh.points[:, 0] - left[0]) / (right[0] - left[0])
    across = mesh.points[:, 0] - (left[0] + right[0]) / 2.0 + middle
    bulge = y + BULGE * np.sin(np.pi * share)
    return np.column_stack([across, bulge, z + mesh.points[:, 1] - left[1]])
