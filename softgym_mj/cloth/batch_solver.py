"""`ClothBatchSolver`: steps many flexes with grippers and solids over a floor, without MuJoCo.

Each step is bit-identical to that of the plugin in a model with one flex, geoms with prescribed
motion, and a plane. The kernel runs on one CPU thread or on a block of a GPU.
"""

import ctypes
import hashlib
from collections.abc import Sequence
from typing import NamedTuple

import mujoco
import numpy as np

from softgym_mj.batch import solver
from softgym_mj.batch.device import CpuDevice, Device, function
from softgym_mj.batch.gpu import GRIDS, SOLIDS
from softgym_mj.batch.solver import Array, pointer
from softgym_mj.exceptions import InvalidArgumentError

KEPT_PAIRS = 2  # The same number as in batch/environment.h.
SIDES = 256  # The same number as in plugin/method.h.
EDGES_OF_VERTEX = 3  # Largest ratio of edges to vertices of a surface.
# Bits of `flags`: the state is not finite, or there was no room for all candidates, pairs, rows or
# colors, so that some contacts were left out.
NOT_FINITE, CANDIDATES_FULL, PAIRS_FULL, ROWS_FULL, COLORS_FULL = (1 << i for i in range(5))


class SolidMotion(NamedTuple):
    """Motion of solids in a step, in the world frame.

    A body moves as in the plugin: from velocities at the start of the step, with accelerations, and
    by the impulses of the flex if it weighs less than 1 t. All solids of a body have its numbers.

    Attributes:
        poses: Positions [m] and quaternions (w, x, y, z) of the solids' geoms at the start of the
            step (num_envs, solids, 7).
        velocities: Velocities [m/s] of the centers of mass of their bodies, and angular velocities
            [rad/s], at the start of the step (num_envs, solids, 6).
        accelerations: Mean accelerations of both in the step (num_envs, solids, 6) [m/s^2],
            [rad/s^2].
        touching: Whether solids push the flex, or pass through it (num_envs, solids).
        jacobians: Velocities and angular velocities of the centers of mass by speeds of the degrees
            of freedom of each body's kinematic tree (num_envs, solids, 6, dofs). Zeros fill unused
            ones.
        responses: Speeds by impulses and angular impulses on these centers (num_envs, solids, dofs,
            6): `jacobians` transposed, times the inverse of the tree's inertia, which includes
            servos (as in plugin/bodies.cc). Zeros for a body that the flex does not move.
    """

    poses: Array
    velocities: Array
    accelerations: Array
    touching: Array
    jacobians: Array = 0.0
    responses: Array = 0.0


def describe(
    model: mujoco.MjModel, grippers: Sequence[int], room: float = 1.0, solids: Sequence[int] = ()
) -> np.ndarray:
    """Converts a model for `ClothBatchSolver`; returns bytes (size,) uint8.

    Args:
        model: Model with one flex that the plugin moves, over a plane.
        grippers: Ids of geoms with prescribed motion: spheres; -1 for a gripper that only holds.
        room: Room for contacts, relative to the number that piles need.
        solids: Ids of further geoms that move as told, or stand at their poses if their bodies have
            no joints: all but planes. Grippers and solids are each in the order of their ids; all
            push in that order.

    Raises:
        InvalidArgumentError: If batches do not support something in the model.
    """
    data = mujoco.MjData(model)
    mujoco.mj_step(model, data)  # Initializes the plugin's state.
    ids = np.array([*grippers, *(-2 - solid for solid in solids)])
    return solver.describe("cloth", model, data, ids, ctypes.c_double(room))


