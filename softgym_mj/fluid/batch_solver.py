"""`FluidBatchSolver`: steps the water of many environments together, without MuJoCo.

Each step is bit-identical to that of the plugin in a model with one fluid and walls that are fixed
or whose poses are inputs. The kernel runs on one CPU thread or on a block of a GPU.
"""

from collections.abc import Sequence

import mujoco
import numpy as np

from softgym_mj.batch import solver
from softgym_mj.batch.device import Device
from softgym_mj.batch.gpu import PUSHES
from softgym_mj.batch.solver import Array

MOST_WALLS = 32  # The same number as in batch/model.h.
# Bits of `flags`: the state is not finite; a particle has more neighbors than the list holds; there
# are more cells than there is room for; particles are more than 100 m apart.
NOT_FINITE, TOO_MANY_NEIGHBORS, TOO_MANY_CELLS, SCATTERED = (1 << i for i in range(4))


def describe(model: mujoco.MjModel, bodies: Sequence[int]) -> np.ndarray:
    """Converts a model for `FluidBatchSolver`; returns bytes (size,) uint8.

    Args:
        model: Model with water.
        bodies: Ids of bodies whose poses are inputs of a step; other walls are fixed.

    Raises:
        InvalidArgumentError: If the water can touch anything else in the model.
    """
    return solver.describe("fluid", model, mujoco.MjData(model), np.array(bodies))


class FluidBatchSolver(solver.BatchSolver):
    """Batch solver of water.

    Attributes:
        positions, velocities: Particles (num_envs, particles, 3) [m], [m/s].
        walls: Positions [m] and quaternions of walls at the end of the last step (num_envs,
            `MOST_WALLS`, 7).
        known: 1 if `walls` is valid (num_envs, 1), otherwise 0.
        forces: Forces on walls in the next step, and torques about the centers of mass of their
            bodies (num_envs, `MOST_WALLS`, 6) [N], [N m]; rows of 0 walls unless water pushes any.
        pending: Impulses that are still to act, alike [N s], [N m s].
    """

    kind = "fluid"
    fields = {  # noqa: RUF012
        "known": (1,),
        "positions": ("particles", 3),
        "velocities": ("particles", 3),
        "walls": ("walls", 7),
        "forces": ("pushed", 6),
        "pending": ("pushed", 6),
    }
    inputs = {  # noqa: RUF012
        "poses": ("bodies", (7,), "float64"),
        "mobility": ("bodies", (2,), "float64"),
    }
    exact = ("bodies",)
    last = ("forces", "pending", "mobility", "pushed")
    known: Array
    positions: Array
    velocities: Array
    walls: Array
    forces: Array
    pending: Array

    def __init__(
        self,
        num_envs: int,
        particles: int,
        bodies: int,
        device: Device | None = None,
        pushes: bool = False,
    ):
        """Allocates zeros, without models.

        Args:
            num_envs: Number of environments.
            particles: Particles of the largest model.
            bodies: Number of `bodies` of each model.
            device: Device of the arrays; None means this processor.
            pushes: Whether the water may exert forces, on walls of bodies with joints.
        """
        pushed = MOST_WALLS if pushes else 0
        sizes = {"particles": particles, "walls": MOST_WALLS, "bodies": bodies, "pushed": pushed}
        self._variant = PUSHES if pushes else ""
        super().__init__(num_envs, sizes, device)

    def step(self, poses: Array, mobility: Array = 0.0) -> None:
        """Makes a step of all environments that have a model.

        Args:
            poses: Positions [m] and quaternions of bodies at its end (num_envs, bodies, 7).
            mobility: Largest acceleration of the center of mass along an axis by a force along it
                [1/kg], and about an axis by a torque [1/(kg m^2)], at its start, of bodies with
                joints (num_envs, bodies, 2).
        """
        self._step(poses=poses, mobility=mobility)
