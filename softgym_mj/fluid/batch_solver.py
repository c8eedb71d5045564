"""`FluidBatchSolver`: the water of many environments, stepped together without MuJoCo.

An environment makes the same steps as the plugin in a model with one fluid and walls that stand
still or go where they are told: the same bits. The kernel is written for one thread or for a block
of a GPU.
"""

from collections.abc import Sequence

import mujoco
import numpy as np

from softgym_mj.batch import solver
from softgym_mj.batch.device import Device
from softgym_mj.batch.solver import Array

MOST_WALLS = 32  # As in batch/model.h.
# What may go wrong in a step, as bits: numbers that are not finite; more neighbours of a particle
# than are listed, or more cells than there is room for; particles further than 100 m from others.
NOT_FINITE, TOO_MANY_NEIGHBORS, TOO_MANY_CELLS, SCATTERED = (1 << i for i in range(4))


def describe(model: mujoco.MjModel, bodies: Sequence[int]) -> np.ndarray:
    """What `FluidBatchSolver` have to know of a model, as bytes (size,) uint8.

    Args:
        model: with water that nothing feels.
        bodies: that are told where to go; other walls stand still.

    Raises:
        InvalidArgumentError: if there is anything else in it that the water touches.
    """
    return solver.describe("fluid", model, mujoco.MjData(model), np.array(bodies))


class FluidBatchSolver(solver.BatchSolver):
    """See the module docstring.

    Attributes:
        positions, velocities: of particles (num_envs, particles, 3) [m], [m/s].
        walls: positions [m] and quaternions of walls at the end of the last step (num_envs,
            `MOST_WALLS`, 7), which are meant if `known` (num_envs, 1) is not 0.
    """

    kind = "fluid"
    fields = {  # noqa: RUF012
        "known": (1,),
        "positions": ("particles", 3),
        "velocities": ("particles", 3),
        "walls": ("walls", 7),
    }
    told = {"poses": ("bodies", (7,), "float64")}  # noqa: RUF012
    known: Array
    positions: Array
    velocities: Array
    walls: Array

    def __init__(self, num_envs: int, particles: int, bodies: int, device: Device | None = None):
        """Environments of zeros without models.

        Args:
            num_envs: how many.
            particles: of the largest model.
            bodies: of each model, that are told where to go.
            device: of `batch.solver.BatchSolver`.
        """
        sizes = {"particles": particles, "walls": MOST_WALLS, "bodies": bodies}
        super().__init__(num_envs, sizes, device)

    def step(self, poses: Array) -> None:
        """Makes a step of all environments that have a model.

        Args:
            poses: positions [m] and quaternions of bodies at its end (num_envs, bodies, 7).
        """
        self._step(poses=poses)
