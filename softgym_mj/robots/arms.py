"""`Arms`: one or two robot arms whose hands hold vertices of a flex.

The arms are led by their tool points, the points between the fingers. How the fingers hold is up to
a `Grasp`: attached to the real tool point, wherever the joints are, or by friction.
"""

from collections.abc import Mapping, Sequence

import mujoco
import numpy as np
from dm_control import mjcf

from softgym_mj.exceptions import check_count
from softgym_mj.robots import arm_bodies
from softgym_mj.robots.base import SIM_STEP
from softgym_mj.robots.cartesian import PERIOD, CartesianController
from softgym_mj.robots.grasps import PICK_DISTANCE, AttachGrasp, Fingers, FrictionGrasp, Grasp
from softgym_mj.robots.gripper import Workspace
from softgym_mj.robots.holding import HoldingGripper
from softgym_mj.robots.models import ARMS, ArmModel
from softgym_mj.robots.stands import Stand, facing_each_other

SOLVE_EVERY = round(PERIOD / SIM_STEP)  # Sim steps between solutions of the controller.
# Distance [m] of the bases from the middle; `inner` and `outer` of their stands. Measured with the
# tool down, up to 80 degrees to a side: a Franka gets to within 1 mm up to 0.8 m from its axis at
# heights of 0.02 to 0.2 m, 0.72 m at 0.45 m; a Sawyer up to 0.9 m, 0.8 m. What is nearer than
# 0.25 m is in the way of the elbow, which jumps in a Franka. From 0.7 m, all four corners of flat
# cloths are in reach in more than nine of ten variations.
PLACES = {"franka": (0.7, 0.28, 0.78), "sawyer": (0.7, 0.25, 0.85)}
START_OFFSET = 0.1  # [m] Of the tools from the reset point along Y, each on the side of its base.
# [m/s^2] Commands may jump from -1 m/s to 1 m/s; what the arms follow speeds up and slows down by
# this at most, which their torques can do.
ACCELERATION = 10.0
SPEED_UP = ACCELERATION * SIM_STEP**2  # The same as a change of the displacement in a sim step [m].
LEAD = 0.06  # [m] By which the commanded point may be ahead of what the arm follows.


