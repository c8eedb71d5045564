"""A flex in plain MuJoCo, whoever moves it: state, held vertices, steps."""

import mujoco
import numpy as np

from benchmarks.engines.sheets import STEP
from softgym_mj.entities.flex import HELD_MASS


class MujocoSheet:
    """Steps a model whose only flex is a sheet with free vertices.

    Attributes:
        model, data: MuJoCo's.
    """

    def __init__(self, model: mujoco.MjModel, start: np.ndarray):
        """Puts the vertices at `start` (n, 3) [m]."""
        self.model, self.data = model, mujoco.MjData(model)
        bodies = model.flex_vertbodyid
        self._qpos = model.jnt_qposadr[model.body_jntadr[bodies]][:, None] + np.arange(3)
        self._qvel = model.body_dofadr[bodies][:, None] + np.arange(3)
        self._origin = np.array(model.body_pos[bodies])
        self._masses = np.array(model.dof_M0)
        self._held = np.zeros(0, int)
        self.data.qpos[self._qpos] = start - self._origin
        mujoco.mj_forward(model, self.data)

    def positions(self) -> np.ndarray:
        return self.data.qpos[self._qpos] + self._origin

    def hold(self, vertices: np.ndarray) -> None:
        self._held = np.asarray(vertices, int)
        self.model.dof_M0[:] = self._masses
        # For bodies with three slides the engine takes inertia from here; nothing else reads it.
        self.model.dof_M0[self._qvel[self._held]] = HELD_MASS

    def step(self, targets: np.ndarray) -> None:
        start = self.positions()[self._held]
        own = round(STEP / self.model.opt.timestep)
        for count in range(1, own + 1):
            goal = start + (targets - start) * count / own
            way = goal - self.positions()[self._held]
            self.data.qvel[self._qvel[self._held]] = way / self.model.opt.timestep
            mujoco.mj_step(self.model, self.data)

    def close(self) -> None:
        """Memory goes with the object."""
