"""Loads OpenGL with the first image: environments of states need none.

dm_control and MuJoCo open the library of `MUJOCO_GL` when they are imported. Mesa's software
renderer brings an LLVM whose symbols a triton (PyTorch's compiler) that is loaded later takes for
its own: the process then ends with a segmentation fault. The other order works.
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

# Modules that choose a backend when they are executed, and the classes that they then have.
_MUJOCO = "mujoco.rendering.classic.gl_context"
_CONTEXTS = {"dm_control._render": "Renderer", _MUJOCO: "GLContext"}
_VARIABLE = "MUJOCO_GL"


@functools.cache
def load_triton_first() -> None:
    """Loads the library of triton, if it is installed; to be called before OpenGL is loaded.

    It takes an eighth of a second; `import triton` finds it loaded.
    """
    if sys.platform != "linux" or "triton" in sys.modules:
        return
    spec = importlib.util.find_spec("triton")
    for folder in (spec and spec.submodule_search_locations) or ():
        for library in sorted((pathlib.Path(folder) / "_C").glob("libtriton*.so")):
            with contextlib.suppress(OSError):  # `import triton` then raises the error.
                ctypes.CDLL(str(library))


def defer() -> None:
    """Imports dm_control's and MuJoCo's renderers so that their first use loads OpenGL.

    What is imported already keeps the backend that it has loaded.
    """
    chosen = os.environ.get(_VARIABLE)
    if chosen in ("egl", "osmesa"):  # Whoever imports PyOpenGL first has it choose a platform.
        os.environ.setdefault("PYOPENGL_PLATFORM", chosen)
    if sys.platform != "linux":
        return
    names = [name for name in _CONTEXTS if name not in sys.modules]
    with _without_backend():
        modules = [importlib.import_module(name) for name in names]
    for module in modules:
        _Deferred(module)
    if _MUJOCO in names:  # MuJoCo's package has copied the names of that module.
        sys.modules["mujoco"].GLContext = sys.modules[_MUJOCO].GLContext  # type: ignore[attr-defined]


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
    """Returns what makes the contexts of a module of `_CONTEXTS`; loads OpenGL."""
    load_triton_first()
    found = getattr(module, _CONTEXTS[module.__name__])
    return found.load() if isinstance(found, _Deferred) else found


class _Deferred:
    """Stands for the class of contexts of a module until OpenGL is loaded."""

    def __init__(self, module: ModuleType):
        self._module = module
        setattr(module, _CONTEXTS[module.__name__], self)

    def load(self) -> Callable[..., Any]:
        """Returns the class, which takes the place of this object."""
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
