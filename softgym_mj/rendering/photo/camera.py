"""`PhotoCamera`: path-traced images of physics; stills and videos of environments."""

from collections.abc import Callable
from typing import Any

import mujoco
import numpy as np

from softgym_mj.exceptions import check_count, check_name, import_extra
from softgym_mj.rendering.offscreen import LARGEST_IMAGE, Video, camera_ids, refresh
from softgym_mj.rendering.photo.materials import pixels
from softgym_mj.rendering.photo.scene import Scene
from softgym_mj.validation import typed

EXTRA = "photo"
VARIANT = "scalar_rgb"  # Mitsuba's compiled variants need LLVM or a GPU.
SAMPLES = 64  # Samples per pixel; glass and water need 256.
DEPTH, CLEAR_DEPTH = 6, 16  # Path length, without and with glass, which has many surfaces.
_PASS = 8  # Samples between two calls of `on_sample`.
_LAYERS = "albedo:albedo,normal:sh_normal"  # Feature layers of the denoiser.


class PhotoCamera:
    """Path-traces the current state of physics without changing it."""

    @typed
    def __init__(
        self,
        camera: "str | mujoco.MjvCamera" = "task",
        size: int = 512,
        samples: int = SAMPLES,
        denoise: bool = True,
    ):
        """Loads Mitsuba and the denoiser.

        Args:
            camera: Name as in `camera_ids`, or a camera pose.
            size: Side of images, in 1..`LARGEST_IMAGE` [pixels].
            samples: Samples per pixel.
            denoise: Whether Open Image Denoise removes noise.

        Raises:
            InvalidArgumentError: If the size or the number of samples is out of range.
            UnavailableError: If Mitsuba or the denoiser is missing.
        """
        self._size = check_count("size", size, 1, LARGEST_IMAGE)
        self._samples = check_count("samples", samples, 1)
        self._camera = camera
        self._mi = import_extra("mitsuba", "Mitsuba", EXTRA)
        self._oidn = import_extra("pyoidn", "Open Image Denoise", EXTRA) if denoise else None
        if self._mi.variant() is None:
            self._mi.set_variant(VARIANT)
            self._mi.set_log_level(self._mi.LogLevel.Error)  # Suppresses warnings about samples.

    def rgb(
        self, physics: Any, on_sample: Callable[[int], object] = lambda number: None
    ) -> np.ndarray:
        """Renders an image (size, size, 3) uint8.

        Args:
            physics: Simulation to render.
            on_sample: Called with the number of samples done since the last call.

        Raises:
            InvalidArgumentError: If the model has no such camera.
        """
        model, data = physics.model.ptr, physics.data.ptr
        refresh(model, data)
        scene = Scene(self._mi, model, data, self._eye(model))
        light, albedo, normal = self._render(scene, on_sample)
        if self._oidn is not None:
            light = self._oidn.denoise(light, albedo=albedo, normal=normal, hdr=True)
        return pixels(light)

    def _eye(self, model: mujoco.MjModel) -> mujoco.MjvCamera:
        if isinstance(self._camera, mujoco.MjvCamera):
            return self._camera
        cameras = camera_ids(model)
        check_name("camera", self._camera, cameras)
        eye = mujoco.MjvCamera()
        eye.type, eye.fixedcamid = mujoco.mjtCamera.mjCAMERA_FIXED, cameras[self._camera]
        return eye

    def _render(self, scene: Scene, on_sample: Callable[[int], object]) -> np.ndarray:
        """Renders light, albedo and normals (3, size, size, 3) float32."""
        mi = self._mi
        path = {"type": "path", "max_depth": CLEAR_DEPTH if scene.is_clear else DEPTH}
        loaded = mi.load_dict(
            {
                "type": "scene",
                "integrator": {"type": "aov", "aovs": _LAYERS, "image": path},
                "sensor": scene.sensor(self._size),
                **scene.lights(),
                **scene.contents,
            }
        )
        shape = self._size, self._size, 3, 3
        total, counts = np.zeros(shape), np.zeros((self._size, self._size, 1, 1))
        for done in range(0, self._samples, _PASS):
            number = min(_PASS, self._samples - done)
            layers = np.asarray(mi.render(loaded, spp=number, seed=done)).reshape(shape)
            # About one of 100,000 samples is not finite.
            fine = np.isfinite(layers).all(axis=(2, 3), keepdims=True)
            total += np.where(fine, number * layers, 0.0)
            counts += number * fine
            on_sample(number)
        layers = (total / np.maximum(counts, 1)).astype(np.float32)
        return np.ascontiguousarray(np.moveaxis(layers, 2, 0))


@typed
def still(
    env: Any,
    camera: "str | mujoco.MjvCamera" = "task",
    size: int = 512,
    samples: int = SAMPLES,
    denoise: bool = True,
) -> np.ndarray:
    """Path-traces an image (size, size, 3) uint8 of the current state.

    Args:
        env: Environment with an attribute `physics`, or physics itself.
        camera, size, samples, denoise: As in `PhotoCamera`.

    Raises:
        InvalidArgumentError: If a setting is invalid.
        UnavailableError: If Mitsuba or the denoiser is missing.
    """
    return PhotoCamera(camera, size, samples, denoise).rgb(getattr(env, "physics", env))


@typed
def film(
    env: Any,
    act: Callable[[Any], np.ndarray],
    variation: int | None = None,
    camera: PhotoCamera | None = None,
    *,
    every: int = 1,
    on_step: Callable[[], object] = lambda: None,
) -> Video:
    """Plays an episode and path-traces a video in real time (pick and place: nearly).

    Args:
        env: Environment.
        act: Returns an action for a time step, such as a policy of `policies.factory.make_policy`.
        variation: As in `Environment.reset`.
        camera: Camera; None means `PhotoCamera()`.
        every: Env steps per frame.
        on_step: Called after each env step and its frame.

    Raises:
        InvalidArgumentError: If a setting is invalid.
        SimulationError: If the episode diverges.
        UnavailableError: If Mitsuba or the denoiser is missing.
    """
    check_count("every", every, 1)
    camera = PhotoCamera() if camera is None else camera
    frames = []
    for timestep in env.play(act, variation):
        if env.step_count % every == 0:
            frames.append(camera.rgb(env.physics))
        if not timestep.first():
            on_step()
    return Video(np.stack(frames), env.frame_rate / every)