class ClothBatchSolver(solver.BatchSolver):
    """Batch solver of a flex with grippers and solids.

    Attributes:
        qpos, qvel: Slides of vertices (num_envs, vertices, 3) [m], [m/s].
        gripper_qpos, gripper_qvel: Slides of grippers (num_envs, grippers, 3) [m], [m/s].
        holding_force: Force of the edges on a held vertex, mean of the last step
            (num_envs, vertices) [N].
        valid: 1 if the plugin state continues the last step (num_envs, 1); set it to 0 after
            placing vertices.
        reference, after_edge, after_layers: Plugin state that a step inherits from the last one.
        twist: Twist angle of a rope that twists (num_envs, 1) [rad].
        solid_forces: Force of the flex on each solid, mean of the last step, and its torque about
            the center of mass of the solid's body (num_envs, solids, 6) [N], [N m].
        solid_impulses: Sum J of the impulses of all substeps on a body that gives way, times their
            length, and sum K of J after each of them, at the body's first solid (num_envs, solids,
            2, 6). batch/README.md has the formulas for its speeds and coordinates.
        pushes: Least component of contact normals along the y axis of each solid, for each vertex
            of the elements that it pressed on last; else 0 (num_envs, solids, vertices).
        sides: Faces of solids through which points have entered them (num_envs, `SIDES`).
    """

    kind = "cloth"
    fields = {  # noqa: RUF012
        "valid": (1,),
        "qpos": ("vertices", 3),
        "qvel": ("vertices", 3),
        "reference": ("vertices", 3),
        "after_edge": ("edges",),
        "holding_force": ("vertices",),
        "after_layers": ("vertices", KEPT_PAIRS, 4),
        "gripper_qpos": ("grippers", 3),
        "gripper_qvel": ("grippers", 3),
        "twist": (1,),
        "sides": ("faces",),
    }
    inputs = {  # noqa: RUF012
        "targets": ("grippers", (3,), "float64"),
        "goals": ("grippers", (3,), "float64"),
        "held": ("grippers", (), "int32"),
        "poses": ("solids", (7,), "float64"),
        "velocities": ("solids", (6,), "float64"),
        "accelerations": ("solids", (6,), "float64"),
        "touching": ("solids", (), "int32"),
    }
    outputs = {  # noqa: RUF012
        "solid_forces": ("solids", (6,), "float64"),
        "solid_impulses": ("solids", (2, 6), "float64"),
    }
    exact = ("grippers", "solids")
    last = (
        *("twist", "poses", "velocities", "accelerations", "touching", "solid_forces", "sides"),
        *("jacobians", "responses", "solid_impulses", "solids", "faces", "dofs"),
        *("pushes", "pushed"),
    )
    valid: Array
    qpos: Array
    qvel: Array
    reference: Array
    after_edge: Array
    holding_force: Array
    after_layers: Array
    gripper_qpos: Array
    gripper_qvel: Array
    twist: Array
    sides: Array
    solid_forces: Array
    solid_impulses: Array
    pushes: Array

    def __init__(
        self,
        num_envs: int,
        vertices: int,
        grippers: int,
        device: Device | None = None,
        solids: int = 0,
        dofs: int = 0,
        notes_pushes: bool = False,
    ):
        """Allocates zeros, without models.

        Args:
            num_envs: Number of environments.
            vertices: Vertices of the largest model.
            grippers: Grippers of each model.
            device: Device of the arrays; None means this processor.
            solids: Solids of each model.
            dofs: Most degrees of freedom of a kinematic tree with solids; 0 if the flex moves none.
            notes_pushes: Whether steps write `pushes`.
        """
        pushed = vertices if notes_pushes else 0
        jacobians = {
            "jacobians": ("solids", (6, dofs), "float64"),
            "responses": ("solids", (dofs, 6), "float64"),
        }
        self.inputs = {**self.inputs, **jacobians}
        self.outputs = {**self.outputs, "pushes": ("solids", (pushed,), "float64")}
        sizes = {
            "vertices": vertices,
            "edges": EDGES_OF_VERTEX * vertices,
            "grippers": grippers,
            "solids": solids,
            "faces": SIDES if solids else 0,
            "dofs": dofs,
            "pushed": pushed,
        }
        self._variant = SOLIDS if solids else ""
        self._grids: dict[bytes, Array] = {}  # Nodes of meshes and heightfields by their digest.
        super().__init__(num_envs, sizes, device)

    def _shared(self, model: np.ndarray) -> np.ndarray:
        """Returns a model without the nodes of its grids: each grid is once on the device."""
        room = np.zeros(self._sizes["grippers"] + self._sizes["solids"], np.int64)
        sizes = room[: function(self.kind, "grids")(pointer(model), pointer(room))]
        if not len(sizes):
            return model
        if self._variant != GRIDS:
            self._variant = GRIDS
            self.grown += 1
        bounds = np.cumsum([len(model) - sizes.sum(), *sizes])[:-1]
        own, *grids = np.split(model, bounds)
        own = CpuDevice().put(own)
        addresses = np.array([self._address(grid) for grid in grids], np.int64)
        function(self.kind, "set_grids")(pointer(own), pointer(addresses))
        return own

    def _address(self, grid: np.ndarray) -> int:
        """Returns the address on the device of a grid's nodes."""
        key = hashlib.blake2b(grid.data).digest()
        if key not in self._grids:
            self._grids[key] = self.device.put(grid)
        return self.device.address(self._grids[key])

    def get_state(self, i: int) -> dict[str, np.ndarray]:
        """Returns the state arrays of environment `i`, with kept layers in canonical order."""
        state = super().get_state(i)
        kept = state["after_layers"].reshape((-1, 4))
        order = np.lexsort([kept[:, 0], kept[:, 0] == 0.0])
        state["after_layers"] = kept[order].reshape(state["after_layers"].shape)
        return state

    def step(
        self, targets: Array, held: Array, goals: Array, motion: SolidMotion | None = None
    ) -> None:
        """Makes a step of all environments that have a model.

        Args:
            targets: Target positions of grippers (num_envs, grippers, 3) [m].
            held: Index of the vertex that each holds, or below 0 (num_envs, grippers).
            goals: Target positions of held vertices (num_envs, grippers, 3) [m].
            motion: Motion of the solids, if there are any.
        """
        if motion is None and self._sizes["solids"]:
            raise InvalidArgumentError("motion", None, "a SolidMotion, as there are solids")
        solids = motion._asdict() if motion else {}
        self._step(targets=targets, goals=goals, held=held, **solids)
