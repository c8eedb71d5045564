"""Loads OpenGL with the first image: environments with state observations do not need it.

dm_control and MuJoCo open the library of `MUJOCO_GL` when they are imported. Mesa's software
renderer brings an LLVM, and a triton (PyTorch's compiler) that is loaded later binds to its
symbols: the process ends with a segmentation fault. The other order works. A program that imports
dm_control before softgym_mj has chosen the fatal one: images work then, `import triton` does not.
"""

import contextlib
import ctypes
import functools
import importlib
import importlib.util
import os
import pathlib
import sys
from collections.abc import Callable, Iterator
from types import ModuleType
from typing import Any

# Modules that choose a backend when they are executed, and their classes of contexts.
_MUJOCO = "mujoco.rendering.classic.gl_context"
_CONTEXTS = {"dm_control._render": "Renderer", _MUJOCO: "GLContext"}
_VARIABLE = "MUJOCO_GL"
_OFF_SCREEN = "egl", "osmesa"  # Its values that need no display.


@functools.cache
def load_triton_first() -> None:
    """Loads the library of triton, if installed; call it before OpenGL is loaded.

    It takes 0.13 s, which a later `import triton` saves.
    """
    if sys.platform != "linux" or "triton" in sys.modules:
        return
    if "libLLVM" in pathlib.Path("/proc/self/maps").read_text():
        return  # OpenGL was first: loading triton now would end the process.
    spec = importlib.util.find_spec("triton")
    for folder in (spec and spec.submodule_search_locations) or ():
        for library in sorted((pathlib.Path(folder) / "_C").glob("libtriton*.so")):
            with contextlib.suppress(OSError):  # `import triton` then raises the error.
                ctypes.CDLL(str(library))


def defer() -> None:
    """Imports dm_control's and MuJoCo's renderers so that their first use loads OpenGL.

    Without MUJOCO_GL, a module that was imported earlier has chosen GLFW, which needs a display; it
    is replaced where the variable now names another backend. Otherwise it keeps its backend.
    """
    chosen = os.environ.get(_VARIABLE)
    if chosen in _OFF_SCREEN:  # The first import of PyOpenGL chooses its platform.
        os.environ.setdefault("PYOPENGL_PLATFORM", chosen)
    if sys.platform != "linux":
        return
    names = [name for name in _CONTEXTS if not _has_backend(name, chosen)]
    with _without_backend():
        modules = [importlib.import_module(name) for name in names]
    for module in modules:
        _Deferred(module)
    if _MUJOCO in names:  # MuJoCo's package has copied the names of that module.
        sys.modules["mujoco"].GLContext = sys.modules[_MUJOCO].GLContext  # type: ignore[attr-defined]


def _has_backend(name: str, chosen: str | None) -> bool:
    """Returns whether a module of `_CONTEXTS` is imported with a backend that it can keep."""
    if name not in sys.modules:
        return False
    context = getattr(sys.modules[name], _CONTEXTS[name], None)  # Of a module such as mujoco.egl.
    return chosen not in _OFF_SCREEN or chosen in getattr(context, "__module__", "")


@contextlib.contextmanager
def _without_backend() -> Iterator[None]:
    chosen = os.environ.get(_VARIABLE)
    os.environ[_VARIABLE] = "disable"
    try:
        yield
    finally:
        del os.environ[_VARIABLE]
        if chosen is not None:
            os.environ[_VARIABLE] = chosen


def context_class(module: ModuleType) -> Callable[..., Any]:
    """Loads OpenGL; returns the class of contexts of a module of `_CONTEXTS`."""
    load_triton_first()
    found = getattr(module, _CONTEXTS[module.__name__])
    return found.load() if isinstance(found, _Deferred) else found


class _Deferred:
    """Placeholder for a module's class of contexts until OpenGL is loaded."""

    def __init__(self, module: ModuleType):
        self._module = module
        setattr(module, _CONTEXTS[module.__name__], self)

    def load(self) -> Callable[..., Any]:
        """Loads the class and replaces this object by it."""
        name = _CONTEXTS[self._module.__name__]
        if getattr(self._module, name) is self:
            try:
                importlib.reload(self._module)
            except BaseException:
                setattr(self._module, name, self)  # The next call raises the error again.
                raise
        return getattr(self._module, name)

    def __call__(self, *args: Any, **kwargs: Any) -> Any:
        load_triton_first()
        return self.load()(*args, **kwargs)
