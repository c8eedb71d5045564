"""`ArmAction`: base of the action spaces of arms: commands that the joints follow."""

import abc
from collections.abc import Callable

import numpy as np

from softgym_mj.robots.arm.command_filter import CommandFilter
from softgym_mj.robots.arm.joint_servos import JointServos
from softgym_mj.robots.base import ActionSpace

# Maps commanded points (n, 3) [m] to allowed ones.
Clip = Callable[[np.ndarray], np.ndarray]


class ArmAction(abc.ABC):
    """Leads the joints of n arms from the entries of an action.

    Call order: `command` once in an env step; `advance` in every sim step, `follow` in every other
    one.

    Attributes:
        name: key in `arms.ACTIONS`.
        displaces: whether an action is a displacement of tool points.
        turns: whether it also has a rotation vector of the tools.
    """

    name: str
    displaces = True
    turns = False

    def __init__(self, servos: JointServos, clip: Clip, points: int | None = None):
        """Binds the action to the servos, at home; call `start` before anything else.

        Args:
            servos: servos of the arms.
            clip: clips tool points to their range.
            points: number of filtered points; None for one per arm.
        """
        self._filter = CommandFilter(points or servos.number)
        self._servos, self._clip = servos, clip
        self._controller = servos.controller

    @property
    @abc.abstractmethod
    def actions(self) -> ActionSpace:
        """Entries of an action: those of one arm after the other, each ending with its grip."""

    @abc.abstractmethod
    def start(self, points: np.ndarray) -> None:
        """Puts the controller's reference at rest near `points` (n, 3) [m], hands down."""

    def command(self, action: np.ndarray) -> np.ndarray:
        """Starts an env step with an action; returns which hands it closes (n,) bool."""
        each = action.reshape(self._servos.number, -1)
        self._entries = each[:, :-1]
        return each[:, -1] > 0.0

    @abc.abstractmethod
    def displacing(self, fractions: np.ndarray, grips: np.ndarray) -> np.ndarray:
        """Returns the action (action_size,) that moves tool points only: `Gripper.displacing`."""

    @abc.abstractmethod
    def advance(self) -> None:
        """Starts a sim step: moves the commanded points, and the filter behind them."""

    @abc.abstractmethod
    def follow(self, steps: int) -> None:
        """Moves the controller's reference to the filter's prediction `steps` sim steps ahead."""

    @property
    @abc.abstractmethod
    def commanded(self) -> np.ndarray:
        """Commanded tool points (n, 3) [m], a fresh array."""

    @abc.abstractmethod
    def remembered(self) -> np.ndarray:
        """Returns the commanded state as numbers (k,)."""

    @property
    @abc.abstractmethod
    def remembers(self) -> dict[str, int]:
        """Number of entries of `remembered` by name and unit, in order."""

    def get_state(self) -> dict[str, np.ndarray]:
        """Returns the state for snapshots."""
        return self._filter.get_state()

    def set_state(self, state: dict[str, np.ndarray]) -> None:
        """Restores the state that `get_state` returned."""
        self._filter.set_state(state)
