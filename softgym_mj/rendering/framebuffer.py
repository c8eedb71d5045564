"""`SizedPhysics`: physics whose off-screen buffer grows to its largest image."""

import functools
import threading
from collections.abc import Callable
from typing import Any

import mujoco
import numpy as np
from dm_control import _render, mjcf
from dm_control._render import base, executor
from dm_control.mujoco import engine, wrapper
from dm_control.rl import control

from softgym_mj.rendering import opengl

# MuJoCo's warnings about states or controls that are not finite or too large.
_BAD = mujoco.mjtWarning.mjWARN_BADQPOS, mujoco.mjtWarning.mjWARN_BADCTRL
_DIVERGENCE = range(_BAD[0], _BAD[1] + 1)
_ABANDONED: list[base.ContextBase] = []  # Keeps references: dm_control identifies contexts by `id`.


class _BoundToThread:
    """OpenGL context that only its own thread frees; otherwise it lives until the process ends.

    OpenGL does not allow other threads to free a context in use.
    """

    # At the end of a program, contexts may be freed after the globals of modules.
    _kind, _current = executor.PassthroughRenderExecutor, staticmethod(threading.current_thread)

    def __init__(self, *args, **kwargs):
        self._thread = self._current()
        super().__init__(*args, **kwargs)

    @property
    def is_elsewhere(self) -> bool:
        """Whether another thread made the context and must free it; GLFW has its own thread."""
        if self._current() is self._thread:
            return False
        return isinstance(self._render_executor, self._kind)  # type: ignore[attr-defined]

    def _free_unconditionally(self) -> None:
        if self.is_elsewhere:
            _ABANDONED.append(self)
        else:
            super()._free_unconditionally()  # type: ignore[misc]


@functools.cache
def _bound(renderer: Callable[..., Any]) -> Callable[..., Any]:
    """Derives a class of OpenGL contexts that only their own thread frees."""
    if not isinstance(renderer, type):  # Without a backend: a function that raises.
        return renderer
    return type(renderer.__name__, (_BoundToThread, renderer), {})


class _MjrContext(wrapper.MjrContext):
    """MuJoCo's rendering context, freed together with its OpenGL context."""

    _ptr: Callable[[], Any] | None = None  # Stays None if the constructor fails.

    def free(self) -> None:
        """Frees the context if it was made, unless another thread owns it."""
        if self._ptr and self._gl_context and not self._gl_context.is_elsewhere:
            super().free()


class SizedPhysics(mjcf.Physics):
    """Physics whose off-screen buffer grows with the requested image size.

    The largest buffer takes 100 MB with its samples; images of 128 x 128 pixels take 1 MB.
    """

    _size = (0, 0)  # (height, width) of the buffer [pixels].
    # The OpenGL context, which takes 0.1 s to create, and the thread that uses it.
    _gl: base.ContextBase | None = None
    _thread = 0
    _diverged = False
    _divergences: np.ndarray | None = (
        None  # A view of how often MuJoCo has warned of `_DIVERGENCE`.
    )

    def step(self, nstep: int = 1) -> None:
        """Steps the simulation; only warnings of divergence raise, others are counted.

        The base class takes longer to check for warnings than a step of a rope.

        Raises:
            PhysicsError: If the simulation diverges.
        """
        if self._divergences is None:
            first, last = _DIVERGENCE[0], _DIVERGENCE[-1]
            self._divergences = self.data.ptr.warning.number[first : last + 1]
        before = self._divergences.copy() if self._diverged else 0
        mujoco.mj_step(self.model.ptr, self.data.ptr, nstep)
        if np.count_nonzero(self._divergences):
            self._diverged = True
            new = np.flatnonzero(self._divergences > before)
            if len(new):
                names = [mujoco.mjtWarning(_DIVERGENCE[i]).name for i in new]
                raise control.PhysicsError(f"physics state is invalid: warnings {', '.join(names)}")

    @property
    def contexts(self) -> engine.Contexts:
        """OpenGL contexts with a buffer of the model's size, for dm_control's own cameras."""
        largest = self.model.vis.global_
        return self.contexts_for(largest.offheight, largest.offwidth)

    def contexts_for(self, height: int, width: int) -> engine.Contexts:
        """Returns OpenGL contexts with room for images of height x width pixels."""
        with self._contexts_lock:
            if self._contexts is None:
                self._make_contexts(height, width)
            elif height > self._size[0] or width > self._size[1]:
                self._grow(max(height, self._size[0]), max(width, self._size[1]))
        return self._contexts

    def _make_contexts(self, height: int, width: int) -> None:
        size = self.model.vis.global_
        largest = size.offheight, size.offwidth
        size.offheight, size.offwidth = height, width
        if self._gl is None:
            self._gl = _bound(opengl.context_class(_render))(width, height)
            self._thread = threading.get_ident()
            self._gl.increment_refcount()
        try:
            made = _MjrContext(self.model, self._gl)
        finally:
            size.offheight, size.offwidth = largest
        self._contexts = engine.Contexts(gl=self._gl, mujoco=made)
        self._size = height, width

    def _grow(self, height: int, width: int) -> None:
        with self._contexts.gl.make_current() as context:
            context.call(mujoco.mjr_resizeOffscreen, width, height, self._contexts.mujoco.ptr)
        self._size = height, width

    def free_for(self, successor: "SizedPhysics") -> None:
        """Frees resources except the OpenGL context, which a successor in this thread reuses."""
        if self._thread == threading.get_ident():
            successor._gl, successor._thread, self._gl = self._gl, self._thread, None
        self.free()

    def free(self) -> None:
        """Frees all resources; the physics must not be used afterwards."""
        super().free()
        if self._gl is not None:
            self._gl.decrement_refcount()
            self._gl.free()
            self._gl = None


class SizedView:
    """View of physics for a dm_control camera, with a buffer for its own image size only."""

    def __init__(self, physics: SizedPhysics, height: int, width: int):
        self._physics, self._height, self._width = physics, height, width
        self.model, self.data = physics.model, physics.data

    @property
    def contexts(self) -> engine.Contexts:
        """OpenGL contexts for this image size."""
        return self._physics.contexts_for(self._height, self._width)
