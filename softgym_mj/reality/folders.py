"""`no_recordings`: the error for a folder of recordings that is missing."""

import pathlib

from softgym_mj.exceptions import InvalidArgumentError


def no_recordings(folder: pathlib.Path | None, valid: str) -> InvalidArgumentError:
    """Returns the error for a folder without the recordings of `valid`; None is no folder."""
    if folder is None:
        return InvalidArgumentError(f"the argument `folder` is missing: expected {valid}.")
    return InvalidArgumentError("folder", str(folder), valid)
