"""`Evaluation`: what a task measures after an env step, checked as soon as it is made."""

import dataclasses
import math
from collections.abc import Iterable

import numpy as np

from softgym_mj.exceptions import OutOfRangeError

_NUMBERS = (float, int, np.floating, np.integer, np.bool_)  # A bool is an int.
# Names in info that are not the task's own; names of other groups begin with a word of theirs.
INFO_NAMES = frozenset(
    ("performance", "normalized_performance", "success", "variation", "physics_warnings")
)
_INFO_PREFIXES = ("reward_", "domain_")


@dataclasses.dataclass(frozen=True)
class Evaluation:
    """The one evaluation of an env step that feeds reward, info and logs.

    Attributes:
        performance: SoftGym's task metric in its own unit; finite.
        reward_terms: named terms whose sum is the reward; finite.
        measures: further task-specific scalars for info. Their names are none of `INFO_NAMES` and
            do not begin with "reward_" or "domain_".

    Raises:
        OutOfRangeError: for what is no number, not finite or has such a name.
    """

    performance: float
    reward_terms: dict[str, float]
    measures: dict[str, float] = dataclasses.field(default_factory=dict)

    def __post_init__(self):
        if not (isinstance(self.performance, _NUMBERS) and math.isfinite(self.performance)):
            raise OutOfRangeError("performance", self.performance, "a finite number")
        for group in ("reward_terms", "measures"):
            if not isinstance(getattr(self, group), dict):
                raise OutOfRangeError(group, getattr(self, group), "a dict from names to numbers")
        for name, value in self.reward_terms.items():
            if not (isinstance(value, _NUMBERS) and math.isfinite(value)):
                raise OutOfRangeError(f"reward_terms[{name!r}]", value, "a finite number")
        for name, value in self.measures.items():
            if not isinstance(value, _NUMBERS):
                raise OutOfRangeError(f"measures[{name!r}]", value, "a number")
            if not isinstance(name, str) or name in INFO_NAMES or name.startswith(_INFO_PREFIXES):
                taken = f"{', '.join(sorted(INFO_NAMES))}, or what begins with reward_ or domain_"
                raise OutOfRangeError("measures", name, f"a name that info does not have: {taken}")

    @property
    def reward(self) -> float:
        """The sum of its terms."""
        return sum(self.reward_terms.values())


def check_names(groups: Iterable[Iterable[str]]) -> None:
    """Raises `OutOfRangeError` for a name that two groups of what info lists have in common."""
    seen = set(INFO_NAMES)
    for group in groups:
        names = set(group)
        if twice := sorted(seen & names):
            raise OutOfRangeError("measures or diagnostics", twice, "names that info has only once")
        seen |= names
