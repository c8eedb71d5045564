"""Arguments of a `VectorEnv`, checked before any of its environments gets its own."""

import operator
from collections.abc import Mapping, Sequence
from typing import Any

import gymnasium
import numpy as np

from softgym_mj.envs.environment import Snapshot
from softgym_mj.exceptions import InvalidActionError, OutOfRangeError, SnapshotError
from softgym_mj.robots.base import BOUND_TOLERANCE
from softgym_mj.variations.indices import check_variation

MASK = "reset_mask"  # Gymnasium's option that says who is to be reset.
_SHOWN = 60  # Characters of a wrong state in a message.


def checked_actions(actions: Any, number: int, space: gymnasium.Space) -> np.ndarray:
    """Actions of `number` environments, as an array (number, n).

    Raises:
        OutOfRangeError: unless there is one for each.
        InvalidActionError: for one of the wrong shape, or outside the action space of each, a Box.
    """
    try:
        actions = np.array(actions)  # A copy: an interrupted step may come to it later.
    except ValueError:  # Ragged.
        actions = np.empty(0, object)
    if actions.shape[:1] != (number,):
        valid = f"an action for each of the {number} environments"
        raise OutOfRangeError("actions", f"an array of shape {actions.shape}", valid)
    if not isinstance(space, gymnasium.spaces.Box):
        return actions
    if actions.dtype.kind not in "fiub" or actions.shape[1:] != space.shape:
        raise InvalidActionError(
            f"actions are {actions.dtype}{actions.shape}; expected real numbers "
            f"{(number, *space.shape)}."
        )
    fits = (actions >= space.low - BOUND_TOLERANCE) & (actions <= space.high + BOUND_TOLERANCE)
    bad = np.argwhere(~fits)  # NaN does not fit, either.
    if len(bad):
        first = tuple(bad[0].tolist())
        raise InvalidActionError(
            f"actions{list(first)} = {actions[first]}, of environment {first[0]}, must be finite "
            "and within [-1, 1]; clip the actions first, for example with "
            "numpy.clip(actions, -1, 1). No environment has been stepped."
        )
    return actions


def seed_of_each(seed: Any, number: int) -> list[int | None]:
    """Seeds from one, which the next has one more of, from a sequence, or from None."""
    valid = f"a whole number, or {number} of them"
    try:
        if seed is None or isinstance(seed, (int, np.integer)):
            return [None if seed is None else int(seed) + i for i in range(number)]
        seeds = [None if one is None else operator.index(one) for one in seed]
    except TypeError:
        raise OutOfRangeError("seed", seed, valid) from None
    if len(seeds) != number:
        raise OutOfRangeError("seed", seed, valid)
    return seeds


def options_of_each(options: Mapping[str, Any], number: int) -> list[dict[str, Any]]:
    """Options of `SoftGymEnv.reset` from those for all.

    A "variation" can be a sequence, one for each; a "state" always is.

    Raises:
        OutOfRangeError, SnapshotError: for another number of them, or for bad ones.
    """
    each = [dict(options) for _ in range(number)]
    variations = options.get("variation")
    if isinstance(variations, np.ndarray) and variations.ndim:
        variations = variations.tolist()
    if isinstance(variations, Sequence):
        if len(variations) != number:
            valid = f"an index, or one for each of the {number} environments"
            raise OutOfRangeError("variation", variations, valid)
        for own, variation in zip(each, variations, strict=True):
            own["variation"] = check_variation(variation)
    if "state" in options:
        states = options["state"]
        if not isinstance(states, Sequence) or len(states) != number:
            raise SnapshotError(
                f"expected the states of all {number} environments, not {_brief(states)}"
            )
        for own, state in zip(each, states, strict=True):
            if not (isinstance(state, tuple) and state and isinstance(state[0], Snapshot)):
                raise SnapshotError(f"expected what `get_state` returned, not {_brief(state)}")
            own["state"] = state
    return each


def _brief(value: object) -> str:
    """What something is, in few characters: a state has thousands."""
    return f"{type(value).__name__} {repr(value)[:_SHOWN]}"
