"""`JointServos`: the joints of arms in a scene, which follow a `CartesianController`."""

from collections.abc import Callable, Sequence

import mujoco
import numpy as np
from scipy.linalg import block_diag

from softgym_mj.native.arithmetic import product
from softgym_mj.robots.arm import bodies as arm_bodies
from softgym_mj.robots.arm import turns
from softgym_mj.robots.arm.cartesian import ORIENTATION_COST, PERIOD, CartesianController
from softgym_mj.robots.arm.fingers import Fingers
from softgym_mj.robots.arm.models import Arm
from softgym_mj.robots.arm.mounts import Mount
from softgym_mj.robots.base import SIM_STEP
from softgym_mj.robots.symmetry import blocks

SOLVE_EVERY = round(PERIOD / SIM_STEP)  # Sim steps between solutions of the controller.


class JointServos:
    """Joint servos of one or more arms, which interpolate between solutions of the controller.

    Attributes:
        number: number of arms.
        joints: names (joints,) of the joints of an arm.
        velocity_limits: largest joint speeds (n joints,) [rad/s].
        controller: controller whose reference the joints follow.
        motors: their actuators in the scene (n joints,).
        positions_at, speeds_at: addresses (n joints,) of the joints in qpos and qvel.
        fingers: fingers of the arms in the scene.
    """

    def __init__(
        self,
        arm: Arm,
        mounts: Sequence[Mount],
        home: np.ndarray,
        tips: float = 0.0,
        orientation_cost: float = ORIENTATION_COST,
        oriented: np.ndarray | None = None,
    ):
        """Sets up the controller.

        Args:
            arm: kind of the arms.
            mounts: bases of the arms.
            home: joint angles (joints,) [rad] of the posture task.
            tips: as in `arm_bodies.kinematic_model`.
            orientation_cost: as in `CartesianController`.
            oriented: usual orientations of the tools, as quaternions (n, 4); by default at home.
        """
        number = len(mounts)
        self._arm, self.number, self.joints = arm, number, arm.joints
        self.velocity_limits = np.tile(arm.velocity_limits, number)
        self._names = names = arm_bodies.names(arm, number)
        tools = [f"{name}/{arm.tcp_site}" for name in names]
        limits = zip(arm.joints, arm.velocity_limits, strict=True)
        self._kinematics = model = arm_bodies.kinematic_model(arm, tuple(mounts), tips)
        self.controller = CartesianController(
            model,
            tools,
            np.tile(home, number),
            {f"{name}/{joint}": limit for joint, limit in limits for name in names},
            arm_bodies.outer_geoms(model, names),
            model.geom(arm_bodies.FLOOR).id,
            orientation_cost,
        )
        self._posture = mujoco.MjData(model)
        self._sites = [model.site(tool).id for tool in tools]
        self._phase = 0  # Sim steps since the controller's last solution.
        self._oriented = self._at_home(home, mounts) if oriented is None else oriented

    def _at_home(self, home: np.ndarray, mounts: Sequence[Mount]) -> np.ndarray:
        """Returns the orientations of the tools at home, as quaternions (n, 4)."""
        self.points_at(np.tile(home, self.number))
        (facing,) = turns.matrices(turns.quaternions(np.array([[0.0, 0.0, mounts[0].yaw]])))
        upright = product(facing.T, self.rotations()[0])
        return turns.at_mounts(upright, [mount.yaw for mount in mounts])

    def bind(self, model: mujoco.MjModel, data: mujoco.MjData, actor: str) -> None:
        """Finds the joints of the arms in a scene and tunes their servos.

        Args:
            model, data: the scene.
            actor: name of the model that the arms are attached to.
        """
        self._data = data
        prefixes = [f"{actor}/{name}" for name in self._names]
        self.fingers = Fingers(self._arm, model, data, prefixes)

        def ids(find):
            return [find(f"{p}/{joint}").id for p in prefixes for joint in self._arm.joints]

        joints, self.motors = ids(model.joint), np.array(ids(model.actuator))
        self.positions_at = model.jnt_qposadr[joints]
        self.speeds_at = model.jnt_dofadr[joints]
        torques = np.tile(self._arm.torque_limits, len(prefixes))
        self._lag = arm_bodies.tune(model, self.motors, self._inertias(model), torques)

    def _inertias(self, model: mujoco.MjModel) -> np.ndarray:
        """Returns the inertia (n joints,) [kg m^2] of joints at home, with armature and load."""
        data = mujoco.MjData(model)
        data.qpos[self.positions_at] = self.controller.home
        mujoco.mj_kinematics(model, data)
        mujoco.mj_comPos(model, data)
        mujoco.mj_crb(model, data)
        # The diagonal ends each row of the lower triangle.
        rows = self.speeds_at
        return data.M[model.M_rowadr[rows] + model.M_rownnz[rows] - 1]

    def reset(self) -> None:
        """Puts the arms at rest at the controller's reference."""
        data = self._data
        data.qpos[self.positions_at] = self.controller.configuration
        data.qvel[self.speeds_at] = 0.0
        data.ctrl[self.motors] = self.controller.configuration
        self._goal = data.ctrl[self.motors]
        self._start = self._goal.copy()
        self._phase = SOLVE_EVERY - 1  # The next sim step begins with a solution.

    def plan(self, follow: Callable[[int], None]) -> None:
        """Starts a sim step.

        Args:
            follow: moves the controller's reference to its pose after a number of sim steps; it is
                called when the inverse kinematics are to be solved again.
        """
        self._phase = (self._phase + 1) % SOLVE_EVERY
        if self._phase == 0:
            follow(SOLVE_EVERY - 1)
            self._start = self._goal
            self._goal = self.controller.configuration + self._lag * self.controller.velocity

    def move(self, fraction: float) -> None:
        """Commands the physics step that ends with a `fraction` (0..1] of the sim step."""
        way = (self._phase + fraction) / SOLVE_EVERY
        self._data.ctrl[self.motors] = (1.0 - way) * self._start + way * self._goal

    def points(self) -> np.ndarray:
        """Returns positions of the tools (n, 3) [m]."""
        return self.points_at(self._data.qpos[self.positions_at])

    def points_at(self, angles: np.ndarray) -> np.ndarray:
        """Returns positions of the tools (n, 3) [m] for joints at `angles` (n joints,) [rad]."""
        self._posture.qpos[:] = angles
        mujoco.mj_kinematics(self._kinematics, self._posture)
        return self._posture.site_xpos[self._sites]

    def rotations(self) -> np.ndarray:
        """Returns rotation matrices (n, 3, 3) of the tools; call `points` first."""
        return self._posture.site_xmat[self._sites].reshape(-1, 3, 3)

    def velocities(self) -> np.ndarray:
        """Returns velocities (n, 3) [m/s] of the tools; call `points` first."""
        mujoco.mj_comPos(self._kinematics, self._posture)
        speeds = self._data.qvel[self.speeds_at]
        jacobian = np.empty((3, self._kinematics.nv))
        velocities = np.empty((len(self._sites), 3))
        for i, site in enumerate(self._sites):
            mujoco.mj_jacSite(self._kinematics, self._posture, jacobian, None, site)
            velocities[i] = product(jacobian, speeds)
        return velocities

    def sensed(self) -> np.ndarray:
        """Returns the proprioception of n arms (n (8 + 2 joints),).

        The tool points (x, y, z each) [m]; then for each arm the quaternion (w, x, y, z) of its
        tool, its opening [m], the joint positions [rad] and velocities [rad/s]. Of both quaternions
        of an orientation it is the one nearer to the tool's usual one, so that it does not jump.
        """
        points = self.points()
        own = [
            turns.nearest(turns.from_matrices(self.rotations()), self._oriented),
            self.fingers.openings[:, None],
            self._data.qpos[self.positions_at].reshape(self.number, -1),
            self._data.qvel[self.speeds_at].reshape(self.number, -1),
        ]
        return np.concatenate([points.ravel(), np.hstack(own).ravel()])

    @property
    def senses(self) -> dict[str, int]:
        """Number of entries of `sensed` by name and unit, in order."""
        number, joints = self.number, len(self._arm.joints)
        own = {
            "quaternion of the tool (w, x, y, z)": 4,
            "opening between the fingers [m]": 1,
            "joint positions [rad]": joints,
            "joint velocities [rad/s]": joints,
        }
        return {f"arm {i}, tool point (x, y, z) [m]": 3 for i in range(number)} | {
            f"arm {i}, {name}": size for i in range(number) for name, size in own.items()
        }

    def turned(self, turn: np.ndarray, order: Sequence[int]) -> np.ndarray:
        """Returns the matrix of `sensed`, without tool points, under a half turn or none.

        Args:
            turn: matrix (3, 3) of the rotation about Z.
            order: for each arm, which one it was before.
        """
        w, _, _, z = turns.signed(turn)
        times = np.array([[w, 0, 0, -z], [0, w, -z, 0], [0, z, w, 0], [z, 0, 0, w]])  # Product.
        usual = self._oriented
        signs = np.sign((usual * (usual[list(order)] @ times.T)).sum(-1))
        others = np.eye(1 + 2 * len(self.joints))
        return blocks([block_diag(sign * times, others) for sign in signs], order)

    def get_state(self) -> dict[str, np.ndarray]:
        """Returns the state for snapshots, including the controller's."""
        return {
            **self.controller.get_state(),
            "phase": np.array(self._phase),
            "servo": np.array([self._start, self._goal]),
        }

    def set_state(self, state: dict[str, np.ndarray]) -> None:
        """Restores the state that `get_state` returned."""
        self.controller.set_state(state)
        self._phase = int(state["phase"])
        self._start, self._goal = state["servo"].copy()
