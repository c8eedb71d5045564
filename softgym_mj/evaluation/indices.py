"""Indices as text: "800,803,810-819"."""

import re
from collections.abc import Iterable

from softgym_mj.exceptions import InvalidArgumentError

_PART = re.compile(r"(\d+)(?:-(\d+))?")


def parsed(argument: str, text: str) -> tuple[int, ...]:
    """The indices that a text names, in its order; a range includes its end.

    Raises:
        InvalidArgumentError: naming `argument`, for another text.
    """
    found: list[int] = []
    for part in text.split(","):
        match = _PART.fullmatch(part.strip())
        if match is None:
            raise InvalidArgumentError(argument, text, "indices and ranges such as 800,803,810-819")
        first, last = match.groups()
        found += range(int(first), int(last or first) + 1)
    return tuple(found)


def as_text(indices: Iterable[int]) -> str:
    """The text of indices, in ascending order."""
    ranges: list[list[int]] = []
    for index in sorted(indices):
        if ranges and index == ranges[-1][-1] + 1:
            ranges[-1][1:] = [index]
        else:
            ranges.append([index])
    return ",".join("-".join(map(str, ends)) for ends in ranges)
