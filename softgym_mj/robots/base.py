"""`Actor`: what turns an agent's action into motion. The environment knows this interface only."""

import abc
from typing import NamedTuple

import numpy as np
from dm_control import composer
from dm_control.composer.observation import observable
from dm_env import specs

from softgym_mj.entities.entity import Entity
from softgym_mj.entities.flex_group import FlexGroup
from softgym_mj.exceptions import InvalidArgumentError
from softgym_mj.rendering.observables import wrist_observables
from softgym_mj.robots.workspace import ToolStart
from softgym_mj.validation import as_array

SIM_STEP = 0.01  # [s] SoftGym's sim step: actions are applied once in each.
BOUND_TOLERANCE = 1e-6  # Actions this far outside [-1, 1] are float32 rounding, not mistakes.


class ActionSpace(NamedTuple):
    """The entries of an action, from -1 to 1 each.

    Attributes:
        entries: name, unit ("" for none) and what the ends mean, of each.
        layout: the same in a few words, for messages.
        switches: indices of entries of which the sign alone counts: they turn something on or off
            and move nothing.
    """

    entries: tuple[tuple[str, str, str], ...]
    layout: str
    switches: tuple[int, ...] = ()


class Actor(abc.ABC):
    """Moves grippers or cups; the action has `action_size` entries in [-1, 1].

    In an env step: `command` once, then `plan` in every sim step and `move` in every physics step.
    """

    # What snapshots and messages call this kind of actor, such as "picker" or "franka/attach".
    name: str
    # Env steps of an episode; None: as many as the task's record says.
    horizon: int | None = None
    # Whether it hides what tasks' usual cameras see: arms do.
    hides_view = False
    # Whether what it senses of itself ends the full and the reduced state.
    ends_states = True
    # Sim steps that the current command takes; None: as many as the task repeats actions.
    sim_steps: int | None = None
    # Names of the cameras on its hands: none unless it is an arm.
    wrists: tuple[str, ...] = ()

    @property
    @abc.abstractmethod
    def actions(self) -> ActionSpace:
        """What the entries of an action are."""

    @property
    def action_size(self) -> int:
        """Number of entries of an action."""
        return len(self.actions.entries)

    @abc.abstractmethod
    def join(self, arena: composer.Arena) -> None:
        """Adds the actor's bodies to the scene."""

    @property
    @abc.abstractmethod
    def model_names(self) -> tuple[str, ...]:
        """Names of the models that segmented images show as the actor."""

    @abc.abstractmethod
    def manipulate(self, target: FlexGroup) -> None:
        """Chooses the objects whose vertices grippers can hold."""

    @abc.abstractmethod
    def begin(self, start: ToolStart, vertices: np.ndarray) -> None:
        """Starts an episode where a task wants it.

        Args:
            start: that place.
            vertices: (n, 3) [m] of what grippers can hold.
        """

    @abc.abstractmethod
    def command(self, action: np.ndarray) -> None:
        """Starts an env step with a checked action, which holds for all its sim steps."""

    @abc.abstractmethod
    def plan(self) -> None:
        """Starts a sim step: chooses what to do and where to move in it."""

    @abc.abstractmethod
    def move(self, fraction: float, timestep: float) -> None:
        """Commands the motion of the next physics step of `timestep` [s].

        At its end `fraction` (0..1] of the sim step has passed.
        """

    def own_observables(self, height: int, width: int) -> dict[str, observable.Observable]:
        """Further observables by name, with images of height x width pixels."""
        return wrist_observables(self.wrists, height, width)

    @abc.abstractmethod
    def proprioception(self) -> np.ndarray:
        """What the actor senses of itself (n,); unless states list it anyway, it ends them, too."""

    @property
    @abc.abstractmethod
    def senses(self) -> dict[str, int]:
        """How many of the numbers of `proprioception` are what, with their unit, in order."""

    def remembered(self) -> np.ndarray:
        """What decides on the next steps and no sensor tells (n,), for the state `markov`."""
        return np.zeros(0)

    @property
    def remembers(self) -> dict[str, int]:
        """How many of the numbers of `remembered` are what, as `senses`."""
        return {}

    @abc.abstractmethod
    def diagnostics(self) -> dict[str, float | int]:
        """Scalars for info about the last env step."""
        return {}

    @abc.abstractmethod
    def get_state(self) -> dict[str, np.ndarray]:
        """What the actor remembers and mjData does not hold, for snapshots."""
        return {}

    @abc.abstractmethod
    def set_state(self, state: dict[str, np.ndarray]) -> None:
        """Restores what `get_state` returned."""

    def action_spec(self, physics=None) -> specs.BoundedArray:
        """Bounds of an action: `action_size` entries in [-1, 1]."""
        limit = np.ones(self.action_size)
        return specs.BoundedArray(limit.shape, np.float64, -limit, limit, name="action")

    def checked_action(self, action: object) -> np.ndarray:
        """The action as floats (action_size,).

        Raises:
            InvalidArgumentError: for a wrong shape, NaN, infinity or an entry outside [-1, 1].
        """
        array = as_array("action", action)
        if array.dtype.kind not in "fiub":
            raise InvalidArgumentError(f"action={action!r} is not an array of real numbers.")
        array = array.astype(float)
        if array.shape != (self.action_size,):
            raise InvalidArgumentError(
                f"action has shape {array.shape}; expected ({self.action_size},): "
                f"{self.actions.layout}."
            )
        limit = 1.0 + BOUND_TOLERANCE
        if not np.abs(array).max() <= limit:  # True for NaN as well.
            bad = np.flatnonzero(~(np.abs(array) <= limit))
            raise InvalidArgumentError(
                f"action{bad.tolist()} = {array[bad].tolist()} must be finite and within [-1, 1]; "
                "clip the action first, for example with numpy.clip(action, -1, 1)."
            )
        return array


class BodyActor(Entity, Actor):
    """An actor with bodies in a model of its own."""

    @property
    def model_names(self) -> tuple[str, ...]:
        return (self._mjcf_root.model,)

    def join(self, arena: composer.Arena) -> None:
        arena.attach(self)
