"""`PhotoCamera`: photographs of physics; stills and films of environments."""

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
VARIANT = "scalar_rgb"  # The compiled ones want LLVM or a GPU.
SAMPLES = 64  # Of a pixel; glass and water want 256.
DEPTH, CLEAR_DEPTH = 6, 16  # Pieces of a path of light; glass has many surfaces.
_PASS = 8  # Samples between two calls of `on_sample`.
_LAYERS = "albedo:albedo,normal:sh_normal"  # What the denoiser tells edges and weaves from.


class PhotoCamera:
    """Photographs physics as it is; the physics is not changed."""

    @typed
    def __init__(
        self,
        camera: "str | mujoco.MjvCamera" = "task",
        size: int = 512,
        samples: int = SAMPLES,
        denoise: bool = True,
    ):
        """Loads the camera.

        Args:
            camera: a name as in `camera_ids`, or a camera anywhere.
            size: side of pictures, in 1..`LARGEST_IMAGE` [pixels].
            samples: of which a pixel is the mean.
            denoise: whether Open Image Denoise removes the grain.

        Raises:
            InvalidArgumentError: for a bad size or number of samples.
            UnavailableError: if Mitsuba or the denoiser is missing.
        """
        self._size = check_count("size", size, 1, LARGEST_IMAGE)
        self._samples = check_count("samples", samples, 1)
        self._camera = camera
        self._mi = import_extra("mitsuba", "Mitsuba", EXTRA)
        self._oidn = import_extra("pyoidn", "Open Image Denoise", EXTRA) if denoise else None
        if self._mi.variant() is None:
            self._mi.set_variant(VARIANT)
            self._mi.set_log_level(self._mi.LogLevel.Error)  # Else it warns of samples.

    def rgb(
        self, physics: Any, on_sample: Callable[[int], object] = lambda number: None
    ) -> np.ndarray:
        """Image (size, size, 3) uint8.

        Args:
            physics: what is seen.
            on_sample: called with the number of samples when so many more are done.

        Raises:
            InvalidArgumentError: if it has no such camera.
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
        """Light, albedo and normals (3, size, size, 3) float32."""
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
            # Of some 100 000 samples one is not finite.
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
    """A photograph (size, size, 3) uint8 of an environment, or of physics, as it is now.

    Args:
        env: what has `physics`, or is physics.
        camera, size, samples, denoise: as those of `PhotoCamera`.

    Raises:
        InvalidArgumentError: for bad settings.
        UnavailableError: if Mitsuba or the denoiser is missing.
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
    """Plays an episode and photographs it; the video has the speed of what it shows.

    Args:
        env: an `Environment`.
        act: gives an action for a time step, as what `policies.factory.make_policy` makes.
        variation: as in `Environment.reset`.
        camera: None for `PhotoCamera()`.
        every: env steps from one picture to the next.
        on_step: called after each env step, and its picture.

    Raises:
        InvalidArgumentError: for bad settings.
        SimulationError: if the episode diverges.
        UnavailableError: if Mitsuba or the denoiser is missing.
    """
    check_count("every", every, 1)
    camera = PhotoCamera() if camera is None else camera
    frames = []
    for timestep in env.play(act, variation):
        if env.step_count % every == 0:
            frames.append(camera.rgb(env.physics))
        if not timestep.first():
            on_step()
    return Video(np.stack(frames), 1 / (every * env.control_timestep()))
