"""`ClothBatchSolver`: many flexes with grippers over a floor, stepped together without MuJoCo.

An environment makes the same steps as the plugin in a model with one flex, spheres that are told
where to go, and a plane: the same bits. The kernel is written for one thread or for a block of a
GPU.
"""

import ctypes
from collections.abc import Sequence

import mujoco
import numpy as np

from softgym_mj.batch import solver
from softgym_mj.batch.device import Device
from softgym_mj.batch.solver import Array

KEPT_PAIRS = 2  # As in batch/environment.h.
EDGES_OF_VERTEX = 3  # At most, of surfaces.
# What may go wrong in a step, as bits: numbers that are not finite; and no room for all candidates,
# pairs, rows or colors, so that some contacts were left out.
NOT_FINITE, CANDIDATES_FULL, PAIRS_FULL, ROWS_FULL, COLORS_FULL = (1 << i for i in range(5))


def describe(model: mujoco.MjModel, grippers: Sequence[int], room: float = 1.0) -> np.ndarray:
    """What `ClothBatchSolver` have to know of a model, as bytes (size,) uint8.

    Args:
        model: with one flex that the plugin moves, over a plane.
        grippers: geoms that are told where to go, all alike: spheres.
        room: for contacts, as a share of what suits piles.

    Raises:
        InvalidArgumentError: if there is anything else in it that the flex touches.
    """
    data = mujoco.MjData(model)
    mujoco.mj_step(model, data)  # From then on the plugin knows it.
    return solver.describe("cloth", model, data, np.array(grippers), ctypes.c_double(room))


class ClothBatchSolver(solver.BatchSolver):
    """See the module docstring.

    Attributes:
        qpos, qvel: of slides of vertices (num_envs, vertices, 3) [m], [m/s].
        gripper_qpos, gripper_qvel: of grippers (num_envs, grippers, 3) [m], [m/s].
        holding_force: with which its edges pulled a vertex that was held, mean of the last step
            (num_envs, vertices) [N].
        valid: 1 of environments that have made a step from where they are (num_envs, 1); to be set
            to 0 after vertices have been placed.
        reference, after_edge, after_layers: by which a step depends on those before it, as the
            state of the plugin.
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
    }
    told = {  # noqa: RUF012
        "targets": ("grippers", (3,), "float64"),
        "goals": ("grippers", (3,), "float64"),
        "held": ("grippers", (), "int32"),
    }
    valid: Array
    qpos: Array
    qvel: Array
    reference: Array
    after_edge: Array
    holding_force: Array
    after_layers: Array
    gripper_qpos: Array
    gripper_qvel: Array

    def __init__(self, num_envs: int, vertices: int, grippers: int, device: Device | None = None):
        """Environments of zeros without models.

        Args:
            num_envs: how many.
            vertices: of the largest model.
            grippers: of each model.
            device: of `batch.solver.BatchSolver`.
        """
        sizes = {"vertices": vertices, "edges": EDGES_OF_VERTEX * vertices, "grippers": grippers}
        super().__init__(num_envs, sizes, device)

    def get_state(self, i: int) -> dict[str, np.ndarray]:
        """As of `BatchSolver`; what layers are kept comes in one order, whoever was first."""
        state = super().get_state(i)
        kept = state["after_layers"].reshape((-1, 4))
        order = np.lexsort([kept[:, 0], kept[:, 0] == 0.0])
        state["after_layers"] = kept[order].reshape(state["after_layers"].shape)
        return state

    def step(self, targets: Array, held: Array, goals: Array) -> None:
        """Makes a step of all environments that have a model.

        Args:
            targets: where grippers go (num_envs, grippers, 3) [m].
            held: the vertex that each holds, or less than 0 (num_envs, grippers).
            goals: where these go (num_envs, grippers, 3) [m].
        """
        self._step(targets=targets, goals=goals, held=held)
