"""`Pushed`: a flex that bodies with prescribed motion push, in MuJoCo, for tests of batches."""

from collections.abc import Mapping, Sequence

import mujoco
import numpy as np

from softgym_mj.batch.device import Device
from softgym_mj.cloth.batch_solver import ClothBatchSolver, SolidMotion, describe
from softgym_mj.cloth.solver import contacts
from tests.cloth.flex_scene import TIMESTEP, Flex, FlexScene


def body(
    name: str,
    position: Sequence[float],
    mass: float,
    *geoms: str,
    turn: Sequence[float] = (1, 0, 0, 0),
) -> str:
    """XML of a free body without weight, with geoms of attributes `geoms` that share its mass."""
    inside = "".join(f'<geom mass="{mass / len(geoms)}" {geom}/>' for geom in geoms)
    place, turned = (" ".join(map(str, numbers)) for numbers in (position, turn))
    attributes = f'name="{name}" pos="{place}" quat="{turned}" gravcomp="1"'
    return f"<body {attributes}><freejoint/>{inside}</body>"


class Pushed(FlexScene):
    """A flex and bodies that push it, and the motion of their solids for `ClothBatchSolver`."""

    def __init__(self, flex: Flex, *bodies: str, solids: Sequence[str], **settings):
        """Builds the scene; `solids` are names of geoms."""
        super().__init__(flex, scenery="".join(bodies), **settings)
        self.solids = [self.model.geom(name).id for name in solids]
        self.bodies = self.model.geom_bodyid[self.solids]
        self.before = self.data.qvel.copy()

    def solver(self, device: Device | None = None) -> ClothBatchSolver:
        """A batch with this scene as it is at the start, alone."""
        solver = ClothBatchSolver(1, self.model.nflexvert, 0, device, len(self.solids))
        solver.start(0, describe(self.model, [], solids=self.solids))
        return solver

    def push(self, velocities: Mapping[str, Sequence[float]]) -> SolidMotion:
        """Steps with velocities (6,) of free bodies; returns the motion of one environment."""
        for name, velocity in velocities.items():
            first = self.model.body(name).dofadr[0]
            self.data.qvel[first : first + 6] = velocity
        self.before = self.data.qvel.copy()
        mujoco.mj_step(self.model, self.data)
        return self.motion()

    def motion(self) -> SolidMotion:
        """Motion of the solids in the last step, of one environment."""
        change = (self.data.qvel - self.before) / TIMESTEP
        poses, velocities, accelerations = [], [], []
        for geom, body in zip(self.solids, self.bodies, strict=True):
            turn = np.zeros(4)
            mujoco.mju_mulQuat(turn, self.data.xquat[body], self.model.geom_quat[geom])
            poses.append([*self.data.geom_xpos[geom], *turn])
            velocities.append(self._moved(body, self.before))
            accelerations.append(self._moved(body, change))
        touching = self.model.geom_contype[self.solids] > 0
        return SolidMotion(
            *(np.array(a)[None] for a in (poses, velocities, accelerations)), touching[None]
        )

    def jacobian(self, body: int) -> dict[int, np.ndarray]:
        """Motion (6,) of a body's center of mass by each of its degrees of freedom."""
        model, data = self.model, self.data
        offset = data.xipos[body] - data.subtree_com[model.body_rootid[body]]
        columns, moved = {}, np.zeros(3)
        while body and not model.body_dofnum[body]:
            body = model.body_parentid[body]
        dof = model.body_dofadr[body] + model.body_dofnum[body] - 1
        while dof >= 0:
            axis = data.cdof[dof]
            mujoco.mju_cross(moved, axis[:3], offset)
            columns[dof] = np.concatenate([moved + axis[3:], axis[:3]])
            dof = model.dof_parentid[dof]
        return columns

    def check(self, solver: ClothBatchSolver, i: int = 0) -> None:
        """Checks that environment `i` of a batch equals the flex bit by bit."""
        size = 3 * self.model.nflexvert
        np.testing.assert_array_equal(solver.qpos[i].ravel(), self.data.qpos[:size])
        np.testing.assert_array_equal(solver.qvel[i].ravel(), self.data.qvel[:size])

    def forces(self) -> np.ndarray:
        """Forces (solids, 3) [N] of the flex on solids in the last step."""
        found = contacts(self.model, self.data)
        own = [found["force"][found["geom"] == geom] for geom in self.solids]
        return -np.array([force.sum(axis=0) for force in own])

    def _moved(self, body: int, speeds: np.ndarray) -> np.ndarray:
        """Motion (6,) of a body's center of mass, summed in the plugin's order."""
        total = np.zeros(6)
        for dof, column in sorted(self.jacobian(body).items()):
            total += column * speeds[dof]
        return total
