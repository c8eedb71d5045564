"""`TimeLimit`: decides when a training stops learning, so that it ends within a time."""

import collections
import contextlib
import math
import time
from collections.abc import Callable, Iterable, Iterator

import torch

# Time to create the environments of an evaluation and to write policies and a checkpoint [s].
OVERHEAD = 20.0
# The fastest of the last vector steps is an estimate of the next ones, because the first steps of
# a training, or with a network, compile kernels; fewer than the least number are no estimate.
_LAST, _LEAST = 10, 3


class TimeLimit:
    """Time limit of a training, for learning, evaluations and exports together."""

    def __init__(self, end: float = math.inf, clock: Callable[[], float] = time.monotonic):
        """Sets the limit.

        Args:
            end: Time on the clock at which the training should have ended [s].
            clock: Returns the time [s].
        """
        self._end, self._clock = end, clock
        self._steps = collections.deque[float](maxlen=_LAST)

    @contextlib.contextmanager
    def timed(self) -> Iterator[None]:
        """Times a vector step: choice and execution of actions, without updates."""
        if self._end < math.inf and torch.cuda.is_initialized():
            torch.cuda.synchronize()  # Updates of the step before.
        start = self._clock()
        yield
        self._steps.append(self._clock() - start)

    def is_over(self, evaluations: Iterable[float]) -> bool:
        """Returns whether evaluations would end after the limit.

        Args:
            evaluations: Duration of each evaluation, in vector steps of the training.
        """
        step = min(self._steps) if len(self._steps) >= _LEAST else 0.0
        return self._clock() + sum(OVERHEAD + step * each for each in evaluations) >= self._end
