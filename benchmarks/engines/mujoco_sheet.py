"""A flex in plain MuJoCo, whoever moves it: state, held vertices, steps."""

import mujoco
import numpy as np

from benchmarks.engines.sheets import STEP
from softgym_mj.entities.flex import HELD_MASS
from softgym_mj.reality.vertices import Vertices


class MujocoSheet(Vertices):
    """Steps a model whose only flex is a sheet with free vertices."""

    def __init__(self, model: mujoco.MjModel, start: np.ndarray):
        """Puts the vertices at `start` (n, 3) [m]."""
        super().__init__(model, mujoco.MjData(model))
        self._masses = np.array(model.dof_M0)
        self._held = np.zeros(0, int)
        self.place(start)
        mujoco.mj_forward(model, self.data)

    def hold(self, vertices: np.ndarray) -> None:
        self._held = np.asarray(vertices, int)
        self.model.dof_M0[:] = self._masses
        # For bodies with three slides the engine takes inertia from here; nothing else reads it.
        self.model.dof_M0[self.dofs[self._held]] = HELD_MASS

    def step(self, targets: np.ndarray) -> None:
        start = self.positions()[self._held]
        own = round(STEP / self.model.opt.timestep)
        for count in range(1, own + 1):
            goal = start + (targets - start) * count / own
            way = goal - self.positions()[self._held]
            self.data.qvel[self.dofs[self._held]] = way / self.model.opt.timestep
            mujoco.mj_step(self.model, self.data)

    def close(self) -> None:
        """Memory goes with the object."""
