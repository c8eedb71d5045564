"""`Bodies` and `Pushed`: bodies that push a flex in MuJoCo, for tests of batches."""

import copy
from collections.abc import Callable, Mapping, Sequence

import mujoco
import numpy as np

from softgym_mj.batch.device import Device
from softgym_mj.cloth.batch_solver import ClothBatchSolver, SolidMotion, describe
from softgym_mj.cloth.solver import contacts
from tests.cloth.flex_scene import Flex, FlexScene

STATE = mujoco.mjtState.mjSTATE_INTEGRATION
# Targets, held vertices and goals of no grippers, for `ClothBatchSolver.step`.
NO_GRIPPERS = np.zeros((1, 0, 3)), np.zeros((1, 0)), np.zeros((1, 0, 3))


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


class Bodies:
    """Bodies with solids, and their motion as `ClothBatchSolver` takes it: the plugin's bits."""

    def __init__(self, model: mujoco.MjModel, data: mujoco.MjData, solids: Sequence[int]):
        """Finds the bodies of solids, by ids of geoms."""
        self.model, self.data, self.solids = model, data, solids
        self.ids = model.geom_bodyid[solids]
        self.trees = model.body_treeid[self.ids]
        self.dofs = [np.flatnonzero(model.dof_treeid == tree) for tree in self.trees]
        self.most_dofs = max(map(len, self.dofs))
        # The same bodies without flexes around them: what MuJoCo does with them.
        self.alone = copy.copy(model)
        self.alone.geom_contype[solids] = self.alone.geom_conaffinity[solids] = 0
        self.data_alone = mujoco.MjData(self.alone)
        self.before = data.qvel.copy()  # Speeds at the start of the last step.

    def follow(self, step: Callable[[], None]) -> SolidMotion:
        """Makes a step; returns the motion in it, of one environment."""
        model, data = self.model, self.data
        state = np.zeros(mujoco.mj_stateSize(model, STATE))
        mujoco.mj_getState(model, data, state, STATE)
        mujoco.mj_setState(self.alone, self.data_alone, state, STATE)
        mujoco.mj_step(self.alone, self.data_alone)
        self.before = before = data.qvel.copy()
        touching = (model.geom_contype | model.geom_conaffinity)[self.solids] > 0
        step()  # Poses and inertia are those of its start from now on.
        change = (self.data_alone.qvel - before) / model.opt.timestep
        shape = len(self.solids), 6, self.most_dofs
        jacobians, responses = np.zeros(shape), np.zeros((shape[0], shape[2], 6))
        poses, velocities, accelerations = [], [], []
        for k, (geom, own) in enumerate(zip(self.solids, self.ids, strict=True)):
            turn, columns = np.zeros(4), self._jacobian(own)
            mujoco.mju_mulQuat(turn, data.xquat[own], model.geom_quat[geom])
            poses.append([*data.geom_xpos[geom], *turn])
            velocities.append(_sum(columns, before))
            accelerations.append(_sum(columns, change))
            if not columns:  # It is fixed.
                continue
            for dof, column in columns.items():
                jacobians[k, :, dof - self.dofs[k][0]] = column
            count, factor = len(self.dofs[k]), self._factor(self.dofs[k])
            for j in range(6):
                responses[k, :count, j] = _solve(factor, jacobians[k, j, :count])
        told = poses, velocities, accelerations, touching, jacobians, responses
        return SolidMotion(*(np.array(each)[None] for each in told))

    def check(self, solver: ClothBatchSolver, motion: SolidMotion) -> None:
        """Checks what the flex has done to bodies that give way, and entry faces of solids."""
        own = self.data.plugin_state[-len(solver.sides[0]) :]
        np.testing.assert_array_equal(solver.sides[0], own)
        step = self.model.opt.timestep
        for tree in np.unique(self.trees):
            dofs, own = np.flatnonzero(self.model.dof_treeid == tree), self.trees == tree
            gained, way = np.zeros(len(dofs)), np.zeros(len(dofs))
            for k in np.flatnonzero(own):
                impulses = solver.solid_impulses[0, k]
                for j, response in enumerate(motion.responses[0, k, : len(dofs)].T):
                    gained += response * impulses[0, j] / (step / 25)
                    way += response * impulses[1, j]
            alone = self.data_alone.qvel[dofs]
            np.testing.assert_array_equal(alone + gained, self.data.qvel[dofs])
            joints = self.model.dof_jntid[dofs]
            if (self.model.jnt_type[joints] < int(mujoco.mjtJoint.mjJNT_SLIDE)).any():
                continue  # Coordinates are no integrals of speeds.
            if solver.solid_impulses[0, own].any():
                way -= step * step * ((alone - self.before[dofs]) / step) * (1 - 1.0 / 25) / 2
            at = self.model.jnt_qposadr[joints]
            np.testing.assert_array_equal(self.data_alone.qpos[at] + way, self.data.qpos[at])

    def _factor(self, dofs: np.ndarray) -> np.ndarray:
        """Lower Cholesky factor of the inertia of a tree's degrees of freedom, with servos."""
        model, first = self.model, dofs[0]
        inertia = np.zeros((len(dofs), len(dofs)))
        for dof in dofs:
            at = model.M_rowadr[dof] + np.arange(model.M_rownnz[dof])
            inertia[dof - first, model.M_colind[at] - first] = self.data.M[at]
            inertia[dof - first, dof - first] += self._servo(dof)
        for i in range(len(dofs)):
            for j in range(i + 1):
                entry = inertia[i, j]
                for k in range(j):
                    entry -= inertia[i, k] * inertia[j, k]
                inertia[i, j] = np.sqrt(max(entry, 1e-12)) if i == j else entry / inertia[j, j]
        return inertia

    def _servo(self, dof: int) -> float:
        """What an implicit step of servos within their force limits adds to the inertia."""
        model, damping, stiffness = self.model, self.model.dof_damping[dof], 0.0
        for motor, (joint, _) in enumerate(model.actuator_trnid):
            low, high = model.actuator_forcerange[motor]
            is_free = not model.actuator_forcelimited[motor]
            within = is_free or low < self.data_alone.actuator_force[motor] < high
            if model.jnt_dofadr[joint] == dof and within:
                damping -= model.actuator_biasprm[motor, 2]
                stiffness -= model.actuator_biasprm[motor, 1]
        step = model.opt.timestep
        implicit = model.opt.integrator != mujoco.mjtIntegrator.mjINT_EULER
        return step * max(damping, 0.0) + (step * step * max(stiffness, 0.0) if implicit else 0.0)

    def _jacobian(self, own: int) -> dict[int, np.ndarray]:
        """Motion (6,) of a body's center of mass by each of its degrees of freedom."""
        model, data = self.model, self.data
        offset = data.xipos[own] - data.subtree_com[model.body_rootid[own]]
        columns, moved = {}, np.zeros(3)
        while own and not model.body_dofnum[own]:
            own = model.body_parentid[own]
        dof = model.body_dofadr[own] + model.body_dofnum[own] - 1
        while dof >= 0:
            axis = data.cdof[dof]
            mujoco.mju_cross(moved, axis[:3], offset)
            columns[dof] = np.concatenate([moved + axis[3:], axis[:3]])
            dof = model.dof_parentid[dof]
        return columns


