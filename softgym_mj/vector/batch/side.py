"""`Side`: what moves in the worlds of a batch, and how it is read from an environment."""

import dataclasses
from collections.abc import Mapping
from typing import Any, Protocol

import numpy as np

from softgym_mj.tasks.shared.state import Episode, State

Arrays = Mapping[str, np.ndarray]


@dataclasses.dataclass(frozen=True)
class Start:
    """How an episode of a variation starts, or goes on.

    Attributes:
        model: what a side knows of it, from `Side.describe`.
        state: arrays by name, as `Side.arrays` has them.
        actor: what the actor remembers.
        episode: what measures compare with.
        domain: values of the domain parameters that vary, by name.
        strain: largest of an edge so far.
    """

    model: Any
    state: Arrays
    actor: Arrays
    episode: Episode
    domain: Mapping[str, float]
    strain: float


class Side(Protocol):
    """Objects and an actor in all worlds, a row for each."""

    @property
    def flags(self) -> np.ndarray:
        """What went wrong so far, as bits (num_worlds,); the first one: it is not finite."""
        ...

    def describe(self) -> Any:
        """What does not change in an episode, of the variation that the environment plays."""

    def arrays(self) -> Arrays:
        """Views of the environment's state, by name."""

    def start(self, i: int, start: Start) -> None:
        """Puts world `i` somewhere."""

    def command(self, actions: np.ndarray) -> None:
        """Starts an env step with actions (num_worlds, n)."""

    def sim_step(self) -> None:
        """Makes a sim step of all worlds."""

    def state(self, number: int) -> State:
        """The state of all worlds, with `number` points each."""

    def strains(self) -> np.ndarray:
        """The largest relative elongation of an edge (num_worlds,)."""

    def info(self, strains: np.ndarray, largest: np.ndarray) -> dict[str, np.ndarray]:
        """Scalars (num_worlds,) of objects and actor by name.

        Args:
            strains: from `strains`.
            largest: of the episode so far.
        """

    def holds(self) -> np.ndarray:
        """1 for each gripper that holds something (num_worlds, grippers) uint8."""

    def get_state(self, i: int) -> tuple[Arrays, Arrays]:
        """The state of world `i`, as in `arrays`, and what its actor remembers."""
