"""Argument validation: `@typed` checks arguments against the annotations of a function or class.

Functions behind a `@typed` one need not check types again.
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

_Checked = TypeVar("_Checked", bound=Callable)
_EMPTY = inspect.Parameter.empty
_NUMBERS: dict[Any, Any] = {
    bool: bool | np.bool_,
    int: int | np.integer,
    float: int | float | np.integer | np.floating,
}
_WORDS: dict[Any, str] = {
    bool: "True or False",
    int: "a whole number",
    float: "a finite number",
    str: "a string",
    types.NoneType: "None",
    tuple[int, int]: "two whole numbers",
}


def describe(annotation: type, words: str) -> None:
    """Sets the words for a type in messages: a noun phrase."""
    _WORDS[annotation] = words


def typed(checked: _Checked) -> _Checked:
    """Decorates a function, or the constructor of a class, with a check of argument types.

    Arguments are checked against their annotations; annotations in quotes are ignored.

    Raises:
        InvalidArgumentError: when the function is called with an argument of another type.
    """
    if isinstance(checked, type):
        checked.__init__ = typed(checked.__init__)  # type: ignore[misc]
        return checked
    signature = inspect.signature(checked)
    several = inspect.Parameter.VAR_POSITIONAL, inspect.Parameter.VAR_KEYWORD
    annotations = {
        name: Any if parameter.kind in several else parameter.annotation
        for name, parameter in signature.parameters.items()
    }

    @functools.wraps(checked)
    def wrapper(*args: Any, **kwargs: Any) -> Any:
        given: dict[str, Any] = {}
        with contextlib.suppress(TypeError):  # The call below raises Python's own error.
            given = signature.bind(*args, **kwargs).arguments
        for name, value in given.items():
            check_type(name, value, annotations[name])
        return checked(*args, **kwargs)

    return typing.cast(_Checked, wrapper)


def check_type(argument: str, value: object, annotation: Any) -> None:
    """Raises `InvalidArgumentError` unless a value has the type of an annotation.

    NumPy scalars are accepted as numbers, NaN and infinity are not. A list is accepted for a tuple,
    because JSON has no tuples.
    """
    if not _is_of(value, annotation):
        raise InvalidArgumentError(argument, value, _described(annotation))


def as_array(argument: str, value: object, *shapes: tuple[int, ...]) -> np.ndarray:
    """Converts a number, sequence, array or tensor to an array (...).

    Args:
        argument: Name of the argument.
        value: Number, sequence, array or tensor.
        *shapes: Accepted shapes; none for any.

    Raises:
        InvalidArgumentError: if its shape is another, or NumPy cannot convert it: ragged lists,
            tensors that need gradients or have a data type or device that NumPy lacks.
    """
    try:
        array = np.asarray(value)
    except Exception as error:  # The value's own class may raise any error.
        reason = f"{type(value).__name__}: {error}"
        raise InvalidArgumentError(f"{argument} is not an array of numbers: {reason}") from error
    if shapes and array.shape not in shapes:
        raise InvalidArgumentError(f"{argument}.shape", array.shape, " or ".join(map(str, shapes)))
    return array


def as_finite(
    argument: str, value: object, *shapes: tuple[int, ...], most: float = math.inf
) -> np.ndarray:
    """Converts a value to finite numbers (...) float64.

    Args:
        argument: Name of the argument.
        value: Number, sequence, array or tensor.
        *shapes: Accepted shapes; none for any.
        most: Largest accepted absolute value.

    Raises:
        InvalidArgumentError: if its shape is another, or an entry is no finite number or larger.
    """
    array = as_array(argument, value, *shapes)
    valid = "finite numbers" if math.isinf(most) else f"finite numbers in -{most:g}..{most:g}"
    if array.dtype.kind not in "fiu":
        raise InvalidArgumentError(argument, value, valid)
    good = np.isfinite(array) & (np.abs(array) <= most)
    if not good.all():
        raise InvalidArgumentError(argument, array[~good][0].item(), valid)
    return array.astype(float)


def _described(annotation: Any) -> str:
    """Returns an annotation in words, such as "a whole number or None"."""
    origin, parts = typing.get_origin(annotation), typing.get_args(annotation)
    if annotation in _WORDS:
        return _WORDS[annotation]
    if origin in (typing.Union, types.UnionType):
        return " or ".join(map(_described, parts))
    if origin is tuple and ... not in parts:
        return f"({', '.join(map(_described, parts))})"
    name = annotation.__name__ if isinstance(annotation, type) and not parts else str(annotation)
    return re.sub(r"\b(\w+\.)+", "", name)


def _is_of(value: Any, annotation: Any) -> bool:
    """Returns whether a value has the type of an annotation."""
    origin, parts = typing.get_origin(annotation), typing.get_args(annotation)
    if annotation in _NUMBERS:
        is_number = isinstance(value, _NUMBERS[annotation])
        is_bool = isinstance(value, _NUMBERS[bool])  # A bool is an int to Python.
        return is_number and is_bool == (annotation is bool) and -math.inf < value < math.inf
    if origin in (typing.Union, types.UnionType):
        return any(_is_of(value, part) for part in parts)
    if origin in (tuple, list, collections.abc.Sequence):
        return _are_of(value, origin, parts)
    if origin in (dict, collections.abc.Mapping):
        is_mapping = isinstance(value, Mapping)
        return is_mapping and all(
            _is_of(k, parts[0]) and _is_of(v, parts[1]) for k, v in value.items()
        )
    is_type = isinstance(annotation, type) and annotation not in (_EMPTY, Any)
    return not is_type or isinstance(value, annotation)


def _are_of(values: Any, origin: Any, parts: tuple[Any, ...]) -> bool:
    """Returns whether values are a sequence, or an array, of values of these types."""
    if isinstance(values, np.ndarray):
        values = values.tolist()
    if not isinstance(values, Sequence) or isinstance(values, str | bytes):
        return False
    if origin is tuple and parts[-1] is not ...:
        return len(values) == len(parts) and all(map(_is_of, values, parts))
    return all(_is_of(value, parts[0]) for value in values)
