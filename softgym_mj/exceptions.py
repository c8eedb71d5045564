"""Errors raised by softgym_mj: one tree, messages that say what would have worked."""

import importlib
import operator
from collections.abc import Iterable, Sequence
from typing import Any


class SoftGymError(Exception):
    """Base class of every error this package raises on purpose."""


class UnknownNameError(SoftGymError, ValueError):
    """A name (task, actor, observation, fidelity, split, ...) that does not exist."""

    def __init__(
        self, argument: "str | UnknownNameError", value: object = None, valid: Iterable[object] = ()
    ):
        # Pickle makes it anew from all three, Gymnasium's vector environments from its predecessor.
        if isinstance(argument, UnknownNameError):
            argument, value, valid = argument.args
        super().__init__(argument, value, tuple(valid))

    def __str__(self):
        argument, value, valid = self.args
        choices = ", ".join(repr(name) for name in valid)
        return f"{argument}={value!r} is unknown; valid choices: {choices}."


class TaskModuleError(SoftGymError, ImportError):
    """A module named in "module:task" that cannot be imported or registers no task."""


class ExpertError(SoftGymError, ValueError):
    """A task without a scripted expert, or an expert that stops before the episode does."""


class DatasetExistsError(SoftGymError, FileExistsError):
    """An id under which a dataset has been recorded already."""


class UnexpectedArgumentError(SoftGymError, TypeError):
    """A keyword argument that does not exist.

    As Python's own error of this kind it is a TypeError and says "unexpected keyword argument":
    TorchRL looks for that to find out what an environment takes. Gymnasium raises it anew with a
    message of its own.
    """


class OutOfRangeError(SoftGymError, ValueError):
    """A number outside its documented range."""

    def __init__(self, argument: "str | OutOfRangeError", value: object = None, valid: str = ""):
        if isinstance(argument, OutOfRangeError):  # As above.
            argument, value, valid = argument.args
        super().__init__(argument, value, valid)

    def __str__(self):
        argument, value, valid = self.args
        return f"{argument}={value!r} is out of range; valid: {valid}."


class InvalidActionError(SoftGymError, ValueError):
    """An action with a wrong shape, a non-finite entry or an entry outside [-1, 1]."""


class EpisodeEndedError(SoftGymError, RuntimeError):
    """A step or a question without a running episode: call `reset()` first."""


class UndrivenError(SoftGymError, RuntimeError):
    """A task is stepped by an environment that does not pass actions on to its actor."""


class EnvironmentClosedError(SoftGymError, RuntimeError):
    """A Gymnasium environment that is used after `close()`: make a new one."""


class SettlingError(SoftGymError, RuntimeError):
    """A generated initial state did not come to rest."""


class MeshError(SoftGymError, ValueError):
    """A file that is missing, is no mesh or has a mesh that cannot be a sheet."""


class CorruptStoreError(SoftGymError, RuntimeError):
    """A stored initial state that is truncated, altered or of another specification."""


class MissingExtraError(SoftGymError, ImportError):
    """A package that only some commands need and that is not installed."""


class CacheUnavailableError(SoftGymError, OSError):
    """The folder for generated initial states cannot be written."""


class NotCopyableError(SoftGymError, TypeError):
    """What can be neither copied nor pickled, as it lives in processes of its own."""


class SnapshotError(SoftGymError, ValueError):
    """A snapshot that does not belong to this environment, or none at all."""


class RenderingUnavailableError(SoftGymError, RuntimeError):
    """No working OpenGL backend for off-screen rendering or no display for the viewer."""


class AddressUnavailableError(SoftGymError, OSError):
    """An address or port at which nothing can listen: taken, not ours or not allowed."""


class WorkersLostError(SoftGymError, RuntimeError):
    """Worker processes that end again and again before they have done anything."""


class PolicyFileError(SoftGymError, ValueError):
    """A file or function that is not a policy."""


class ResultError(SoftGymError, ValueError):
    """Results that are damaged, of another protocol or of another configuration."""


class PluginUnavailableError(SoftGymError, RuntimeError):
    """The library with the MuJoCo plugins is missing, broken or built for another MuJoCo."""


class ModelUnavailableError(SoftGymError, RuntimeError):
    """A model of MuJoCo Menagerie that cannot be had, or is not that of our arm."""


def check_name(argument: str, value: object, valid: Iterable[object]) -> None:
    """Raises `UnknownNameError` unless `value` is one of `valid`."""
    valid = tuple(valid)
    if value not in valid:
        raise UnknownNameError(argument, value, valid)


def check_count(argument: str, value: object, low: int, high: int | None = None) -> int:
    """`value` as int; `OutOfRangeError` unless it is a whole number in low..high."""
    valid = f"a whole number, {low} or more" if high is None else f"a whole number in {low}..{high}"
    try:
        count = operator.index(value)  # type: ignore[arg-type]
    except TypeError:
        raise OutOfRangeError(argument, value, valid) from None
    if isinstance(value, bool) or count < low or (high is not None and count > high):
        raise OutOfRangeError(argument, value, valid)
    return count


def check_image_size(argument: str, value: object, largest: int) -> tuple[int, int]:
    """`value` as (height, width); `OutOfRangeError` unless both are in 1..largest [pixels]."""
    valid = f"(height, width), each in 1..{largest} pixels"
    if not isinstance(value, Sequence) or len(value) != 2:
        raise OutOfRangeError(argument, value, valid)
    try:
        height, width = (check_count(argument, side, 1, largest) for side in value)
    except OutOfRangeError:
        raise OutOfRangeError(argument, value, valid) from None
    return height, width


def import_extra(module: str, name: str, extra: str) -> Any:
    """Imports a module of an extra.

    Args:
        module: to be imported.
        name: what people call it.
        extra: of this package, that brings it.

    Raises:
        MissingExtraError: if it is missing; an ImportError, with the command that installs it.
    """
    try:
        return importlib.import_module(module)
    except ImportError as error:
        raise MissingExtraError(
            f"{name} is missing: install it with `pip install 'softgym_mj[{extra}]'`"
        ) from error