class Arms(HoldingGripper[Grasp]):
    """One or two arms of a kind that hold vertices of an object.

    The action is that of pickers: (dx, dy, dz) of the commanded tool point and grip. A commanded
    point stays within the workspace and the arm's reach. The arm follows as fast as its joints can,
    and no nearer to the other arm than some centimetres; the commanded point waits where the arm
    falls behind. Grips are those of the `Grasp`. Hands and open fingers push the object; the links
    of the arms pass through it.
    """

    grasp: type[Grasp] = AttachGrasp
    least_distance = 0.15  # Measured: 0.14 m side by side (Franka), 0.08 m face to face.
    camera_suffix = "_arms"

    def _build(
        self,
        arm: ArmModel = ARMS["franka"],
        num_arms: int = 2,
        base_height: float = 0.0,
        stands: Sequence[Stand] | None = None,
        name: str = "arms",
        visual: str = "primitive",
    ):
        """Builds the arms.

        Args:
            arm: the kind of arm.
            num_arms: 1, which stands at -Y and faces +Y, or 2 that face each other.
            base_height: of the mounting planes above the floor [m].
            stands: where the arms stand, instead of these.
            name: model name.
            visual: "primitive" or "menagerie", as in `arm_bodies.add_arms`.

        Raises:
            OutOfRangeError: for another number of arms.
            UnknownNameError, ModelUnavailableError: as in `arm_bodies.add_arms`.
        """
        check_count("arms", num_arms, 1, 2)
        if stands is None:
            stands = facing_each_other(num_arms, *PLACES[arm.name], height=base_height)
        self._arm, self._stands = arm, tuple(stands)
        self._mjcf_root = mjcf.RootElement(model=name)
        self._holding = self.grasp(num_arms)
        self.hold_height = self._holding.hold_height
        arm_bodies.add_arms(
            self._mjcf_root, arm, self._stands, self._holding.pad_contact, visual=visual
        )
        names = arm_bodies.names(arm, num_arms)
        tips = AttachGrasp.tip_clearance - self._holding.tip_clearance
        model = arm_bodies.kinematic_model(arm, self._stands, tips)
        self._tools = [f"{prefix}/{arm.tcp_site}" for prefix in names]
        limits = zip(arm.arm_joints, arm.velocity_limits, strict=True)
        self._controller = CartesianController(
            model,
            self._tools,
            np.tile(arm_bodies.home(arm), num_arms),
            {f"{prefix}/{joint}": limit for joint, limit in limits for prefix in names},
            arm_bodies.outer_geoms(model, names),
            model.geom(arm_bodies.FLOOR).id,
        )
        self._kinematics, self._posture = model, mujoco.MjData(model)
        self._sites = [model.site(tool).id for tool in self._tools]
        self._centre = np.zeros((num_arms, 3))  # Commanded tool points [m].
        self._guide = np.zeros((num_arms, 3))  # What the controller follows [m],
        self._step = np.zeros((num_arms, 3))  # and its displacement in the current sim step [m].
        self._phase = 0  # Sim steps since the controller's last solution.
        self._set_workspace(Workspace((-1.0, -1.0, 0.0), (1.0, 1.0, 1.0)))

    @property
    def arm(self) -> ArmModel:
        """The kind of arm."""
        return self._arm

    @property
    def stands(self) -> tuple[Stand, ...]:
        """Where each arm stands."""
        return self._stands

    @property
    def controller(self) -> CartesianController:
        """What leads the joints."""
        return self._controller

    @property
    def pick_distance(self) -> float:
        """Largest distance [m] between a tool point and a vertex that the hand can take."""
        return PICK_DISTANCE

    def after_compile(self, physics, random_state):
        model, arm = physics.model.ptr, self._arm
        self._data = physics.data.ptr
        prefixes = [
            f"{self._mjcf_root.model}/{name}" for name in arm_bodies.names(arm, self.num_grippers)
        ]

        def ids(find, elements):
            return np.array([[find(f"{p}/{element}").id for element in elements] for p in prefixes])

        joints = ids(model.joint, arm.arm_joints).ravel()
        fingers = ids(model.joint, arm.finger_joints)
        self._positions_at = model.jnt_qposadr[joints]
        self._speeds_at = model.jnt_dofadr[joints]
        self._fingers_at = model.jnt_qposadr[fingers]
        self._motors = ids(model.actuator, arm.arm_joints).ravel()
        self._holding.use(
            Fingers(
                arm,
                model,
                physics.data.ptr,
                self._fingers_at,
                model.jnt_dofadr[fingers],
                ids(model.actuator, arm.finger_joints),
                ids(model.geom, arm.pad_geoms),
            )
        )
        inertia = arm_bodies.inertia(self._kinematics, self._controller.home)
        torques = np.tile(arm.torque_limits, self.num_grippers)
        self._lag = arm_bodies.tune(model, self._motors, inertia, torques)

    def within_reach(self, i: int, point: np.ndarray) -> np.ndarray:
        return self._stands[i].clip(np.clip(point, self._low, self._high))

    def default_positions(self, point: np.ndarray) -> np.ndarray:
        positions = np.tile(point, (self.num_grippers, 1)).astype(float)
        if self.num_grippers == 2:
            positions[:, 1] += [-START_OFFSET, START_OFFSET]
        return positions

    def order(self, points: np.ndarray) -> list[int]:
        """An arm reaches for what is on its side."""
        if self.num_grippers == 1 or points[0, 1] <= points[1, 1]:
            return list(range(len(points)))
        return [1, 0]

    def place(self, positions: np.ndarray, workspace: Workspace) -> None:
        self._holding.reset()
        self._set_workspace(workspace)
        for i, stand in enumerate(self._stands):
            self._centre[i] = stand.clip(np.clip(positions[i], self._low, self._high))
        self._controller.reset(self._centre)
        self._centre = self._controller.within_lead(self._centre)
        self._guide = self._centre.copy()
        self._step[:] = 0.0
        self._phase = SOLVE_EVERY - 1  # The next sim step begins with a solution.
        data = self._data
        data.qpos[self._positions_at] = self._controller.configuration
        data.qvel[self._speeds_at] = 0.0
        data.ctrl[self._motors] = self._controller.configuration
        self._goal = data.ctrl[self._motors]
        self._start = self._goal.copy()

    def _set_workspace(self, workspace: Workspace):
        self._workspace = workspace
        self._low, self._high = np.array(workspace.low), np.array(workspace.high)
        self._low[2] = max(self._low[2], self._arm.pad_reach + self._holding.tip_clearance)

    def take(self, vertices: Sequence[int]) -> None:
        for i, (vertex, tool) in enumerate(zip(vertices, self.positions(), strict=True)):
            self._holding.take_at(i, vertex, tool)

    # ------------------------------------------------------------------ motion

    def plan(self) -> None:
        self._advance()
        self._holding.plan(self._grips, self.positions())
        self._phase = (self._phase + 1) % SOLVE_EVERY
        if self._phase == 0:
            # The guide is taken to go on as it does until the controller's next solution.
            self._controller.follow(self._guide + (SOLVE_EVERY - 1) * self._step)
            self._start = self._goal
            self._goal = self._controller.configuration + self._lag * self._controller.velocity

    def _advance(self) -> None:
        """Moves the commanded points by the action, as far as they may go, and the guides after."""
        wanted = np.clip(self._centre + self._displacement, self._low, self._high)
        for i, stand in enumerate(self._stands):
            wanted[i] = stand.clip(wanted[i])
        self._centre = drawn_in(wanted, self._guide, LEAD)
        # As fast as lets the guide come to rest at the commanded point.
        gap = self._centre - self._guide
        distance = np.sqrt(np.vecdot(gap, gap))[:, None]
        braking = (np.sqrt(1.0 + 8.0 * distance / SPEED_UP) - 1.0) / 2.0 * SPEED_UP
        step = gap * (np.minimum(braking, distance) / np.maximum(distance, 1e-12))
        step = drawn_in(step, self._step, SPEED_UP)
        guide = self._controller.within_lead(self._guide + step)
        self._step = guide - self._guide
        self._guide = guide

    def move(self, fraction: float, timestep: float) -> None:
        way = (self._phase + fraction) / SOLVE_EVERY
        self._data.ctrl[self._motors] = (1.0 - way) * self._start + way * self._goal
        self._holding.move(self._ahead, timestep)

    def after_substep(self, physics, random_state):
        self._holding.sense(self._grips, self.positions)

    def _ahead(self, timestep: float) -> np.ndarray:
        """Where the tool points (num_grippers, 3) [m] will be after `timestep` [s].

        But for what the joints speed up by: 1 to 3 mm in a jerk.
        """
        return self.positions() + timestep * self._velocities()

    def positions(self) -> np.ndarray:
        """Tool points (num_grippers, 3) [m], where they are, not where they are commanded to be."""
        self._posture.qpos[:] = self._data.qpos[self._positions_at]
        mujoco.mj_kinematics(self._kinematics, self._posture)
        return self._posture.site_xpos[self._sites]

    def commanded_positions(self) -> np.ndarray:
        """Commanded tool points (num_grippers, 3) [m]."""
        return self._centre.copy()

    def reference_positions(self) -> np.ndarray:
        """Tool points (num_grippers, 3) [m] that the joints are led along.

        They go after the commanded ones, as fast as they can so as to come to rest there.
        """
        return self._guide.copy()

    def proprioception(self) -> np.ndarray:
        """What the arms sense of themselves (22 n,) for n arms.

        The tool points (x, y, z each) [m]; then for each arm the quaternion (w, x, y, z) of its
        tool, its opening [m], the seven joint positions [rad] and velocities [rad/s].
        """
        tools, data = self.positions(), self._data
        parts = [tools.ravel()]
        quaternion = np.empty(4)
        for i, site in enumerate(self._sites):
            mujoco.mju_mat2Quat(quaternion, self._posture.site_xmat[site])
            seven = slice(7 * i, 7 * (i + 1))
            parts += [
                quaternion.copy(),
                data.qpos[self._fingers_at[i]].sum(keepdims=True),
                data.qpos[self._positions_at[seven]],
                data.qvel[self._speeds_at[seven]],
            ]
        return np.concatenate(parts)

    def _velocities(self) -> np.ndarray:
        """Velocities (num_grippers, 3) [m/s] of the tool points, after `positions`."""
        mujoco.mj_comPos(self._kinematics, self._posture)
        speeds = self._data.qvel[self._speeds_at]
        jacobian = np.empty((3, self._kinematics.nv))
        velocities = np.empty((self.num_grippers, 3))
        for i, site in enumerate(self._sites):
            mujoco.mj_jacSite(self._kinematics, self._posture, jacobian, None, site)
            velocities[i] = jacobian @ speeds
        return velocities

    def diagnostics(self) -> dict[str, float | int]:
        return {
            **super().diagnostics(),
            "ik_failures": self._controller.failures,
        }

    # ------------------------------------------------------------------ snapshots

    def get_state(self) -> dict[str, np.ndarray]:
        return {
            **self._holding.get_state(),
            **self._controller.get_state(),
            "centre": self._centre.copy(),
            "guide": np.array([self._guide, self._step]),
            "workspace": np.array([self._workspace.low, self._workspace.high]),
            "phase": np.array(self._phase),
            "servo": np.array([self._start, self._goal]),
        }

    def set_state(self, state: dict[str, np.ndarray]) -> None:
        self._holding.set_state(state)
        self._controller.set_state(state)
        self._centre = state["centre"].copy()
        self._guide, self._step = state["guide"].copy()
        low, high = state["workspace"]
        self._set_workspace(Workspace(tuple(low), tuple(high)))
        self._phase = int(state["phase"])
        self._start, self._goal = state["servo"].copy()


class FrankaArms(Arms):
    """Arms of Franka: snapshots know actors by their class."""


class SawyerArms(Arms):
    """Arms of Sawyer."""


class FrankaFrictionArms(FrankaArms):
    """Arms of Franka that hold by friction."""

    grasp = FrictionGrasp


class SawyerFrictionArms(SawyerArms):
    """Arms of Sawyer that hold by friction."""

    grasp = FrictionGrasp


KINDS = {"franka": FrankaArms, "sawyer": SawyerArms}
GRASPS: dict[str, Mapping[str, type[Arms]]] = {
    "attach": KINDS,
    "friction": {"franka": FrankaFrictionArms, "sawyer": SawyerFrictionArms},
}


def drawn_in(points: np.ndarray, centres: np.ndarray, radius: float) -> np.ndarray:
    """Points (n, 3), moved straight to within `radius` of their `centres` (n, 3)."""
    offset = points - centres
    distance = np.sqrt(np.vecdot(offset, offset))[:, None]
    return centres + offset * (radius / np.maximum(distance, radius))
