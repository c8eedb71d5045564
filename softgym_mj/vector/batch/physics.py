"""`BatchPhysics`: moving objects of a batch of environments, and how they are read from one."""

from collections.abc import Mapping
from typing import Any, Protocol

import numpy as np

from softgym_mj.metrics import Array
from softgym_mj.tasks.shared.state import State

Arrays = Mapping[str, np.ndarray]


class BatchPhysics(Protocol):
    """Objects and an actor in all environments, a row for each.

    Attributes:
        state: simulation state of all environments: name -> array (num_envs, ...).
        changed: how many times arrays that are not in `state` have been replaced.
        flags: what went wrong so far, as bits (num_envs,); the first one: it is not finite.
    """

    state: dict[str, Any]
    changed: int
    flags: Array

    def read(self) -> Arrays:
        """Reads model and state from the CPU environment so that a batch row can continue it."""

    def placed(self, read: Arrays) -> Arrays:
        """What `read` said, in any process, as a row of `state`."""

    def arrays(self) -> Arrays:
        """Views of the environment's state, by name."""

    def movers(self) -> list[int]:
        """Bodies of the environment's model that its actor moves."""

    def poses(self) -> Array:
        """Positions [m] and quaternions of movers in all environments (num_envs, movers, 7)."""

    def points(self, number: int) -> Array:
        """Of what deforms (num_envs, at most `number`, 3) [m], zeros where there is none."""

    def command(self, actions: Array) -> None:
        """Starts an env step with actions (num_envs, n)."""

    def sim_steps(self, usual: int) -> int:
        """How many sim steps the env step has that was commanded; asks the device if they vary.

        Args:
            usual: that of the task.
        """
        return usual

    def sim_step(self) -> None:
        """Makes a sim step of all environments."""

    def task_state(self, number: int) -> State:
        """The state of all environments, with `number` points each."""

    def strains(self) -> Array:
        """The largest relative elongation of an edge (num_envs,)."""

    def info(self, strains: Array, largest: Array) -> dict[str, Array]:
        """Scalars (num_envs,) of objects and actor by name.

        Args:
            strains: from `strains`.
            largest: of the episode so far.
        """

    def holds(self) -> Array:
        """1 for each gripper that holds something (num_envs, grippers) uint8."""

    def get_state(self, i: int) -> tuple[Arrays, Arrays]:
        """The state of environment `i`, as in `arrays`, and what its actor remembers."""
