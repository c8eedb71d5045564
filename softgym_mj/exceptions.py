"""Errors raised by softgym_mj: one tree, messages that say what would have worked."""

import importlib
import operator
from collections.abc import Iterable, Sequence
from typing import Any

_SHOWN = 200  # Characters of a wrong value in a message.
_SIGNS = {"gt": ">", "ge": ">=", "lt": "<", "le": "<="}


class SoftGymError(Exception):
    """Base class of every error this package raises on purpose."""


class InvalidArgumentError(SoftGymError, ValueError):
    """An argument, an action, a file or a function that is none of the valid ones.

    Made of a message; or of the argument's name, its value and what is valid: the names that there
    are, or words.
    """

    def __init__(
        self,
        argument: "str | InvalidArgumentError",
        value: object = None,
        valid: Iterable[object] = (),
    ):
        # Pickle makes it anew from all three, Gymnasium's vector environments from its predecessor.
        if isinstance(argument, InvalidArgumentError):
            argument, value, valid = argument.args
        super().__init__(argument, value, valid if isinstance(valid, str) else tuple(valid))

    def __str__(self):
        argument, value, valid = self.args
        if not valid:
            return argument
        shown = repr(value)
        if len(shown) > _SHOWN:
            shown = f"{shown[:_SHOWN]}..."
        if isinstance(valid, str):
            return f"{argument}={shown} is refused; valid: {valid}."
        choices = ", ".join(repr(name) for name in valid)
        return f"{argument}={shown} is unknown; valid choices: {choices}."


class UnexpectedArgumentError(SoftGymError, TypeError):
    """A keyword argument that does not exist.

    As Python's own error of this kind it is a TypeError and says "unexpected keyword argument":
    TorchRL looks for that to find out what an environment takes. Gymnasium raises it anew with a
    message of its own.
    """


class SnapshotError(SoftGymError, ValueError):
    """A snapshot that does not belong to this environment, or none at all."""


class LifecycleError(SoftGymError, RuntimeError):
    """What cannot be done now: without an episode, after `close()`, where nothing drives actors."""


class UnavailableError(SoftGymError, ImportError):
    """What this machine lacks: a package, a library, a model, OpenGL, a free port."""


class StoreError(SoftGymError, OSError):
    """Files that are damaged, of other settings, there already or cannot be written."""


class SimulationError(SoftGymError, RuntimeError):
    """A simulation that does not come to rest, or whose processes end again and again."""


def check_name(argument: str, value: object, valid: Iterable[object]) -> None:
    """Raises `InvalidArgumentError` unless `value` is one of `valid`: names, or None."""
    valid = tuple(valid)
    if not isinstance(value, str | None) or value not in valid:
        raise InvalidArgumentError(argument, value, valid)


def check_count(argument: str, value: object, low: int, high: int | None = None) -> int:
    """`value` as int; `InvalidArgumentError` unless it is a whole number in low..high."""
    valid = f"a whole number, {low} or more" if high is None else f"a whole number in {low}..{high}"
    try:
        count = operator.index(value)  # type: ignore[arg-type]
    except TypeError:
        raise InvalidArgumentError(argument, value, valid) from None
    if isinstance(value, bool) or count < low or (high is not None and count > high):
        raise InvalidArgumentError(argument, value, valid)
    return count


def check_number(argument: str, value: float, **limits: float) -> None:
    """Raises `InvalidArgumentError` unless a number is within its limits.

    Args:
        argument: Name of the argument.
        value: The number; NaN is within no limits.
        **limits: `gt`, `ge`, `lt`, `le`, as of `operator`: what the number is compared with.
    """
    if not all(getattr(operator, name)(value, limit) for name, limit in limits.items()):
        valid = " and ".join(f"{_SIGNS[name]} {limit:g}" for name, limit in limits.items())
        raise InvalidArgumentError(argument, value, f"a number {valid}")


def check_image_size(argument: str, value: object, largest: int) -> tuple[int, int]:
    """`value` as (height, width); `InvalidArgumentError` unless both are in 1..largest [pixels]."""
    valid = f"(height, width), each in 1..{largest} pixels"
    if not isinstance(value, Sequence) or len(value) != 2:
        raise InvalidArgumentError(argument, value, valid)
    try:
        height, width = (check_count(argument, side, 1, largest) for side in value)
    except InvalidArgumentError:
        raise InvalidArgumentError(argument, value, valid) from None
    return height, width


def install_extra(extra: str) -> str:
    """What to do about the missing packages of an extra of this package."""
    return f"run `pip install '.[{extra}]'` in a checkout of softgym_mj"


def import_extra(module: str, name: str, extra: str) -> Any:
    """Imports a module of an extra.

    Args:
        module: to be imported.
        name: what people call it.
        extra: of this package, that brings it.

    Raises:
        UnavailableError: if it is missing; an ImportError, with the command that installs it.
    """
    try:
        return importlib.import_module(module)
    except ImportError as error:
        raise UnavailableError(f"{name} is missing: {install_extra(extra)}") from error
