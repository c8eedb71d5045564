"""Simulated recordings of rags in the format of real ones, with known parameters.

Points are spread over the side that the camera sees, with noise and a latency.
"""

import dataclasses
import pathlib
from collections.abc import Mapping

import numpy as np

from softgym_mj.cloth import solver
from softgym_mj.entities.fabric import Fabric
from softgym_mj.reality import rags
from softgym_mj.reality.clouds import Cloud
from softgym_mj.reality.identification.rag_data import (
    CAMERA,
    SIZE,
    SPACING,
    RagScene,
)
from softgym_mj.reality.identification.recordings import Motion, camera_toward
from softgym_mj.reality.surfaces import sample_surface, seen

_SAMPLES = 0.006  # [m] Spacing of the surface samples from which points are drawn.
_POINTS = 1500  # Points of a cloud: one in 2 cm^2 of a rag.
_GRAY = 128
_IMAGE = (1000, 1000)


@dataclasses.dataclass(frozen=True)
class Sensor:
    """Camera that observes the rag.

    Attributes:
        latency: delay of frames [s].
        noise: standard deviation along each axis [m].
        place: position of the camera [m].
        is_one_sided: whether clouds contain only points visible to the camera.
    """

    latency: float = 0.033
    noise: float = 0.005
    place: tuple[float, float, float] = CAMERA
    is_one_sided: bool = True


def write_rags(
    folder: pathlib.Path,
    cloth: str,
    fabric: Fabric,
    sensor: Sensor | None = None,
    spacing: float = SPACING / 2.0,
    step: float = solver.TIMESTEP / 2.0,
    repeats: tuple[int, ...] = rags.REPEATS,
    clock_errors: Mapping[tuple[int, str], float] | None = None,
    seed: int = 0,
) -> None:
    """Writes both primitives of a simulated rag in the format that `rags.read_sequence` reads.

    Args:
        folder: output folder.
        cloth: name from `rags.CLOTHS` under which it is written.
        fabric: fabric of the rag.
        sensor: camera; None for the default.
        spacing, step: of the simulation [m], [s]; the defaults are half of those of a search.
        repeats: indices of the repeats; the motion is the same, noise differs.
        clock_errors: delay of time stamps [s] in addition to the latency, by repeat and primitive.
        seed: seed of the noise.
    """
    sensor = Sensor() if sensor is None else sensor
    for primitive, frames in rags.FRAMES.items():
        end = frames / rags.FRAME_RATE
        scene = RagScene(primitive, end, SIZE, spacing, step=step)
        motion = scene.motion(fabric)
        for repeat in repeats:
            late = sensor.latency + (clock_errors or {}).get((repeat, primitive), 0.0)
            random = np.random.default_rng([seed, repeat, list(rags.FRAMES).index(primitive)])
            times = np.arange(frames) / rags.FRAME_RATE - late
            clouds = _clouds(scene, motion, times, sensor, random)
            rags.write_sequence(folder, cloth, repeat, primitive, clouds)


def _clouds(
    scene: RagScene,
    motion: Motion,
    times: np.ndarray,
    sensor: Sensor,
    random: np.random.Generator,
) -> list[Cloud]:
    """Returns the clouds observed at times (f,) [s] of a motion."""
    mesh = scene.mesh
    samples = sample_surface(mesh.points, mesh.triangles, _SAMPLES)
    clouds = []
    for vertices in motion.at(times):
        # Visibility is tested for a random subset only.
        points = samples.points(vertices)
        points = points[random.permutation(len(points))[: 2 * _POINTS]]
        if sensor.is_one_sided:
            camera = camera_toward(sensor.place, [vertices])
            points = points[seen(points, vertices, mesh.triangles, camera, _IMAGE)]
        points = points[:_POINTS]
        points = points + sensor.noise * random.standard_normal(points.shape)
        clouds.append(Cloud(points, np.full(points.shape, _GRAY, np.uint8)))
    return clouds
