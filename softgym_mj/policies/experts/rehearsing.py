"""`RehearsingExpert`: simulates candidate plans and executes the best one.

Each plan is a heuristic whose outcome is hard to predict, so it is simulated. A rehearsal leaves no
trace: the environment continues from its state before.
"""

import itertools
import math
from collections.abc import Callable, Iterator, Sequence

import numpy as np
from dm_control.rl.control import PhysicsError

from softgym_mj.policies.experts.picker_expert import OPEN, PickerExpert

Plan = Callable[[], Iterator[np.ndarray]]

STEP_PRICE = 0.001  # Cost of an env step in normalized performance.
GAIN = 0.01  # Minimum gain for which a well-placed object is moved again.
SETTLING = 4  # Env steps for an object to come to rest after a plan.


class RehearsingExpert(PickerExpert):
    """Selects among plans: functions that return a generator of actions from the current state."""

    def _value(self) -> float:
        """Returns the value of the current state."""
        return float(self._env.task.info()["normalized_performance"])

    def _outcomes(self, plans: Sequence[Plan], then: Plan | None = None) -> np.ndarray:
        """Returns the values (n,) of the outcomes of plans, minus the cost of their env steps.

        The plan `then` follows each of them; None rests for `SETTLING` env steps.
        """
        return np.array([self._outcome(plan, then or self._settle) for plan in plans])

    def _outcome(self, *plans: Plan, value: Callable[[], float] | None = None) -> float:
        """Returns the value after plans in sequence, minus the cost of their env steps.

        The value is -inf if the simulation diverges.
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
