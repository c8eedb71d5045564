"""Validation of Gymnasium resets: options, states, variations."""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from softgym_mj.envs.snapshots import Snapshot
from softgym_mj.exceptions import InvalidArgumentError, SnapshotError, check_name
from softgym_mj.validation import check_type

_SHOWN = 60  # Characters of a bad state in a message.


def checked_options(options: object) -> dict[Any, Any]:
    """Returns a copy of the options of a reset.

    Raises:
        InvalidArgumentError: for anything but a dict or None.
    """
    if options is None:
        return {}
    if not isinstance(options, Mapping):
        raise InvalidArgumentError("options", options, 'a dict such as {"variation": 800}, or None')
    return dict(options)


def check_known(seed: object, options: Mapping[str, Any], others: Sequence[str] = ()) -> None:
    """Raises unless a reset can have these options.

    Args:
        seed: Seed of the reset.
        options: Options of the reset.
        others: Further names that are valid.

    Raises:
        InvalidArgumentError: for an unknown option; for a seed or a variation with a state.
    """
    for key in options:
        check_name("options key", key, ("variation", "state", *others))
    if "state" in options:
        for name, value in (("seed", seed), ("variation", options.get("variation"))):
            if value is not None:
                raise InvalidArgumentError(
                    name, value, "None with the option 'state', which has its own"
                )


def checked_state(state: Any) -> tuple[Snapshot, Mapping[str, Any]]:
    """Returns a state as a snapshot and the state of a generator.

    Raises:
        SnapshotError: for anything else.
    """
    try:
        snapshot, generator = state
        np.random.PCG64().state = generator
        check_type("snapshot", snapshot, Snapshot)
    except (LookupError, TypeError, ValueError, OverflowError) as error:
        reason = f"expected what `get_state` returned, not {brief(state)}"
        if isinstance(state, Snapshot):
            reason += "; it is of softgym_mj.load: its `set_state` restores it"
        raise SnapshotError(reason) from error
    return snapshot, generator


def brief(value: object) -> str:
    """Returns a value's type and its first characters: a state has thousands."""
    return f"{type(value).__name__} {repr(value)[:_SHOWN]}"


def draw_variation(generator: np.random.Generator, variations: Sequence[int]) -> int:
    """Draws the variation of the next episode from a split."""
    return int(variations[int(generator.integers(len(variations)))])
