"""Loads the library with the engine plugins into MuJoCo."""

import ctypes
import functools
import importlib.metadata
import pathlib
import sys
import threading

from softgym_mj.exceptions import UnavailableError

FLUID = "softgym_mj.fluid"
CLOTH = "softgym_mj.cloth"

_FOLDER = pathlib.Path(__file__).parent
# Prefix of the library's name; the MuJoCo version that it was built for follows.
_STEM = "softgym_mj_plugins-mujoco-"
_SUFFIX = {"win32": ".dll"}.get(sys.platform, ".so")

_USER = f'<mujoco><extension><plugin plugin="{CLOTH}"/></extension></mujoco>'

_lock = threading.Lock()


def _is_registered() -> bool:
    """Whether the plugins are registered in MuJoCo, from any file."""
    import mujoco

    try:
        mujoco.MjSpec.from_string(_USER)
    except ValueError:
        return False
    return True


def _find(version: str) -> pathlib.Path:
    """Returns the path of the library for a MuJoCo version."""
    file = _FOLDER / f"{_STEM}{version}{_SUFFIX}"
    if file.exists():
        return file
    others = [f.name.removeprefix(_STEM).removesuffix(_SUFFIX) for f in _FOLDER.glob(f"{_STEM}*")]
    if others:
        raise UnavailableError(
            f"the engine plugins were built for MuJoCo {', '.join(sorted(others))}, but {version} "
            f"is installed. Run `pip install mujoco=={others[0]}`, or install softgym_mj again."
        )
    raise UnavailableError(
        f"the engine plugins are not built: {file} does not exist. Install softgym_mj from a "
        "wheel, or install a compiler (`apt-get install -y g++ cmake make`) and run "
        "`pip install .` again."
    )


def check_release() -> None:
    """Raises `UnavailableError` if the plugins were not built for the installed MuJoCo release.

    It does not import MuJoCo, because dm_control cannot be imported with every release.
    """
    if any(_FOLDER.glob(f"{_STEM}*")):
        _find(importlib.metadata.version("mujoco"))


@functools.cache
def open_library() -> ctypes.CDLL:
    """Returns the library for its own functions; raises the errors of `load_plugin`."""
    return ctypes.CDLL(str(load_plugin()))


def load_plugin() -> pathlib.Path:
    """Registers the plugins in MuJoCo, once per process; returns the library's file.

    Call it before compiling a model that uses one. If a copy was loaded from elsewhere, that one
    stays: a second one would raise inside `dlopen` and leave its lock held.

    Raises:
        UnavailableError: If the library is missing, of another MuJoCo version or broken.
    """
    import mujoco

    with _lock:
        file = _find(mujoco.__version__)
        if not _is_registered():
            try:
                mujoco.mj_loadPluginLibrary(str(file))
            except mujoco.FatalError as error:
                raise UnavailableError(
                    f"MuJoCo could not load the engine plugins from {file}: {error}"
                ) from error
        return file
