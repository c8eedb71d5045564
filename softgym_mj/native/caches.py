"""Folder of generated files."""

import os
import pathlib

CACHE_VARIABLE = "SOFTGYM_MJ_CACHE"
ADVICE = f"Set {CACHE_VARIABLE} to a writable folder with free space."


def cache_folder() -> pathlib.Path:
    """Returns the cache folder: $SOFTGYM_MJ_CACHE or ~/.cache/softgym_mj."""
    if chosen := os.environ.get(CACHE_VARIABLE):
        return pathlib.Path(chosen)
    root = os.environ.get("XDG_CACHE_HOME") or pathlib.Path.home() / ".cache"
    return pathlib.Path(root) / "softgym_mj"
