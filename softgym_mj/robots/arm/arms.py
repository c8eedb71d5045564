"""`Arms`: one or two robot arms whose hands hold vertices of a flex.

The arms follow commands to their tool points, the points between the fingers. A `Grasp` defines how
the fingers hold: attached to the actual tool point, or by friction.
"""

from collections.abc import Sequence

import numpy as np
from dm_control import mjcf
from scipy.linalg import block_diag

from softgym_mj.exceptions import InvalidArgumentError, check_count, check_name
from softgym_mj.robots.arm import bodies as arm_bodies
from softgym_mj.robots.arm.action import ArmAction
from softgym_mj.robots.arm.actor import ArmActor
from softgym_mj.robots.arm.grasps import GRASPS, PICK_DISTANCE, AttachGrasp, FrictionGrasp, Grasp
from softgym_mj.robots.arm.joint_action import JointAction
from softgym_mj.robots.arm.joint_servos import JointServos
from softgym_mj.robots.arm.models import ARMS, Arm
from softgym_mj.robots.arm.mounts import Mount, exchanged, facing_each_other
from softgym_mj.robots.arm.pose_action import PoseAction
from softgym_mj.robots.arm.position_action import PositionAction
from softgym_mj.robots.gripper import Gripper
from softgym_mj.robots.symmetry import ActorSymmetry, blocks, gripper_symmetry
from softgym_mj.robots.workspace import Workspace
from softgym_mj.validation import as_finite

ACTIONS: dict[str, type[ArmAction]] = {
    kind.name: kind for kind in (PositionAction, PoseAction, JointAction)
}
# [m] Distance of the tools from the reset point along Y, each on the side of its base.
START_OFFSET = 0.1


