"""Errors raised by softgym_mj, all subclasses of `SoftGymError`, and checks of arguments."""

import difflib
import importlib
import operator
from collections.abc import Iterable, Sequence
from typing import Any

_SHOWN = 200  # Maximum number of characters of a wrong value in a message.
_SIGNS = {"gt": ">", "ge": ">=", "lt": "<", "le": "<="}


class SoftGymError(Exception):
    """Base class of every error this package raises on purpose."""


class InvalidArgumentError(SoftGymError, ValueError):
    """Invalid argument, action, file or function.

    The message names the argument, its value and the valid choices.

    Args:
        argument: The whole message if it is the only one; otherwise the argument's name.
        value: Its value.
        valid: The valid choices: names, or a phrase.
    """

    def __init__(
        self,
        argument: "str | InvalidArgumentError",
        value: object = None,
        valid: Iterable[object] = (),
    ):
        # Pickle passes all three; Gymnasium's vector environments pass the error itself.
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
            return f"{argument}={shown} is not valid: expected {valid}."
        return f"{argument}={shown} is unknown{choices(value, valid)}"


def choices(value: object, valid: Iterable[object]) -> str:
    """Returns the end of a message: the choice most similar to `value`, if any, and all choices."""
    names = [repr(name) for name in valid]
    similar = difflib.get_close_matches(repr(value), names, n=1, cutoff=0.85)
    hint = f" (did you mean {similar[0]}?)" if similar else ""
    return f"{hint}; valid choices: {', '.join(names)}."


class UnexpectedArgumentError(SoftGymError, TypeError):
    """Keyword argument that does not exist.

    It is a TypeError with the words "unexpected keyword argument", as Python's own: TorchRL reads
    them to find out which arguments an environment has. Gymnasium raises it again with a message
    of its own.
    """


class SnapshotError(SoftGymError, ValueError):
    """Snapshot of another environment, or an object that is not a snapshot."""


class LifecycleError(SoftGymError, RuntimeError):
    """Call at the wrong time: before `reset`, after `close()`, or without anything to control."""


class Compiled:
    """Attribute of an entity that `after_compile` sets; reading it earlier is an error."""

    def __get__(self, entity: object, owner: type) -> Any:
        if entity is None:
            return self
        raise LifecycleError(
            f"this {owner.__name__} is not compiled: call compile() of its Arena, or make an "
            "environment"
        )


def set_by_compile() -> Any:
    """Returns a `Compiled`, of any type to a type checker."""
    return Compiled()


class UnavailableError(SoftGymError, ImportError):
    """Requirement that this machine lacks: a package, a library, a model, OpenGL, a free port."""


class StoreError(SoftGymError, OSError):
    """File that is damaged, belongs to other settings, exists already or cannot be written."""


class SimulationError(SoftGymError, RuntimeError):
    """Simulation that diverges or does not come to rest, or whose processes end repeatedly."""


def check_name(argument: str, value: object, valid: Iterable[object]) -> None:
    """Raises `InvalidArgumentError` unless `value` is one of `valid`: names, or None."""
    valid = tuple(valid)
    if not isinstance(value, str | None) or value not in valid:
        raise InvalidArgumentError(argument, value, valid)


def check_count(argument: str, value: object, low: int, high: int | None = None) -> int:
    """Returns `value` as int; `InvalidArgumentError` unless it is an integer in low..high."""
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
        value: The number; NaN violates every limit.
        **limits: `gt`, `ge`, `lt` or `le` (functions of `operator`) and their bounds.
    """
    if not all(getattr(operator, name)(value, limit) for name, limit in limits.items()):
        valid = " and ".join(f"{_SIGNS[name]} {limit:g}" for name, limit in limits.items())
        raise InvalidArgumentError(argument, value, f"a number {valid}")


def cpu_only(what: str) -> InvalidArgumentError:
    """Returns the error for what batches do not support, such as "actor='franka'"."""
    return InvalidArgumentError(
        f"{what} is not available with device='host' or 'cuda': use device='cpu'"
    )


def check_image_size(argument: str, value: object, largest: int) -> tuple[int, int]:
    """Returns `value` as (height, width); both must be in 1..largest [pixels].

    Raises:
        InvalidArgumentError: otherwise.
    """
    valid = f"(height, width), each in 1..{largest} pixels"
    if not isinstance(value, Sequence) or len(value) != 2:
        raise InvalidArgumentError(argument, value, valid)
    try:
        height, width = (check_count(argument, side, 1, largest) for side in value)
    except InvalidArgumentError:
        raise InvalidArgumentError(argument, value, valid) from None
    return height, width


def install_extra(extra: str) -> str:
    """Returns the instruction that installs an extra of this package: in a clone, of a wheel."""
    return (
        f"run `pip install '.[{extra}]'` in a clone of softgym_mj, or for a wheel "
        f"`pip install 'softgym_mj[{extra}] @ file:///PATH/OF/THE/WHEEL.whl'`"
    )


def import_extra(module: str, name: str, extra: str) -> Any:
    """Imports a module of an extra.

    Args:
        module: Name of the module.
        name: Name of the package in messages.
        extra: Extra of this package that installs it.

    Raises:
        UnavailableError: if it is missing; the message has the command that installs it.
    """
    try:
        imported = importlib.import_module(module)
        if getattr(imported, "__file__", "") is None:
            raise ImportError(f"{module} is a folder without __init__.py: {[*imported.__path__]}")
    except ImportError as error:
        raise UnavailableError(f"{name} is missing: {install_extra(extra)}") from error
    return imported
