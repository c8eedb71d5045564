"""Recordings as searches see them: what moves, which frames of it were seen, how far one is off."""

import abc
import copy
import dataclasses

import numpy as np
from scipy.spatial import cKDTree

from softgym_mj.entities.fabric import Fabric
from softgym_mj.reality.meshes import Mesh
from softgym_mj.reality.nearest import SurfaceDistance
from softgym_mj.reality.surfaces import seen
from softgym_mj.rendering.calibration import Calibration

FIT, HELD_OUT = "fit", "held out"
MOST_FRAMES = 80  # Of a recording that are looked at, spread over it: neighbours tell the same.
_POINTS = 400  # Of a cloud whose distance from the surface is taken: as many say no more.
# Of a cloud, halved and halved again: the mean way of a patch's points from the surface has little
# of their noise, and all that a parameter does to it.
_HALVINGS = 4
_MOST_POINTS = 4000  # Of a cloud among which vertices look for the nearest.
MISSED = 1.0  # [m] Distance of what is no number: a simulation that failed.
# Of the image in which a camera that only has a place sees: 100 degrees across.
_IMAGE, _FOCAL = (1000, 1000), 420.0


@dataclasses.dataclass(frozen=True)
class Motion:
    """What a sheet did.

    Attributes:
        times: (s,) [s], evenly spaced.
        positions: (s, n, 3) [m].
    """

    times: np.ndarray
    positions: np.ndarray

    def at(self, times: np.ndarray) -> np.ndarray:
        """Vertices (f, n, 3) [m] at times (f,) [s]; beyond the first and last, as then."""
        step = self.times[1] - self.times[0]
        places = np.clip((times - self.times[0]) / step, 0.0, len(self.times) - 1)
        first = np.minimum(places.astype(int), len(self.times) - 2)
        share = (places - first)[:, None, None]
        return (1.0 - share) * self.positions[first] + share * self.positions[first + 1]


class Scene(abc.ABC):
    """What is simulated for one or several recordings of the same motion.

    Attributes:
        mesh: of the sheet.
    """

    mesh: Mesh

    @abc.abstractmethod
    def motion(self, fabric: Fabric) -> Motion:
        """What a sheet of a fabric does in it."""


class Observation(abc.ABC):
    """What was seen in some frames."""

    @abc.abstractmethod
    def distances(self, positions: np.ndarray, chosen: slice = slice(None)) -> np.ndarray:
        """How far vertices (f, n, 3) [m] are from what was seen in each frame: (f,) [m].

        Args:
            positions: of the mesh.
            chosen: which of the frames these are.
        """

    @abc.abstractmethod
    def offsets(self, positions: np.ndarray) -> np.ndarray:
        """Ways to what was seen from where vertices (f, n, 3) [m] say that it is: (f, k, 3) [m].

        Unlike distances they go through zero where they are met, and hardly bend on the way.
        """


@dataclasses.dataclass(frozen=True)
class Recording:
    """One recording.

    Attributes:
        name: of its own.
        role: "fit" or "held out".
        scene: name of what is simulated.
        times: (f,) of its frames [s], by its own clock; 0 when the scene's motion starts.
        observation: of these frames.
    """

    name: str
    role: str
    scene: str
    times: np.ndarray
    observation: Observation

    def distances(self, motion: Motion, latency: float, chosen: slice = slice(None)) -> np.ndarray:
        """How far a motion is off in each frame (f,) [m] if frames show what was `latency` ago."""
        positions, finite = _finite(motion.at(self.times[chosen] - latency))
        found = self.observation.distances(positions, chosen)
        return np.where(finite, np.minimum(found, MISSED), MISSED)

    def offsets(self, motion: Motion, latency: float) -> np.ndarray:
        """Offsets (f, k, 3) [m] of a motion, as of `Observation`, if frames are so late [s]."""
        positions, finite = _finite(motion.at(self.times - latency))
        found = np.clip(self.observation.offsets(positions), -MISSED, MISSED)
        return np.where(finite[:, None, None], found, MISSED)