class Pushed(FlexScene):
    """A flex and bodies that push it.

    Attributes:
        solids: ids of their geoms.
        bodies: these bodies.
    """

    def __init__(self, flex: Flex, *bodies: str, solids: Sequence[str], **settings):
        """Builds the scene; `solids` are names of geoms."""
        super().__init__(flex, scenery="".join(bodies), **settings)
        self.model.opt.disableflags |= mujoco.mjtDisableBit.mjDSBL_CONTACT  # No contacts of MuJoCo.
        self.solids = [self.model.geom(name).id for name in solids]
        self.bodies = Bodies(self.model, self.data, self.solids)

    def solver(self, device: Device | None = None) -> ClothBatchSolver:
        """A batch with this scene as it is at the start, alone."""
        count, dofs = self.model.nflexvert, self.bodies.most_dofs
        solver = ClothBatchSolver(1, count, 0, device, len(self.solids), dofs)
        solver.start(0, describe(self.model, [], solids=self.solids))
        return solver

    def push(self, velocities: Mapping[str, Sequence[float]]) -> SolidMotion:
        """Steps with velocities of bodies; returns the motion of one environment."""
        for name, velocity in velocities.items():
            first = self.model.body(name).dofadr[0]
            self.data.qvel[first : first + len(velocity)] = velocity
        return self.bodies.follow(lambda: mujoco.mj_step(self.model, self.data))

    def check(self, solver: ClothBatchSolver) -> None:
        """Checks that a batch equals the flex bit by bit."""
        size = 3 * self.model.nflexvert
        np.testing.assert_array_equal(solver.qpos.ravel(), self.data.qpos[:size])
        np.testing.assert_array_equal(solver.qvel.ravel(), self.data.qvel[:size])

    def forces(self) -> np.ndarray:
        """Forces (solids, 3) [N] of the flex on solids in the last step."""
        found = contacts(self.model, self.data)
        own = [found["force"][found["geom"] == geom] for geom in self.solids]
        return -np.array([force.sum(axis=0) for force in own])


def _sum(columns: Mapping[int, np.ndarray], speeds: np.ndarray) -> np.ndarray:
    """Motion (6,) by speeds of degrees of freedom, summed in the plugin's order."""
    total = np.zeros(6)
    for dof, column in sorted(columns.items()):
        total += column * speeds[dof]
    return total


def _solve(factor: np.ndarray, vector: np.ndarray) -> np.ndarray:
    """Solves a factored system in the plugin's order."""
    x, size = vector.copy(), len(vector)
    for i in range(size):
        for k in range(i):
            x[i] -= factor[i, k] * x[k]
        x[i] /= factor[i, i]
    for i in reversed(range(size)):
        for k in range(i + 1, size):
            x[i] -= factor[k, i] * x[k]
        x[i] /= factor[i, i]
    return x
