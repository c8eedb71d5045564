"""Packages that only some commands need: the extras of this one."""

import importlib
from typing import Any

from softgym_mj.exceptions import MissingExtraError


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
