"""What comes from outside is of the kind that annotations say: the one check of types.

`typed` marks the border: what is behind it need not look again.
"""

import collections.abc
import contextlib
import functools
import inspect
import math
import re
import types
import typing
from collections.abc import Callable, Mapping, Sequence
from typing import Any, TypeVar

import numpy as np

from softgym_mj.exceptions import InvalidArgumentError

_Border = TypeVar("_Border", bound=Callable)
_EMPTY = inspect.Parameter.empty
_NUMBERS: dict[Any, Any] = {
    bool: bool | np.bool_,
    int: int | np.integer,
    float: int | float | np.integer | np.floating,
}
_WORDS = {"bool": "True or False", "int": "a whole number", "float": "a finite number"}


def typed(border: _Border) -> _Border:
    """Has a function, or the constructor of a class, refuse arguments of other kinds.

    Annotations say what is expected; those in quotes say nothing.

    Raises:
        InvalidArgumentError: by the function, for an argument of another kind.
    """
    if isinstance(border, type):
        border.__init__ = typed(border.__init__)  # type: ignore[misc]
        return border
    signature = inspect.signature(border)
    several = inspect.Parameter.VAR_POSITIONAL, inspect.Parameter.VAR_KEYWORD
    kinds = {
        name: Any if parameter.kind in several else parameter.annotation
        for name, parameter in signature.parameters.items()
    }

    @functools.wraps(border)
    def checked(*args: Any, **kwargs: Any) -> Any:
        given: dict[str, Any] = {}
        with contextlib.suppress(TypeError):  # Of a call that Python itself refuses below.
            given = signature.bind(*args, **kwargs).arguments
        for name, value in given.items():
            check_kind(name, value, kinds[name])
        return border(*args, **kwargs)

    return typing.cast(_Border, checked)


def check_kind(argument: str, value: object, kind: Any) -> None:
    """Raises `InvalidArgumentError` unless a value is of the kind that an annotation names.

    NumPy's numbers are numbers, NaN and infinity are none, and a list may stand for a tuple, as
    JSON has no other.
    """
    if not _is_of(value, kind):
        name = kind.__name__ if isinstance(kind, type) else str(kind)
        words = _WORDS.get(name, re.sub(r"\b(\w+\.)+", "", name))
        raise InvalidArgumentError(argument, value, words)


def as_array(argument: str, value: object) -> np.ndarray:
    """Returns an array of the shape (...) of a value: a number, sequence, array or tensor.

    Raises:
        InvalidArgumentError: if NumPy makes none of it, for whatever reason: ragged lists, tensors
            that need gradients or have a type or device that NumPy lacks.
    """
    try:
        return np.asarray(value)
    except Exception as error:  # Whatever the value's own class raises.
        reason = f"{type(value).__name__}: {error}"
        raise InvalidArgumentError(f"{argument} is no array of real numbers: {reason}") from error


def _is_of(value: Any, kind: Any) -> bool:
    origin, parts = typing.get_origin(kind), typing.get_args(kind)
    if kind in _NUMBERS:
        numbers = isinstance(value, _NUMBERS[kind])
        truth = isinstance(value, _NUMBERS[bool])  # A bool is an int to Python.
        return numbers and truth == (kind is bool) and -math.inf < value < math.inf
    if origin in (typing.Union, types.UnionType):
        return any(_is_of(value, part) for part in parts)
    if origin in (tuple, list, collections.abc.Sequence):
        return _are_of(value, origin, parts)
    if origin in (dict, collections.abc.Mapping):
        known = isinstance(value, Mapping)
        return known and all(_is_of(k, parts[0]) and _is_of(v, parts[1]) for k, v in value.items())
    return not isinstance(kind, type) or kind in (_EMPTY, Any) or isinstance(value, kind)


def _are_of(values: Any, origin: Any, parts: tuple[Any, ...]) -> bool:
    """Whether these are a sequence of such values; an array is one as well."""
    if isinstance(values, np.ndarray):
        values = values.tolist()
    if not isinstance(values, Sequence) or isinstance(values, str | bytes):
        return False
    if origin is tuple and parts[-1] is not ...:
        return len(values) == len(parts) and all(map(_is_of, values, parts))
    return all(_is_of(value, parts[0]) for value in values)
