"""Off-screen rendering: OpenGL backend, cached camera views and videos."""

import base64
import ctypes.util
import dataclasses
import os
import pathlib
import subprocess
import sys
import tempfile
from collections.abc import Callable
from typing import TYPE_CHECKING, Any

import numpy as np

from softgym_mj.exceptions import (
    InvalidArgumentError,
    UnavailableError,
    check_count,
    check_image_size,
    check_name,
)
from softgym_mj.rendering.calibration import Calibration
from softgym_mj.storage.files import whole, write_whole

if TYPE_CHECKING:
    from softgym_mj.rendering.drawing import SceneCamera

MOST_PASSES = 1024  # Largest number of passes of an image.
LARGEST_IMAGE = 1280  # Side of the off-screen buffer in arena.xml [pixels].
_OTHER_THREAD = "already current on another thread"  # Part of dm_control's error message.
_rendered_in: int | None = None  # Process id; a fork inherits it, but not OpenGL's threads.
_CRF = 10  # H.264 quality of videos, 51 (worst) to 0; at 10 no blocks are visible on cloth.
_PRESET = "veryfast"  # Half the time of the default, for 0.8 dB less at 46 dB.
_BLOCK = 8  # Sides of videos are multiples of this [pixels]; others are scaled to the next one.
_LIBRARIES = {"egl": "EGL", "osmesa": "OSMesa"}  # Values of MUJOCO_GL by preference.
# Their Debian packages.
_PACKAGES = {"egl": "libegl1 libgl1-mesa-dri libopengl0", "osmesa": "libosmesa6"}
SHOWN_SITES = 3  # Groups of sites below this number are rendered, as by MuJoCo's defaults.
GLASS_GROUP = 1  # Group of translucent geoms, hidden to show what is behind them.


def _remedy(backend: str) -> str:
    """Returns advice for a value of MUJOCO_GL that does not work."""
    if backend == "disable" and any(map(ctypes.util.find_library, _LIBRARIES.values())):
        return "Unset MUJOCO_GL and start Python again."
    packages = _PACKAGES.get(backend, _PACKAGES["egl"])
    result = (
        f"Install software OpenGL with `apt-get install -y {packages}`, unset MUJOCO_GL (or set "
    )
    return f"{result}it to another of egl, osmesa and glfw) and start Python again."


def has_display() -> bool:
    """Whether a display is available."""
    return sys.platform != "linux" or any(map(os.environ.get, ("DISPLAY", "WAYLAND_DISPLAY")))


def choose_backend() -> None:
    """Sets MUJOCO_GL on a machine without display unless it is already set.

    Call it before importing dm_control, which reads the variable at import.

    Raises:
        UnavailableError: If the library of that value is missing, which dm_control imports.
    """
    chosen = os.environ.get("MUJOCO_GL")
    if chosen in _LIBRARIES and not ctypes.util.find_library(_LIBRARIES[chosen]):
        raise UnavailableError(
            f"MUJOCO_GL={chosen!r}, and lib{_LIBRARIES[chosen]} is missing. {_remedy(chosen)}"
        )
    if chosen is None and not has_display():
        found = (name for name, file in _LIBRARIES.items() if ctypes.util.find_library(file))
        # States still work without; a render then says what to install.
        os.environ["MUJOCO_GL"] = next(found, "disable")


def _claim() -> None:
    """Records that this process renders.

    Raises:
        UnavailableError: If it was forked from a process that has rendered: OpenGL would deadlock.
    """
    global _rendered_in  # noqa: PLW0603 - a fact about the process.
    if _rendered_in not in (None, os.getpid()):
        raise UnavailableError(
            "this process was forked from one that has rendered, and OpenGL does not survive a "
            'fork: start processes with the method "forkserver" or "spawn", for example '
            'gymnasium.make_vec(..., vectorization_mode="async", '
            'vector_kwargs={"context": "forkserver"})'
        )
    _rendered_in = os.getpid()


def refresh_poses(physics) -> None:
    """Updates poses for rendering from qpos: `mj_step` leaves them one step behind."""
    refresh(physics.model.ptr, physics.data.ptr)