def _finite(positions: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Vertices (f, n, 3), none where a frame has a number that is not finite; which have none."""
    finite = np.isfinite(positions).all(axis=(1, 2))
    return np.where(finite[:, None, None], positions, 0.0), finite


class Clouds(Observation):
    """Point clouds of what a camera saw.

    The distance is the mean of two mean ones: of real points from the simulated surface, and of
    vertices that the camera would see from the nearest real point. Without a camera only the first
    is taken: the second counts what no camera saw. Offsets are of real points from the surface,
    their means over patches of neighbours.
    """

    def __init__(self, clouds: list[np.ndarray], mesh: Mesh, camera: Calibration | None):
        """Keeps clouds (k, 3) [m] of frames of a mesh, in the frame of the simulation."""
        random = np.random.default_rng(0)  # Which points: the same for every evaluation.
        self._clouds = []
        for cloud in clouds:
            some = min(len(cloud), _MOST_POINTS)
            self._clouds.append(random.permutation(cloud)[:some].astype(np.float32))
        self._patches = [_patches(cloud[:_POINTS]) for cloud in self._clouds]
        self._mesh, self._camera = mesh, camera

    def of(self, mesh: Mesh) -> "Clouds":
        """The same clouds, of frames of another mesh."""
        other = copy.copy(self)
        other._mesh = mesh
        return other

    def offsets(self, positions):
        surface = SurfaceDistance(self._mesh.triangles)
        found = np.zeros((len(positions), 2**_HALVINGS, 3))
        frames = zip(positions, self._clouds, self._patches, strict=True)
        for means, (vertices, cloud, patches) in zip(found, frames, strict=True):
            ways = surface.offsets(cloud[:_POINTS].astype(float), vertices)
            for patch, chosen in enumerate(patches):
                means[patch] = ways[chosen].mean(axis=0) if len(chosen) else 0.0
        return found

    def distances(self, positions, chosen=slice(None)):
        surface = SurfaceDistance(self._mesh.triangles)
        found = []
        for vertices, cloud in zip(positions, self._clouds[chosen], strict=True):
            there = surface(cloud[:_POINTS].astype(float), vertices).mean()
            back = there if self._camera is None else self._back(vertices, cloud)
            found.append((there + back) / 2.0)
        return np.array(found)

    def _back(self, vertices: np.ndarray, cloud: np.ndarray) -> float:
        assert self._camera is not None
        if self._camera.project(vertices)[1].min() <= 0.0:
            return MISSED  # It flew past the camera.
        visible = seen(vertices, vertices, self._mesh.triangles, self._camera, _IMAGE)
        if not visible.any():
            return MISSED
        return float(cKDTree(cloud).query(vertices[visible])[0].mean())


def _patches(cloud: np.ndarray) -> list[np.ndarray]:
    """Which of points (k, 3) are in each patch: halves of halves, across where they are longest."""
    patches = [np.arange(len(cloud))]
    for _ in range(_HALVINGS):
        halves = []
        for patch in patches:
            points = cloud[patch]
            longest = np.ptp(points, axis=0).argmax() if len(patch) else 0
            order = patch[np.argsort(points[:, longest], kind="stable")]
            halves += np.array_split(order, 2)
        patches = halves
    return patches


def looking(place: tuple[float, float, float], clouds: list[np.ndarray]) -> Calibration:
    """A camera at a place [m] that looks at what it saw: clouds (k, 3) [m]; its image is wide."""
    middle = np.mean([cloud.mean(axis=0) for cloud in clouds], axis=0)
    forward = middle - np.asarray(place, float)
    forward /= np.linalg.norm(forward)
    right = np.cross(forward, [0.0, 0.0, 1.0])
    if np.linalg.norm(right) < 1e-6:  # It looks straight down or up.
        right = np.array([1.0, 0.0, 0.0])
    right /= np.linalg.norm(right)
    extrinsics = np.eye(4)
    extrinsics[:3, :3] = right, np.cross(forward, right), forward
    extrinsics[:3, 3] = -extrinsics[:3, :3] @ place
    intrinsics = np.diag([_FOCAL, _FOCAL, 1.0])
    intrinsics[:2, 2] = (_IMAGE[1] - 1) / 2, (_IMAGE[0] - 1) / 2
    return Calibration(intrinsics, extrinsics)


def spread(frames: int, most: int = MOST_FRAMES) -> np.ndarray:
    """Which of a number of frames to look at: (at most `most`,), first and last included."""
    return np.unique(np.round(np.linspace(0, frames - 1, min(frames, most))).astype(int))
