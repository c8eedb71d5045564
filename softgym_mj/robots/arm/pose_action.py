"""`PoseAction`: commanded translations and rotations of hands."""

import functools
import math

import numpy as np

from softgym_mj.robots.arm import cartesian, turns
from softgym_mj.robots.arm.action import Clip
from softgym_mj.robots.arm.command_filter import CommandFilter, drawn_in
from softgym_mj.robots.arm.joint_servos import JointServos
from softgym_mj.robots.arm.position_action import PositionAction
from softgym_mj.robots.base import ActionSpace
from softgym_mj.robots.gripper import DISPLACEMENTS, gripper_actions

# [rad] Largest rotation about each axis in a sim step: 1.5 rad/s, as for cups. All three together
# are 2.6 rad/s, the limit of a Franka's wrist (2.61); others are quicker.
MAX_TURN = 0.015
# [rad] Largest tilt of a hand from straight down. Beyond, links of the wrist are lower than the
# fingers.
MAX_TILT = math.radians(60.0)
# [m/rad] Length by which rotations are converted to distances where a lead or an acceleration is
# limited.
TURNS_AS = 0.3


class PoseAction(PositionAction):
    """Displacement (dx, dy, dz) and rotation vector (rx, ry, rz) of the commanded tool, and grip.

    Both are along the world's axes, and the frame rotates about the tool point. Its tilt is
    bounded; joint limits bound its rotation about the vertical. Position and orientation wait
    separately if the arm falls behind. If both cannot be reached, position has priority.
    """

    name = "pose"
    turns = True

    def __init__(self, servos: JointServos, clip: Clip):
        super().__init__(servos, clip)
        self._home = turns.from_matrices(self._controller.rotations())
        # Orientations (n, 4) of the filter; `_turns` is relative to them: its points are at zero.
        self._oriented = self._home.copy()
        self._turns = CommandFilter(servos.number)

    @functools.cached_property
    def actions(self) -> ActionSpace:
        ends = f"-{MAX_TURN:g} to {MAX_TURN:g} per sim step"
        rotations = tuple((f"r{axis}", "rad", ends) for axis in "xyz")
        return gripper_actions(self._servos.number, (*DISPLACEMENTS, *rotations))

    def start(self, points: np.ndarray) -> None:
        self._controller.turn(turns.matrices(self._home))
        super().start(points)
        self._oriented = self._home.copy()
        self._turns.start(np.zeros_like(points))

    def displacing(self, fractions: np.ndarray, grips: np.ndarray) -> np.ndarray:
        return self.posing(fractions, np.zeros_like(fractions), grips)

    def posing(self, fractions: np.ndarray, turned: np.ndarray, grips: np.ndarray) -> np.ndarray:
        """Returns the action (action_size,) that also rotates tools.

        Args:
            fractions: as in `displacing` (n, 3).
            turned: rotation vectors (n, 3) as fractions of `MAX_TURN` in a sim step.
            grips: which hands close (n,) bool.
        """
        return np.column_stack([fractions, turned, np.where(grips, 1.0, -1.0)]).ravel()

    def advance(self) -> None:
        super().advance()
        turn = turns.quaternions(MAX_TURN * self._entries[:, 3:])
        wanted = turns.upright(turns.compose(turn, self.orientations), MAX_TILT)
        self._turns.advance(self._about(wanted), self._within_lead)
        commanded = self.orientations
        self._oriented = self._turned(self._turns.points)
        self._turns.commanded = self._about(commanded)
        self._turns.points = np.zeros_like(self._turns.points)

    def follow(self, steps: int) -> None:
        ahead = self._turned(steps * self._turns.step)
        self._controller.turn(turns.matrices(ahead))
        super().follow(steps)

    @property
    def orientations(self) -> np.ndarray:
        """Commanded orientations of the tools as quaternions (n, 4), a fresh array."""
        return self._turned(self._turns.commanded)

    def _turned(self, ways: np.ndarray) -> np.ndarray:
        """Returns the filter's orientations rotated by `ways` (n, 3) [m]: (n, 4)."""
        return turns.compose(turns.quaternions(ways / TURNS_AS), self._oriented)

    def _about(self, orientations: np.ndarray) -> np.ndarray:
        """Returns rotations (n, 3) [m] from the filter's orientations to others (n, 4)."""
        return TURNS_AS * turns.between(self._oriented, orientations)

    def _within_lead(self, ways: np.ndarray) -> np.ndarray:
        reference = self._about(turns.from_matrices(self._controller.rotations()))
        return drawn_in(ways, reference, cartesian.LEAD)

    def remembered(self) -> np.ndarray:
        return np.concatenate([super().remembered(), self.orientations.ravel()])

    @property
    def remembers(self) -> dict[str, int]:
        name = "commanded quaternion of the tool (w, x, y, z)"
        number = self._servos.number
        return super().remembers | {f"arm {i}, {name}": 4 for i in range(number)}

    def get_state(self) -> dict[str, np.ndarray]:
        turned = self._turns.get_state()["filter"]
        return {**super().get_state(), "turns": turned, "oriented": self._oriented.copy()}

    def set_state(self, state: dict[str, np.ndarray]) -> None:
        super().set_state(state)
        self._turns.set_state({"filter": state["turns"]})
        self._oriented = state["oriented"].copy()