def refresh(model, data) -> None:
    """Updates poses for rendering of an MjModel and its MjData, as `refresh_poses`."""
    import mujoco

    mujoco.mj_kinematics(model, data)
    mujoco.mj_comPos(model, data)
    mujoco.mj_camlight(model, data)
    mujoco.mj_flex(model, data)


def camera_ids(model) -> dict[str, int]:
    """Returns camera ids of an MjModel by name, such as "task" or "arms/franka_0/wrist_0".

    A camera can also be named by the last part alone, "wrist_0", where that is unique; these names
    come first.
    """
    names = [model.camera(i).name for i in range(model.ncam)]
    ends = [name.rsplit("/", 1)[-1] for name in names]
    short = {end: i for i, end in enumerate(ends) if ends.count(end) == 1}
    return {**short, **{name: i for i, name in enumerate(names)}}


class CameraView:
    """Renders one camera at one size; the scene is cached until the physics changes.

    Attributes:
        camera: Name of the camera.
        size: (height, width) of images [pixels].
        marks: Whether images show goal marks, which are sites.
    """

    def __init__(
        self,
        camera: str,
        height: int,
        width: int,
        passes: int | None = None,
        *,
        marks: bool = True,
        glass: bool = True,
        still: float | None = None,
    ):
        """Chooses the camera.

        Args:
            camera: Name as in `camera_ids`; rendering raises `InvalidArgumentError` if there is
                none.
            height, width: Size of images, each in 1..`LARGEST_IMAGE` [pixels].
            passes: Averaged passes of a color image, 1..`MOST_PASSES`; None means the number of
                the look.
            marks: Whether images show sites, which mark goals; image observations show them with
                `goal_marks=True` only.
            glass: Whether images show the walls of cups.
            still: Motion [m] up to which `rgb` repeats the last image; None renders always.

        Raises:
            InvalidArgumentError: If a size or number is out of range.
        """
        if passes is not None:
            check_count("passes", passes, 1, MOST_PASSES)
        self.camera, self._passes = camera, passes
        self.marks, self._glass, self._still = marks, glass, still
        self.size = check_image_size("size", (height, width), LARGEST_IMAGE)
        self._data: Any = None
        self._view: Any = None

    def rgb(self, physics) -> np.ndarray:
        """Renders an image (height, width, 3) uint8."""
        return self._render(physics, lambda view: view.colors(self._passes, self._still).copy())

    def depth(self, physics) -> np.ndarray:
        """Renders the depth along the view direction (height, width) float32 [m]."""
        return self.surfaces(physics)[1]

    def segmentation(self, physics) -> np.ndarray:
        """Renders segmentation (height, width, 2) int: id and `mujoco.mjtObj`, -1 for nothing."""
        return self.surfaces(physics)[0]

    def surfaces(self, physics) -> tuple[np.ndarray, np.ndarray]:
        """Renders `segmentation` and `depth` in one pass, so that they agree at every edge."""
        return self._surfaces(physics)

    def _surfaces(self, physics, marks: bool | None = None) -> tuple[np.ndarray, np.ndarray]:
        """Renders `surfaces` with or without marks; None means the attribute `marks`."""
        shown, depth = self._render(physics, lambda view: view.surfaces(), marks)
        return shown.copy(), depth.astype(np.float32)

    def calibration(self, physics) -> Calibration:
        """Returns the current pose and projection of the camera for these images."""
        refresh_poses(physics)
        model, data = physics.model.ptr, physics.data.ptr
        return Calibration.of(model, data, self._number(model), *self.size)

    def _number(self, model) -> int:
        cameras = camera_ids(model)
        check_name("camera", self.camera, cameras)
        return cameras[self.camera]

    def _render(
        self, physics, draw: "Callable[[SceneCamera], Any]", marks: bool | None = None
    ) -> Any:
        import mujoco

        from softgym_mj.rendering.drawing import SceneCamera
        from softgym_mj.rendering.framebuffer import SizedPhysics, SizedView

        _claim()
        data = physics.data.ptr
        refresh_poses(physics)
        camera = self._number(physics.model.ptr)
        try:
            if self._data is not data:
                sized = isinstance(physics, SizedPhysics)
                seen = SizedView(physics, *self.size) if sized else physics
                self._view = SceneCamera(seen, *self.size, camera)
                self._view.option.geomgroup[GLASS_GROUP] = self._glass
                self._data = data
            self._view.option.sitegroup[:SHOWN_SITES] = self.marks if marks is None else marks
            return draw(self._view)
        except (
            RuntimeError,
            ImportError,
            OSError,
            ctypes.ArgumentError,  # By PyOpenGL, where libOpenGL is missing.
            mujoco.FatalError,
        ) as error:
            if "KeyboardInterrupt" in str(error):  # ctypes turns it into ArgumentError.
                raise
            if _OTHER_THREAD in str(error):
                raise UnavailableError(
                    "this environment has rendered in another thread, and OpenGL is tied to it: "
                    "render, reset and step it in that thread only, or make one in each thread"
                ) from error
            backend = os.environ.get("MUJOCO_GL", "")
            reason = "" if backend == "disable" else f" ({str(error).rstrip('.')})"
            raise UnavailableError(
                f"off-screen rendering failed with MUJOCO_GL={backend!r}{reason}. "
                f"{_remedy(backend)}"
            ) from error


