"""`Vertices`: positions and velocities of all flex vertices of a plain MuJoCo model."""

import mujoco
import numpy as np


class Vertices:
    """Vertices with three slides each, in bodies aligned with the world.

    Attributes:
        model, data: MuJoCo model and data.
        dofs: (n, 3) of each vertex in `qvel`.
    """

    def __init__(self, model: mujoco.MjModel, data: mujoco.MjData):
        """Finds the vertices of a model, at the positions in its data."""
        self.model, self.data = model, data
        bodies = model.flex_vertbodyid
        self._slides = model.jnt_qposadr[model.body_jntadr[bodies]][:, None] + np.arange(3)
        self.dofs = model.body_dofadr[bodies][:, None] + np.arange(3)
        self._origin = np.array(model.body_pos[bodies])
        mujoco.mj_forward(model, data)

    def positions(self) -> np.ndarray:
        """Returns positions (n, 3) [m] of all vertices."""
        return self.data.qpos[self._slides] + self._origin

    def velocities(self) -> np.ndarray:
        """Returns velocities (n, 3) [m/s] of all vertices."""
        return self.data.qvel[self.dofs]

    def place(self, positions: np.ndarray, velocities: np.ndarray | float = 0.0) -> None:
        """Sets positions (n, 3) [m] and velocities [m/s] of vertices."""
        self.data.qpos[self._slides] = positions - self._origin
        self.data.qvel[self.dofs] = velocities
