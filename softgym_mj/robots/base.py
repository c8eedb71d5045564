"""`Actor`: what turns an agent's action into motion. Tasks know this interface only."""

import abc
import dataclasses

import numpy as np
from dm_control import composer
from dm_env import specs

from softgym_mj.entities.flex import Flex
from softgym_mj.exceptions import InvalidActionError

SIM_STEP = 0.01  # [s] SoftGym's sim step: actions are applied once in each.
_BOUND_TOLERANCE = 1e-6  # Actions this far outside [-1, 1] are float32 rounding, not mistakes.


@dataclasses.dataclass(frozen=True)
class Workspace:
    """Axis-aligned box [m] that the bodies (not the centres) of the grippers stay in."""

    low: tuple[float, float, float]
    high: tuple[float, float, float]

    def centred_at(self, x: float, y: float) -> "Workspace":
        """The same extents with its horizontal centre at (x, y); heights are kept."""
        half = [(high - low) / 2 for low, high in zip(self.low, self.high, strict=True)]
        return Workspace(
            (x - half[0], y - half[1], self.low[2]), (x + half[0], y + half[1], self.high[2])
        )


class Actor(composer.Entity, abc.ABC):
    """One or more grippers that hold vertices of a deformable object.

    The action has `action_size` entries in [-1, 1]. Actors that move grippers by displacement use
    four entries a gripper: (dx, dy, dz) as a fraction of the largest displacement in a sim step
    along the world axes, and grip (> 0 closes, <= 0 opens).
    """

    @property
    @abc.abstractmethod
    def num_grippers(self) -> int:
        """Number of grippers."""

    @property
    @abc.abstractmethod
    def action_size(self) -> int:
        """Number of entries of an action."""

    def join(self, arena: composer.Arena) -> None:
        """Adds the actor's bodies to the scene."""
        arena.attach(self)

    @abc.abstractmethod
    def manipulate(self, target: Flex) -> None:
        """Chooses the object whose vertices the grippers hold."""

    @abc.abstractmethod
    def place(self, positions: np.ndarray, workspace: Workspace) -> None:
        """Starts an episode: grippers open at `positions` (num_grippers, 3) [m] in `workspace`."""

    @abc.abstractmethod
    def default_positions(self, point: np.ndarray) -> np.ndarray:
        """Start positions (num_grippers, 3) [m] around a reset point (3,) [m]."""

    @abc.abstractmethod
    def command(self, action: np.ndarray) -> None:
        """Starts an env step with a checked action, which holds for all its sim steps."""

    @abc.abstractmethod
    def plan(self) -> None:
        """Starts a sim step: opens, closes and chooses where to move."""

    @abc.abstractmethod
    def move(self, fraction: float, timestep: float) -> None:
        """Commands the motion of the next physics step of `timestep` [s].

        At its end `fraction` (0..1] of the sim step has passed.
        """

    @abc.abstractmethod
    def positions(self) -> np.ndarray:
        """Gripper centres (num_grippers, 3) [m]."""

    @property
    @abc.abstractmethod
    def held(self) -> np.ndarray:
        """Vertex index that each gripper holds, -1 where none: (num_grippers,) int."""

    @abc.abstractmethod
    def get_state(self) -> dict[str, np.ndarray]:
        """What the actor remembers and mjData does not hold, for snapshots."""

    @abc.abstractmethod
    def set_state(self, state: dict[str, np.ndarray]) -> None:
        """Restores what `get_state` returned."""

    def action_spec(self, physics=None) -> specs.BoundedArray:
        """Bounds of an action: `action_size` entries in [-1, 1]."""
        return specs.BoundedArray((self.action_size,), np.float64, -1.0, 1.0, name="action")

    def checked_action(self, action: object) -> np.ndarray:
        """The action as floats (action_size,).

        Raises:
            InvalidActionError: for a wrong shape, NaN, infinity or an entry outside [-1, 1].
        """
        try:
            array = np.asarray(action)
        except ValueError:  # Ragged.
            array = np.empty(0, object)
        if array.dtype.kind not in "fiub":
            raise InvalidActionError(f"action={action!r} is not an array of real numbers.")
        array = array.astype(float)
        if array.shape != (self.action_size,):
            raise InvalidActionError(
                f"action has shape {array.shape}; expected ({self.action_size},): "
                f"{self.num_grippers} gripper(s) x {self.action_size // self.num_grippers}."
            )
        limit = 1.0 + _BOUND_TOLERANCE
        if not np.abs(array).max() <= limit:  # True for NaN as well.
            bad = np.flatnonzero(~(np.abs(array) <= limit))
            raise InvalidActionError(
                f"action{bad.tolist()} = {array[bad].tolist()} must be finite and within [-1, 1]; "
                "clip the action first, for example with numpy.clip(action, -1, 1)."
            )
        return array
