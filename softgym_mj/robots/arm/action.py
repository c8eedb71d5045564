"""`ArmAction`: what the entries of an action of arms are, and how they lead the joints."""

import abc
from collections.abc import Callable

import numpy as np

from softgym_mj.robots.arm.joint_servos import JointServos
from softgym_mj.robots.base import ActionSpace

# Points (n, 3) [m] that hands are sent to, and those that they may go to instead.
Clip = Callable[[np.ndarray], np.ndarray]


class ArmAction(abc.ABC):
    """Leads the joints of n arms from the entries of an action.

    In an env step: `command` once, then `advance` and, every other time, `follow` in every sim
    step.

    Attributes:
        name: key in `arms.ACTIONS`.
        displaces: whether an action says by how much tool points move.
        turns: whether it then has a rotation vector, which says by how much tools turn.
    """

    name: str
    displaces = True
    turns = False

    def __init__(self, servos: JointServos, clip: Clip):
        """Binds it to what it leads, at home; `start` has to be called before anything else.

        Args:
            servos: of the arms.
            clip: where tool points may go to.
        """
        self._servos, self._clip = servos, clip
        self._controller = servos.controller

    @property
    @abc.abstractmethod
    def actions(self) -> ActionSpace:
        """What the entries are: those of each arm one after the other, its grip last."""

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
        """The action (action_size,) that moves tool points alone, as `Gripper.displacing`."""

    @abc.abstractmethod
    def advance(self) -> None:
        """Starts a sim step: moves what is commanded, and the filter behind it."""

    @abc.abstractmethod
    def follow(self, steps: int) -> None:
        """Moves the controller's reference to where the filter will be in so many sim steps."""

    @property
    @abc.abstractmethod
    def commanded(self) -> np.ndarray:
        """Commanded tool points (n, 3) [m], a fresh array."""

    @property
    @abc.abstractmethod
    def leading(self) -> np.ndarray:
        """Tool points (n, 3) [m] of the filter, a fresh array."""

    @abc.abstractmethod
    def remembered(self) -> np.ndarray:
        """What is commanded, as numbers (k,)."""

    @property
    @abc.abstractmethod
    def remembers(self) -> dict[str, int]:
        """How many of these numbers are what, with their unit, in order."""

    @abc.abstractmethod
    def get_state(self) -> dict[str, np.ndarray]:
        """For snapshots."""

    @abc.abstractmethod
    def set_state(self, state: dict[str, np.ndarray]) -> None:
        """Restores what `get_state` returned."""
