"""`WaterWorlds`: the water of many worlds, stepped together without MuJoCo.

A world makes the same steps as the plugin in a model with one fluid and walls that stand still or
go where they are told: the same bits. The program is written for one thread or for a block of a
GPU.
"""

from collections.abc import Sequence

import mujoco
import numpy as np

from softgym_mj.native import worlds

MOST_WALLS = 32  # As in batch/model.h.
# What may go wrong in a step, as bits: numbers that are not finite; more neighbours of a particle
# than are listed, or more cells than there is room for; particles further than 100 m from others.
NOT_FINITE, TOO_MANY_NEIGHBORS, TOO_MANY_CELLS, SCATTERED = (1 << i for i in range(4))


def describe(model: mujoco.MjModel, bodies: Sequence[int]) -> np.ndarray:
    """What `WaterWorlds` have to know of a model, as bytes (size,) uint8.

    Args:
        model: with water that nothing feels.
        bodies: that are told where to go; other walls stand still.

    Raises:
        InvalidArgumentError: if there is anything else in it that the water touches.
    """
    return worlds.describe("fluid", model, mujoco.MjData(model), np.array(bodies))


class WaterWorlds(worlds.Worlds):
    """See the module docstring.

    Attributes:
        positions, velocities: of particles (num_worlds, particles, 3) [m], [m/s].
        walls: positions [m] and quaternions of walls at the end of the last step (num_worlds,
            `MOST_WALLS`, 7), which are meant if `known` (num_worlds, 1) is not 0.
    """

    kind = "fluid"
    fields = {  # noqa: RUF012
        "known": (1,),
        "positions": ("particles", 3),
        "velocities": ("particles", 3),
        "walls": ("walls", 7),
    }
    known: np.ndarray
    positions: np.ndarray
    velocities: np.ndarray
    walls: np.ndarray

    def __init__(
        self, num_worlds: int, particles: int, bodies: int, *, num_threads: int = 1, turns: int = 0
    ):
        """Worlds of zeros without models.

        Args:
            num_worlds: how many.
            particles: of the largest model.
            bodies: of each model, that are told where to go.
            num_threads, turns: of `native.worlds.Worlds`.
        """
        sizes = {"particles": particles, "walls": MOST_WALLS, "bodies": bodies}
        super().__init__(num_worlds, sizes, num_threads, turns)

    def step(self, poses: np.ndarray) -> None:
        """Makes a step of all worlds.

        Args:
            poses: positions [m] and quaternions of bodies at its end (num_worlds, bodies, 7).

        Raises:
            LifecycleError: if a world has no model yet.
        """
        self._step(np.ascontiguousarray(poses, float))
