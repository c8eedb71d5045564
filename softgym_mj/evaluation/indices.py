"""Indices as text: "800,803,810-819"."""

import re
from collections.abc import Iterable

from softgym_mj.exceptions import InvalidArgumentError
from softgym_mj.variations.indices import NUM_VARIATIONS

_PART = re.compile(r"(\d{1,20})(?:-(\d{1,20}))?")


def parsed(argument: str, text: str) -> tuple[int, ...]:
    """Parses indices of variations, such as "800,803,810-819"; a range includes its end.

    Raises:
        InvalidArgumentError: naming `argument`, for invalid text, an index above 999, a range that
            falls or an index twice.
    """
    result: list[int] = []
    for part in text.split(","):
        match = _PART.fullmatch(part.strip())
        if match is None:
            raise InvalidArgumentError(argument, text, "indices and ranges such as 800,803,810-819")
        first, last = (int(end or match[1]) for end in match.groups())
        if max(first, last) >= NUM_VARIATIONS:
            raise InvalidArgumentError(argument, text, f"indices in 0..{NUM_VARIATIONS - 1}")
        if first > last:
            valid = "ranges from the smaller to the larger index, such as 810-819"
            raise InvalidArgumentError(argument, text, valid)
        result += range(first, last + 1)
    if len({*result}) < len(result):
        raise InvalidArgumentError(argument, text, "each index once")
    return tuple(result)


def as_text(indices: Iterable[int]) -> str:
    """Formats indices in ascending order, such as "800,803,810-819"."""
    ranges: list[list[int]] = []
    for index in sorted(indices):
        if ranges and index == ranges[-1][-1] + 1:
            ranges[-1][1:] = [index]
        else:
            ranges.append([index])
    return ",".join("-".join(map(str, ends)) for ends in ranges)
