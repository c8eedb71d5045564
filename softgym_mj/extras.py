"""Packages that only some commands need: the extras of this one."""

import importlib
from typing import Any


def import_extra(module: str, name: str, extra: str) -> Any:
    """Imports a module of an extra.

    Args:
        module: to be imported.
        name: what people call it.
        extra: of this package, that brings it.

    Raises:
        ImportError: if it is missing, with the command that installs it.
    """
    try:
        return importlib.import_module(module)
    except ImportError as error:
        raise ImportError(
            f"{name} is missing: install it with `pip install 'softgym_mj[{extra}]'`"
        ) from error
