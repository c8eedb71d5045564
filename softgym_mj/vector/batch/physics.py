"""`BatchPhysics`: moving objects of a batch of environments, and how they are read from one."""

from collections.abc import Mapping
from typing import Any, Protocol

import numpy as np

from softgym_mj.metrics import Array
from softgym_mj.tasks.shared.state import State

Arrays = Mapping[str, np.ndarray]


class BatchPhysics(Protocol):
    """Objects and actor of all environments, with a row of each array per environment.

    Attributes:
        state: Simulation state of all environments: name -> array (num_envs, ...).
        changed: Number of times that arrays outside `state` have been replaced.
        flags: Failures so far as bits (num_envs,); the first one: the state is not finite.
        is_interleaved: Whether `begin_sim_step` and `finish` do anything; graphs cannot replay
            them.
    """

    state: dict[str, Any]
    changed: int
    flags: Array
    is_interleaved: bool = False

    def read(self) -> Arrays:
        """Reads model and state from the CPU environment so that a batch row can continue it."""

    def placed(self, read: Arrays) -> Arrays:
        """Returns a row of `state` from the result of `read` in any process."""

    def arrays(self) -> Arrays:
        """Returns views of the CPU environment's state by name."""

    def movers(self) -> list[int]:
        """Returns ids of the bodies that the actor moves."""

    def poses(self) -> Array:
        """Returns positions [m] and quaternions of movers (num_envs, movers, 7)."""

    def points(self, number: int) -> Array:
        """Returns points of deformable objects (num_envs, up to `number`, 3) [m], zero-padded."""

    def command(self, actions: Array) -> None:
        """Starts an env step with actions (num_envs, n)."""

    def sim_steps(self, usual: int) -> int:
        """Returns the sim steps of the current env step; reads from the device if they vary.

        Args:
            usual: The task's number of sim steps.
        """
        return usual

    def begin_sim_step(self) -> None:
        """Begins a sim step, before `sim_step`, outside of graphs."""
        return None

    def sim_step(self) -> None:
        """Makes a sim step of all environments."""

    def finish(self) -> None:
        """Ends an env step, after all sim steps, outside of graphs."""
        return None

    def task_state(self, number: int) -> State:
        """Returns the task's `State` of all environments, with `number` points each."""

    def strains(self) -> Array:
        """Returns the largest edge strain (num_envs,)."""

    def info(self, strains: Array, largest: Array) -> dict[str, Array]:
        """Returns info scalars (num_envs,) of objects and actor by name.

        Args:
            strains: Result of `strains`.
            largest: Largest strains of the episodes so far.
        """

    def holds(self) -> Array:
        """Returns 1 for each gripper that holds something (num_envs, grippers) uint8."""

    def get_state(self, i: int) -> tuple[Arrays, Arrays]:
        """Returns the state of environment `i`, as in `arrays`, and of its actor."""
