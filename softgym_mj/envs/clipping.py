"""`Clipping`: clips actions to their box, with a warning the first time."""

from typing import Any

import gymnasium
import numpy as np
from gymnasium import logger

from softgym_mj.robots.base import BOUND_TOLERANCE
from softgym_mj.validation import as_array


class Clipping:
    """Clips actions (..., n) of one environment, or of several, to a box (n,)."""

    def __init__(self, space: gymnasium.spaces.Box):
        """Reads the bounds of `space`, the box of one environment."""
        self._low, self._high = space.low, space.high
        self._warned = False

    def __call__(self, actions: Any) -> Any:
        """Returns the actions within the box.

        Values that are not finite, and anything but an array of real numbers of the right size, are
        returned unchanged: the check that follows rejects them.
        """
        array = as_array("actions", actions)
        if array.dtype.kind not in "fiub" or array.shape[-1:] != self._low.shape:
            return actions
        finite = np.isfinite(array)
        below, above = self._low - BOUND_TOLERANCE, self._high + BOUND_TOLERANCE
        if not self._warned and (finite & ((array < below) | (array > above))).any():
            self._warned = True
            logger.warn(
                f"an action is outside of its box, {self._low.tolist()} to {self._high.tolist()}: "
                "it is clipped; later ones are clipped without a warning"
            )
        return np.where(finite, np.clip(array, self._low, self._high), array)
