"""Off-screen rendering: the choice of an OpenGL backend, and cached camera views."""

import ctypes.util
import os
import sys
from typing import Any

import numpy as np

from softgym_mj.exceptions import RenderingUnavailableError, check_image_size

INSTALL_COMMAND = "apt-get install -y libegl1 libgl1-mesa-dri"

LARGEST_IMAGE = 1280  # Side of the off-screen buffer in arena.xml [pixels].

_MAX_GEOMS = 20000  # In a scene: the surface of water is drawn as some thousand triangles.

# The flex is drawn by its skins (group 0); its own triangles and sites stay hidden.
_FLEX_GROUP = 4


def has_display() -> bool:
    """Whether a window can be opened."""
    if sys.platform != "linux":
        return True
    return bool(os.environ.get("DISPLAY") or os.environ.get("WAYLAND_DISPLAY"))


def choose_backend() -> None:
    """Sets MUJOCO_GL on a machine without display; a value that is already set is kept.

    To be called before dm_control is imported: it reads the variable only then.
    """
    if "MUJOCO_GL" in os.environ or has_display():
        return
    if ctypes.util.find_library("EGL"):
        os.environ["MUJOCO_GL"] = "egl"
    elif ctypes.util.find_library("OSMesa"):
        os.environ["MUJOCO_GL"] = "osmesa"
    else:
        # States still work; a render then says what to install.
        os.environ["MUJOCO_GL"] = "disable"


def unavailable(reason: object) -> RenderingUnavailableError:
    """The error for a rendering that failed, with the command that helps."""
    return RenderingUnavailableError(
        f"off-screen rendering failed with MUJOCO_GL={os.environ.get('MUJOCO_GL', '')!r}: "
        f"{reason}. Install software OpenGL with `{INSTALL_COMMAND}`, unset MUJOCO_GL (or set it "
        "to egl, osmesa or glfw) and start Python again."
    )


def refresh_poses(physics) -> None:
    """Computes what is drawn from qpos: `mj_step` leaves it one step behind."""
    import mujoco

    model, data = physics.model.ptr, physics.data.ptr
    mujoco.mj_kinematics(model, data)
    mujoco.mj_comPos(model, data)
    mujoco.mj_camlight(model, data)
    mujoco.mj_flex(model, data)


class CameraView:
    """Renders one camera at one size; the scene is kept until the physics changes."""

    def __init__(self, camera: str, height: int, width: int):
        self._camera = camera
        self._height, self._width = check_image_size("size", (height, width), LARGEST_IMAGE)
        self._data: Any = None
        self._view: Any = None
        self._option: Any = None

    def rgb(self, physics) -> np.ndarray:
        """Image (height, width, 3) uint8."""
        return self._render(physics).copy()

    def depth(self, physics) -> np.ndarray:
        """Metric distance along the view direction (height, width) float32 [m]."""
        return self._render(physics, depth=True).astype(np.float32)

    def segmentation(self, physics) -> np.ndarray:
        """What each pixel shows (height, width, 2) int: id and `mujoco.mjtObj`; -1 for nothing."""
        return self._render(physics, segmentation=True).copy()

    def _render(self, physics, **options) -> np.ndarray:
        import mujoco
        from dm_control.mujoco import engine, wrapper

        data = physics.data.ptr
        refresh_poses(physics)
        try:
            if self._data is not data:
                self._view = engine.Camera(
                    physics, self._height, self._width, self._camera, max_geom=_MAX_GEOMS
                )
                self._option = wrapper.MjvOption()
                self._option.flexgroup[_FLEX_GROUP] = 0
                self._data = data
            return self._view.render(scene_option=self._option, **options)
        except (RuntimeError, ImportError, OSError, mujoco.FatalError) as error:
            raise unavailable(error) from error