def write_picture(picture: np.ndarray, file: pathlib.Path) -> None:
    """Writes an image (height, width, 3) uint8 as a PNG, atomically; creates its folder.

    Raises:
        StoreError: If it cannot be written.
    """
    import imageio.v3 as imageio

    write_whole(file, imageio.imwrite("<bytes>", picture, extension=".png"))


@dataclasses.dataclass(frozen=True)
class Video:
    """Video, which a notebook shows inline.

    Attributes:
        frames: Frames (n, height, width, 3) uint8, n at least 1.
        fps: Frames per second.

    Raises:
        InvalidArgumentError: If the frames have another shape or type, or there are none.
    """

    frames: np.ndarray = dataclasses.field(repr=False)
    fps: float

    def __post_init__(self):
        frames = np.asarray(self.frames)
        if frames.ndim != 4 or frames.shape[-1] != 3 or frames.dtype != np.uint8 or not len(frames):
            raise InvalidArgumentError(
                "frames", f"{frames.dtype}{frames.shape}", "uint8(n, height, width, 3), n >= 1"
            )
        object.__setattr__(self, "frames", frames)

    def write(self, file: pathlib.Path | str) -> None:
        """Writes `file.mp4` (H.264) atomically; creates its folder.

        Raises:
            StoreError: If it cannot be written.
        """
        with whole(pathlib.Path(file)) as partial:
            self._encode(partial)

    def _encode(self, file: pathlib.Path) -> None:
        """Writes an mp4 file; imageio's own writer ignores a full disk."""
        import imageio_ffmpeg

        height, width = self.frames.shape[1:3]
        sides = (-(-side // _BLOCK) * _BLOCK for side in (width, height))
        command = [imageio_ffmpeg.get_ffmpeg_exe(), "-v", "error"]
        command += f"-f rawvideo -pix_fmt rgb24 -s {width}x{height} -r {self.fps} -i -".split()
        command += f"-vf scale={':'.join(map(str, sides))} -f mp4 -c:v libx264".split()
        command += f"-pix_fmt yuv420p -crf {_CRF} -preset {_PRESET}".split()
        done = subprocess.run(
            [*command, "-y", file], input=self.frames.tobytes(), capture_output=True, check=False
        )
        if done.returncode:
            ended = f"ffmpeg ended with status {done.returncode}"
            raise OSError([ended, *done.stderr.decode(errors="replace").splitlines()][-1])

    def _repr_html_(self) -> str:
        with tempfile.TemporaryDirectory() as folder:
            self._encode(file := pathlib.Path(folder) / "video.mp4")
            data = base64.b64encode(file.read_bytes()).decode()
        height, width = self.frames.shape[1:3]
        return (
            f'<video controls autoplay loop muted playsinline width="{width}" height="{height}" '
            f'src="data:video/mp4;base64,{data}"></video>'
        )
