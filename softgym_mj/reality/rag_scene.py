"""The rags' recordings as a scene: a rag between two grippers over a table.

A rag hangs from two corners 0.5 m apart; the grippers move together to where the primitives have
them, wait, and go. Each of these takes a second, as in the benchmark's runs of MuJoCo and Bullet.
"""

import numpy as np

from softgym_mj.cloth import solver
from softgym_mj.entities.sheet import Fabric
from softgym_mj.exceptions import check_name
from softgym_mj.reality import primitives
from softgym_mj.reality.meshes import Mesh, rectangle
from softgym_mj.reality.recorder import Replay
from softgym_mj.reality.replay import Hold, Path, replay

WIDTH, LENGTH = 0.50, 0.63  # [m] Of the benchmark's mesh: between the grippers, and down.
SPACING = 0.028  # [m] As of its mesh of 402 vertices.
TABLE = 0.2  # [m] Height of its top.
# [m] By which a rag bulges first: a flat one would be pushed together instead of bending.
BULGE = 1e-3

WIDE = 0.5  # [m] How far apart the grippers are first.
SETTLE, TOGETHER, WAIT = 1.0, 1.0, 1.0  # [s]
BEGIN = -(SETTLE + TOGETHER + WAIT)  # [s] Before the primitive starts.


def rag(spacing: float = SPACING) -> Mesh:
    """A rag at rest, with so many metres between vertices; it is held by the ends of its row 0."""
    return rectangle(WIDTH, LENGTH, spacing)


def corners(mesh: Mesh) -> tuple[int, int]:
    """The vertices of a flat mesh in the plane z = 0 that the left and right gripper hold.

    They are those at +Y that are farthest at -X and +X.
    """
    x, y = mesh.points[:, 0], mesh.points[:, 1]
    return int(np.argmin(x - y)), int(np.argmax(x + y))


def hung(mesh: Mesh) -> np.ndarray:
    """Vertices (n, 3) [m] of a flat rag that hangs down between the open grippers.

    It bulges towards +Y by 1 mm in the middle between them.
    """
    middle = sum(primitives.GRIPPER_X) / 2.0
    left, right = mesh.points[list(corners(mesh))]
    y, z = primitives.START
    share = (mesh.points[:, 0] - left[0]) / (right[0] - left[0])
    across = mesh.points[:, 0] - (left[0] + right[0]) / 2.0 + middle
    bulge = y + BULGE * np.sin(np.pi * share)
    return np.column_stack([across, bulge, z + mesh.points[:, 1] - left[1]])


def hands(primitive: str, published: bool = False) -> Path:
    """Where both grippers are (n, 2, 3) [m] at times (n,) [s]: settling is before 0.

    Args:
        primitive: "dynamic" or "quasi_static".
        published: whether positions are those that the benchmark's script makes, 10 ms each, with
            the stop of a step at 1.1 s, instead of the functions of time that it samples.

    Raises:
        InvalidArgumentError: for another primitive.
    """
    check_name("primitive", primitive, primitives.PIECES)
    listed = primitives.published_positions(primitive, solver.TIMESTEP) if published else None
    nearer = (WIDE - (primitives.GRIPPER_X[1] - primitives.GRIPPER_X[0])) / 2.0

    def path(times: np.ndarray) -> np.ndarray:
        times = np.asarray(times, float)
        if listed is None:
            positions = primitives.gripper_positions(primitive, times)
        else:
            places = np.clip(times / solver.TIMESTEP, 0.0, len(listed) - 1)
            first = np.minimum(places.astype(int), len(listed) - 2)
            share = (places - first)[:, None, None]
            positions = (1.0 - share) * listed[first] + share * listed[first + 1]
        apart = np.interp(times, [-(TOGETHER + WAIT), -WAIT], [nearer, 0.0])
        positions[:, 0, 0] -= apart
        positions[:, 1, 0] += apart
        return positions

    return path


def replay_rag(
    fabric: Fabric,
    primitive: str,
    times: np.ndarray,
    *,
    mesh: Mesh | None = None,
    published: bool = False,
    step: float = solver.TIMESTEP,
) -> Replay:
    """What a rag does in a primitive, as `replay`.

    Args:
        fabric: what it is made of.
        primitive: "dynamic" or "quasi_static".
        times: (f,) [s] in order, 0 at its start.
        mesh: a flat one; None for `rag()`.
        published: as of `hands`.
        step: of the physics [s].

    Raises:
        InvalidArgumentError: for another primitive, or times before settling.
    """
    mesh = rag() if mesh is None else mesh
    hold = Hold(corners(mesh), hands(primitive, published))
    return replay(
        mesh, fabric, [hold], times, start=hung(mesh), begin=BEGIN, floor=TABLE, step=step
    )  # fmt: skip
