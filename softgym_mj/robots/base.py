"""`Actor`: interface that turns an agent's action into motion; all that environments use."""

import abc
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from dm_control import composer
from dm_control.composer.observation import observable
from dm_env import specs

from softgym_mj.entities.entity import Entity
from softgym_mj.entities.flex_group import FlexGroup
from softgym_mj.exceptions import InvalidArgumentError
from softgym_mj.rendering.observables import wrist_observables
from softgym_mj.robots.symmetry import ActorSymmetry
from softgym_mj.robots.workspace import ToolStart
from softgym_mj.validation import as_array

SIM_STEP = 0.01  # [s] SoftGym's sim step: actions are applied once in each.
BOUND_TOLERANCE = 1e-6  # Actions this far outside [-1, 1] are float32 rounding, not mistakes.


def bounds_violated(entries: np.ndarray) -> str:
    """Returns the end of a message about entries of an action: their bounds, and advice."""
    advice = "clip the action first, for example with numpy.clip(action, -1, 1)."
    if np.isnan(entries).any():
        advice = "NaN comes from the policy or its input, and clipping does not remove it."
    return f"must be finite and within [-1, 1]; {advice}"


class ActionSpace(NamedTuple):
    """Entries of an action, each from -1 to 1.

    Attributes:
        entries: name, unit ("" for none) and range of each; [-1, 1] is scaled to the range.
        layout: the same in a few words, for messages.
        switches: indices of entries of which only the sign matters: they switch something on or off
            and move nothing.
    """

    entries: tuple[tuple[str, str, str], ...]
    layout: str
    switches: tuple[int, ...] = ()


class Actor(abc.ABC):
    """Moves grippers or cups; the action has `action_size` entries in [-1, 1].

    Call order: `command` once in an env step, `plan` in every sim step, `move` in every physics
    step.
    """

    # Name of this kind of actor in snapshots and messages, such as "picker" or "franka/attach".
    name: str
    # Env steps of an episode; None for the task's number.
    horizon: int | None = None
    # Whether it blocks the view of the tasks' usual cameras, as arms do.
    hides_view = False
    # Whether its proprioception ends the full and the reduced state.
    ends_states = True
    # Sim steps of the current command; None for the task's action repeat.
    sim_steps: int | None = None
    # Names of the cameras on its hands; only arms have them.
    wrists: tuple[str, ...] = ()

    @property
    @abc.abstractmethod
    def actions(self) -> ActionSpace:
        """Entries of an action."""

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
        """Model names labeled as the actor in segmentation images."""

    @abc.abstractmethod
    def manipulate(self, target: FlexGroup) -> None:
        """Chooses the objects whose vertices grippers can hold."""

    @abc.abstractmethod
    def begin(self, start: ToolStart, vertices: np.ndarray) -> None:
        """Starts an episode at a task's start.

        Args:
            start: positions of grippers or the cup.
            vertices: (n, 3) [m] that grippers can hold.
        """

    @abc.abstractmethod
    def command(self, action: np.ndarray) -> None:
        """Starts an env step with a validated action, which holds for all its sim steps."""

    @abc.abstractmethod
    def plan(self) -> None:
        """Starts a sim step: computes its motion and grips."""

    @abc.abstractmethod
    def move(self, fraction: float, timestep: float) -> None:
        """Commands the motion of the next physics step of `timestep` [s].

        At its end `fraction` (0..1] of the sim step has passed.
        """

    def own_observables(self, height: int, width: int) -> dict[str, observable.Observable]:
        """Returns further observables by name, with images of height x width pixels."""
        return wrist_observables(self.wrists, height, width)

    @abc.abstractmethod
    def proprioception(self) -> np.ndarray:
        """Returns the actor's own state (n,), the end of state observations that do not list it."""

    @property
    @abc.abstractmethod
    def senses(self) -> dict[str, int]:
        """Number of entries of `proprioception` by name and unit, in order."""

    def remembered(self) -> np.ndarray:
        """Returns internal state (n,) that determines the next steps, for `markov`."""
        return np.zeros(0)

    @property
    def remembers(self) -> dict[str, int]:
        """Number of entries of `remembered` by name and unit, in order."""
        return {}

    def symmetries(self, turn: np.ndarray) -> Sequence[ActorSymmetry]:
        """Returns transformations of the actor that go with one of the world; () for none.

        Args:
            turn: matrix (3, 3) that transforms positions in the world.
        """
        return ()

    @abc.abstractmethod
    def diagnostics(self) -> dict[str, float | int]:
        """Returns scalars for info about the last env step."""
        return {}

    @abc.abstractmethod
    def get_state(self) -> dict[str, np.ndarray]:
        """Returns the actor's state that mjData does not hold, for snapshots."""
        return {}

    @abc.abstractmethod
    def set_state(self, state: dict[str, np.ndarray]) -> None:
        """Restores the state that `get_state` returned."""

    def action_spec(self, physics=None) -> specs.BoundedArray:
        """Returns the bounds of an action: `action_size` entries in [-1, 1]."""
        limit = np.ones(self.action_size)
        return specs.BoundedArray(limit.shape, np.float64, -limit, limit, name="action")

    def checked_action(self, action: object) -> np.ndarray:
        """Returns the action as floats (action_size,).

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
                f"action{bad.tolist()} = {array[bad].tolist()} {bounds_violated(array[bad])}"
            )
        return array


class BodyActor(Entity, Actor):
    """Actor with bodies in a model of its own."""

    @property
    def model_names(self) -> tuple[str, ...]:
        return (self._mjcf_root.model,)

    def join(self, arena: composer.Arena) -> None:
        arena.attach(self)
