"""Checks what a task measures, as soon as it has."""

import math
from collections.abc import Iterable

import numpy as np

from softgym_mj.exceptions import InvalidArgumentError
from softgym_mj.metrics import Measures

_NUMBERS = (float, int, np.floating, np.integer, np.bool_)  # A bool is an int.
# Names in info that are not the task's own; names of other groups begin with a word of theirs.
INFO_NAMES = frozenset(
    ("performance", "normalized_performance", "success", "variation", "physics_warnings")
)
_INFO_PREFIXES = ("reward_", "domain_")


def checked(measures: object) -> Measures:
    """The measures of one simulation as Python's numbers.

    Raises:
        InvalidArgumentError: for what is no number, not finite or has the name of something else in
            info: one of `INFO_NAMES`, or what begins with "reward_" or "domain_".
    """
    if not isinstance(measures, Measures):
        raise InvalidArgumentError("measure()", measures, "`Measures`")
    groups = {"rewards": measures.rewards, "info": measures.info}
    for group, values in groups.items():
        if not isinstance(values, dict):
            raise InvalidArgumentError(group, values, "a dict from names to numbers")
    for name in measures.info:
        if not isinstance(name, str) or name in INFO_NAMES or name.startswith(_INFO_PREFIXES):
            taken = f"{', '.join(sorted(INFO_NAMES))}, or what begins with reward_ or domain_"
            raise InvalidArgumentError("info", name, f"a name that info does not have: {taken}")
    return Measures(
        _number("performance", measures.performance, finite=True),
        {k: _number(f"rewards[{k!r}]", v, finite=True) for k, v in measures.rewards.items()},
        {k: _number(f"info[{k!r}]", v, finite=False) for k, v in measures.info.items()},
    )


def _number(name: str, value: object, finite: bool) -> float | int | bool:
    if isinstance(value, np.ndarray) and value.ndim == 0:
        value = value[()]
    if not isinstance(value, _NUMBERS) or (finite and not math.isfinite(value)):
        raise InvalidArgumentError(name, value, "a finite number" if finite else "a number")
    return value.item() if isinstance(value, np.generic) else value


def check_names(groups: Iterable[Iterable[str]]) -> None:
    """Raises `InvalidArgumentError` for a name that two groups of what info lists have."""
    seen = set(INFO_NAMES)
    for group in groups:
        names = set(group)
        if twice := sorted(seen & names):
            raise InvalidArgumentError(
                "measures or diagnostics", twice, "names that info has only once"
            )
        seen |= names
