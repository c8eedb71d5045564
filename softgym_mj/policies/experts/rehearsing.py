"""`RehearsingExpert`: tries plans in the simulation, and does what turns out best.

Each plan is a heuristic that may fail in ways that are hard to foresee; what it leads to is known
once it has been tried. Nothing of a rehearsal is left: the environment goes on from where it was.
"""

import itertools
import math
from collections.abc import Callable, Iterator, Sequence

import numpy as np
from dm_control.rl.control import PhysicsError

from softgym_mj.policies.experts.picker_expert import OPEN, PickerExpert

Plan = Callable[[], Iterator[np.ndarray]]

STEP_PRICE = 0.001  # Normalized performance that an env step costs.
GAIN = 0.01  # Value for which an object that lies well already is moved again.
SETTLING = 4  # Env steps in which an object comes to rest after a plan.


class RehearsingExpert(PickerExpert):
    """Chooses among plans: functions that begin a generator of actions from where things are."""

    def _value(self) -> float:
        """How good the state is."""
        return float(self._env.task.info()["normalized_performance"])

    def _outcomes(self, plans: Sequence[Plan], then: Plan | None = None) -> np.ndarray:
        """Values (n,) of where plans lead, less the price of their env steps.

        Args:
            plans: the plans.
            then: what is done after each of them; nothing for `SETTLING` env steps if None.
        """
        return np.array([self._outcome(plan, then or self._settle) for plan in plans])

    def _outcome(self, *plans: Plan, value: Callable[[], float] | None = None) -> float:
        """The value of where plans lead, one after the other, less the price of their env steps.

        Nothing is worse than that the simulation diverges.
        """
        start = self._env.step_count
        actions = itertools.chain.from_iterable(plan() for plan in plans)
        with self._env.rehearsal() as goes_on:
            try:
                while (action := next(actions, None)) is not None and goes_on(action):
                    pass
                steps = self._env.step_count - start
                return (value or self._value)() - STEP_PRICE * steps
            except PhysicsError:
                return -math.inf

    def _settle(self) -> Iterator[np.ndarray]:
        for _ in range(SETTLING):
            yield self._rest(OPEN)
