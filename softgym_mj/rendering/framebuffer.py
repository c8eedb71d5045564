"""`SizedPhysics`: physics with an off-screen buffer as large as its largest image."""

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

# MuJoCo's warnings that a number of the state, or of a control, is not finite, or huge.
_BAD = mujoco.mjtWarning.mjWARN_BADQPOS, mujoco.mjtWarning.mjWARN_BADCTRL
_DIVERGENCE = range(_BAD[0], _BAD[1] + 1)
_ABANDONED: list[base.ContextBase] = []  # Kept, as dm_control knows contexts by their id.


class _BoundToThread:
    """OpenGL context that its own thread frees; elsewhere it stays until the process ends.

    OpenGL lets no other thread free what a thread uses.
    """

    def __init__(self, *args, **kwargs):
        self._thread = threading.current_thread()
        super().__init__(*args, **kwargs)

    @property
    def is_elsewhere(self) -> bool:
        """Whether another thread has made it, and has to free it; GLFW has a thread of its own."""
        kind = executor.PassthroughRenderExecutor
        own = threading.current_thread() is self._thread
        return not own and isinstance(self._render_executor, kind)  # type: ignore[attr-defined]

    def _free_unconditionally(self) -> None:
        if self.is_elsewhere:
            _ABANDONED.append(self)
        else:
            super()._free_unconditionally()  # type: ignore[misc]


@functools.cache
def _bound(renderer: Callable[..., Any]) -> Callable[..., Any]:
    """A kind of OpenGL context that only its own thread frees."""
    if not isinstance(renderer, type):  # Without a backend, a function that raises the error.
        return renderer
    return type(renderer.__name__, (_BoundToThread, renderer), {})


class _MjrContext(wrapper.MjrContext):
    """MuJoCo's part of an OpenGL context, which is freed with it."""

    def free(self) -> None:
        """Frees it, unless another thread would have to."""
        if self._gl_context and not self._gl_context.is_elsewhere:
            super().free()


class SizedPhysics(mjcf.Physics):
    """Physics that renders into a buffer which grows with what is asked for.

    The largest one takes 100 MB of memory, with its samples; images of 128 x 128 pixels take 1 MB.
    """

    _size = (0, 0)  # (height, width) of the buffer [pixels].
    # The OpenGL context, which takes a tenth of a second to make, and the thread that uses it.
    _gl: base.ContextBase | None = None
    _thread = 0
    _diverged = False
    _divergences: np.ndarray | None = (
        None  # A view of how often MuJoCo has warned of `_DIVERGENCE`.
    )

    def step(self, nstep: int = 1) -> None:
        """Steps the simulation; only warnings of divergence are errors, others are counted.

        The base class takes longer to look for new warnings than a rope's step.

        Raises:
            PhysicsError: if the simulation diverges.
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
        """The OpenGL contexts, with the buffer as large as the model says.

        dm_control's own cameras ask for them and do not say what for.
        """
        largest = self.model.vis.global_
        return self.contexts_for(largest.offheight, largest.offwidth)

    def contexts_for(self, height: int, width: int) -> engine.Contexts:
        """The OpenGL contexts, with room for images of height x width pixels."""
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
        """Frees what is held, but for the OpenGL context, which the successor takes over.

        That is so within a thread: no other one may work with it.
        """
        if self._thread == threading.get_ident():
            successor._gl, successor._thread, self._gl = self._gl, self._thread, None
        self.free()

    def free(self) -> None:
        """Frees what is held; the physics must not be used any more."""
        super().free()
        if self._gl is not None:
            self._gl.decrement_refcount()
            self._gl.free()
            self._gl = None


class SizedView:
    """What a camera of dm_control's asks physics for, with room for its own images only."""

    def __init__(self, physics: SizedPhysics, height: int, width: int):
        self._physics, self._height, self._width = physics, height, width
        self.model, self.data = physics.model, physics.data

    @property
    def contexts(self) -> engine.Contexts:
        """The OpenGL contexts."""
        return self._physics.contexts_for(self._height, self._width)
