"""`Vertices`: where those of all flexes of a plain MuJoCo model are, and how fast."""

import mujoco
import numpy as np


class Vertices:
    """Vertices with three slides each, in bodies whose frame is the world's.

    Attributes:
        model, data: MuJoCo's.
        dofs: (n, 3) of each vertex in `qvel`.
    """

    def __init__(self, model: mujoco.MjModel, data: mujoco.MjData):
        """Those of a model, at the positions that its data have."""
        self.model, self.data = model, data
        bodies = model.flex_vertbodyid
        self._slides = model.jnt_qposadr[model.body_jntadr[bodies]][:, None] + np.arange(3)
        self.dofs = model.body_dofadr[bodies][:, None] + np.arange(3)
        self._origin = np.array(model.body_pos[bodies])
        mujoco.mj_forward(model, data)

    def positions(self) -> np.ndarray:
        """Of all vertices (n, 3) [m]."""
        return self.data.qpos[self._slides] + self._origin

    def velocities(self) -> np.ndarray:
        """Of all vertices (n, 3) [m/s]."""
        return self.data.qvel[self.dofs]

    def place(self, positions: np.ndarray, velocities: np.ndarray | float = 0.0) -> None:
        """Puts vertices (n, 3) [m] somewhere, with velocities alike [m/s]."""
        self.data.qpos[self._slides] = positions - self._origin
        self.data.qvel[self.dofs] = velocities