class Arms(ArmActor, Gripper):
    """One or two arms of a kind that hold vertices of an object.

    The action is one of `ACTIONS`; by default it is that of pickers, (dx, dy, dz) of the commanded
    tool point and grip. A commanded point stays within the workspace and the arm's reach. The arm
    follows as fast as its joints can, and keeps some centimeters from the other arm; the command
    waits if the arm falls behind. Grips are those of the `Grasp`. Hands and open fingers push the
    object; the links of the arms pass through it.

    Attributes:
        mounts: base of each arm.
        pick_distance: largest distance [m] between a tool point and a vertex that the hand can
            take.
    """

    counted_by = "arms"
    least_distance = 0.15  # Measured: 0.14 m side by side (Franka), 0.08 m face to face.
    pick_distance = PICK_DISTANCE
    _holding: Grasp
    _filtered_command: ArmAction

    def _build(
        self,
        arm: Arm = ARMS["franka"],
        num_arms: int = 2,
        base_height: float = 0.0,
        mounts: Sequence[Mount] | None = None,
        grasp: str = "attach",
        visual: str = "primitive",
        action: str = PositionAction.name,
    ):
        """Builds the arms.

        Args:
            arm: kind of arm.
            num_arms: 1, at -Y and facing +Y, or 2 that face each other.
            base_height: height of the mounting planes above the floor [m].
            mounts: other bases of the arms.
            grasp: how they hold: "attach" or "friction".
            visual: "primitive" or "menagerie", as in `arm_bodies.add_arms`.
            action: "position", "pose" or "joints".

        Raises:
            InvalidArgumentError: for another number of arms; if there is no such grasp, look or
                action.
            UnavailableError: as in `arm_bodies.add_arms`.
        """
        check_count("arms", num_arms, 1, 2)
        check_name("grasp", grasp, GRASPS)
        check_name("action", action, ACTIONS)
        if mounts is None:
            mounts = facing_each_other(num_arms, arm.distance, *arm.reach, height=base_height)
        self.arm, self.mounts = arm, tuple(mounts)
        self.name = f"{arm.name}/{grasp}"
        if action != PositionAction.name:
            self.name += f"/{action}"
        self.wrists = arm_bodies.wrists(num_arms)
        self._mjcf_root = mjcf.RootElement(model="arms")
        self._holding = GRASPS[grasp](num_arms)
        self.hold_height = self._holding.hold_height
        arm_bodies.add_arms(
            self._mjcf_root, arm, self.mounts, self._holding.pad_contact,
            self._holding.least_pad, visual,
        )  # fmt: skip
        tips = AttachGrasp.tip_clearance - self._holding.tip_clearance
        kind = ACTIONS[action]
        self.servos = JointServos(arm, self.mounts, arm_bodies.home(arm), tips)
        self._filtered_command = kind(self.servos, self._clip)
        self.actions = self._filtered_command.actions
        self.displaces, self.turns = kind.displaces, kind.turns
        self._set_workspace(Workspace((-1.0, -1.0, 0.0), (1.0, 1.0, 1.0)))

    def after_compile(self, physics, random_state):
        super().after_compile(physics, random_state)
        self._holding.use(self.servos.fingers)

    def within_reach(self, i: int, point: np.ndarray) -> np.ndarray:
        """Returns where arm `i` goes if commanded to a point (3,) [m].

        The point is clipped to the box `limits` and, beyond the arm's reach, moved straight towards
        the base at the same height. Joint limits may stop an arm earlier: a Franka 5 cm earlier,
        near the floor with its base 0.5 m high.

        Raises:
            InvalidArgumentError: for another index or shape, or a number that is not finite.
        """
        check_count("i", i, 0, self.num_grippers - 1)
        point = as_finite("point", point, (3,))
        return self.mounts[i].clip(np.clip(point, self._low, self._high))

    def _clip(self, points: np.ndarray) -> np.ndarray:
        return np.array([self.within_reach(i, point) for i, point in enumerate(points)])

    @property
    def at_reach(self) -> int:
        """Number of commanded points at the end of an arm's reach, which may be clipped."""
        points = zip(self.mounts, self._filtered_command.commanded, strict=True)
        return sum(mount.at_end(point) for mount, point in points)

    def default_positions(self, point: np.ndarray) -> np.ndarray:
        positions = np.tile(point, (self.num_grippers, 1)).astype(float)
        if self.num_grippers == 2:
            positions[:, 1] += [-START_OFFSET, START_OFFSET]
        return positions

    def order(self, points: np.ndarray) -> list[int]:
        own = super().order(points)  # Each arm reaches for its own side.
        return own if len(own) == 1 or points[0][1] <= points[1][1] else [1, 0]

    def place(self, positions: np.ndarray, workspace: Workspace) -> None:
        self._holding.reset()
        self._set_workspace(workspace)
        self._filtered_command.start(self._clip(positions))
        self.servos.reset()

    def _set_workspace(self, workspace: Workspace):
        super()._set_workspace(workspace)
        self._low, self._high = np.array(workspace.low), np.array(workspace.high)
        clearance = self._holding.tip_clearance
        if workspace.low[2] < 0.0:
            clearance = max(clearance + workspace.low[2], FrictionGrasp.tip_clearance)
        self._low[2] = max(self._low[2], self.arm.pad_reach + clearance)

    def take(self, vertices: Sequence[int]) -> None:
        for i, (vertex, tool) in enumerate(zip(vertices, self.positions(), strict=True)):
            self._holding.take_at(i, vertex, tool)

    # ------------------------------------------------------------------ motion

    def command(self, action: np.ndarray) -> None:
        self._closed = self._filtered_command.command(action)

    def displacing(self, fractions: np.ndarray, grips: Sequence[bool] | np.ndarray) -> np.ndarray:
        return self._filtered_command.displacing(*self._checked(grips, fractions=fractions))

    def plan(self) -> None:
        """Moves the commanded points by the action, as far as allowed, and the arms after them."""
        self._filtered_command.advance()
        self._holding.plan(self._closed, self.positions())
        self.servos.plan(self._filtered_command.follow)

    def move(self, fraction: float, timestep: float) -> None:
        super().move(fraction, timestep)
        self._holding.move(self._ahead, timestep)

    def after_substep(self, physics, random_state):
        self._holding.sense(self._closed, self.positions)

    def _ahead(self, timestep: float) -> np.ndarray:
        """Returns predicted tool points (num_grippers, 3) [m] after `timestep` [s].

        The prediction neglects joint acceleration: 1 to 3 mm in a jerk.
        """
        return self.positions() + timestep * self.servos.velocities()

    def positions(self) -> np.ndarray:
        """Returns actual tool points (num_grippers, 3) [m], not commanded ones."""
        return self.servos.points()

    def commanded_positions(self) -> np.ndarray:
        """Returns commanded tool points (num_grippers, 3) [m]."""
        return self._filtered_command.commanded

    def commanded_quaternions(self) -> np.ndarray:
        """Returns commanded orientations (num_grippers, 4) of tools as (w, x, y, z).

        Raises:
            InvalidArgumentError: unless `action` is "pose".
        """
        return self._poses.orientations

    def posing(
        self, fractions: np.ndarray, turned: np.ndarray, grips: Sequence[bool] | np.ndarray
    ) -> np.ndarray:
        """Returns the action (action_size,) that moves and rotates tools.

        Args:
            fractions: fractions of `MAX_DISPLACEMENT` along X, Y and Z in a sim step (num_grippers,
                3).
            turned: rotation vectors about these as fractions of `MAX_TURN` in a sim step
                (num_grippers, 3).
            grips: whether each gripper closes (num_grippers,).

        Raises:
            InvalidArgumentError: unless `action` is "pose"; for another shape.
        """
        return self._poses.posing(*self._checked(grips, fractions=fractions, turned=turned))

    @property
    def _poses(self) -> PoseAction:
        if not isinstance(self._filtered_command, PoseAction):
            valid = f"{PoseAction.name!r}, whose actions rotate tools"
            raise InvalidArgumentError("action", self._filtered_command.name, valid)
        return self._filtered_command

    def remembered(self) -> np.ndarray:
        """Returns the grips, then the commanded state (4 * num_grippers + k,)."""
        return np.concatenate([super().remembered(), self._filtered_command.remembered()])

    @property
    def remembers(self) -> dict[str, int]:
        return super().remembers | self._filtered_command.remembers

    def symmetries(self, turn: np.ndarray) -> list[ActorSymmetry]:
        order = exchanged(self.mounts, turn)
        if order is None or self._filtered_command.name != PositionAction.name:
            return []
        own = gripper_symmetry(turn, order)
        commanded = blocks([turn] * len(order), order)
        sensed = block_diag(own.sensed, self.servos.turned(turn, order))
        return [own._replace(sensed=sensed, remembered=block_diag(own.remembered, commanded))]

    def diagnostics(self) -> dict[str, float | int]:
        return {**super().diagnostics(), "at_reach": self.at_reach}
