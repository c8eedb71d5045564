"""Recordings for searches: the scene that is simulated, observed frames, and their residuals."""

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
# Frames of a recording that are used, evenly spread: neighboring frames add little.
MOST_FRAMES = 80
_POINTS = 400  # Points of a cloud whose distances are taken: more would not change the mean.
# A cloud is halved this often. The mean displacement of a patch's points from the surface averages
# out their noise and keeps the effect of parameters.
_HALVINGS = 4
_MOST_POINTS = 4000  # Points of a cloud that are searched for the nearest to a vertex.
MISSED = 1.0  # [m] Distance that stands for a failed simulation.
# Size and focal length [pixels] for a camera of which only the position is known: 100 degrees wide.
_IMAGE, _FOCAL = (1000, 1000), 420.0


@dataclasses.dataclass(frozen=True)
class Motion:
    """Motion of a sheet.

    Attributes:
        times: (s,) [s], evenly spaced.
        positions: (s, n, 3) [m].
    """

    times: np.ndarray
    positions: np.ndarray

    def at(self, times: np.ndarray) -> np.ndarray:
        """Returns vertices (f, n, 3) [m] at times (f,) [s], clamped to the first and last."""
        step = self.times[1] - self.times[0]
        places = np.clip((times - self.times[0]) / step, 0.0, len(self.times) - 1)
        first = np.minimum(places.astype(int), len(self.times) - 2)
        share = (places - first)[:, None, None]
        return (1.0 - share) * self.positions[first] + share * self.positions[first + 1]


class Scene(abc.ABC):
    """Scene that is simulated for one or several recordings of the same motion.

    Attributes:
        mesh: mesh of the sheet.
    """

    mesh: Mesh

    @abc.abstractmethod
    def motion(self, fabric: Fabric) -> Motion:
        """Returns the motion of a sheet of a fabric."""


class Observation(abc.ABC):
    """Observation of a sheet in some frames."""

    @abc.abstractmethod
    def distances(self, positions: np.ndarray, chosen: slice = slice(None)) -> np.ndarray:
        """Returns the distances (f,) [m] of vertices (f, n, 3) [m] from what was observed.

        Args:
            positions: vertices of the mesh.
            chosen: frames to which they belong.
        """

    @abc.abstractmethod
    def residuals(self, positions: np.ndarray) -> np.ndarray:
        """Returns displacements (f, k, 3) [m] of what was observed from vertices (f, n, 3) [m].

        Unlike distances they pass through zero at a fit and are nearly linear in parameters.
        """


@dataclasses.dataclass(frozen=True)
class Recording:
    """One recording.

    Attributes:
        name: unique name.
        role: "fit" or "held out".
        scene: name of the simulated scene.
        times: (f,) of its frames [s], by its own clock; 0 at the start of the scene's motion.
        observation: what was observed in these frames.
    """

    name: str
    role: str
    scene: str
    times: np.ndarray
    observation: Observation

    def distances(self, motion: Motion, latency: float, chosen: slice = slice(None)) -> np.ndarray:
        """Returns distances (f,) [m] of a motion in each frame, for frames late by `latency`."""
        positions, finite = _finite(motion.at(self.times[chosen] - latency))
        found = self.observation.distances(positions, chosen)
        return np.where(finite, np.minimum(found, MISSED), MISSED)

    def residuals(self, motion: Motion, latency: float) -> np.ndarray:
        """Returns residuals (f, k, 3) [m] of a motion, for frames late by `latency` [s]."""
        positions, finite = _finite(motion.at(self.times - latency))
        found = np.clip(self.observation.residuals(positions), -MISSED, MISSED)
        return np.where(finite[:, None, None], found, MISSED)


def _finite(positions: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Returns vertices (f, n, 3), zeros in frames that are not finite, and a mask (f,)."""
    finite = np.isfinite(positions).all(axis=(1, 2))
    return np.where(finite[:, None, None], positions, 0.0), finite


class Clouds(Observation):
    """Point clouds from a camera.

    The distance is the mean of two means: distances of real points from the simulated surface, and
    distances of vertices visible to the camera from the nearest real point. Without a camera only
    the first is used, as the second would count what no camera saw. Residuals are displacements of
    real points from the surface, averaged over patches of neighbors.
    """

    def __init__(self, clouds: list[np.ndarray], mesh: Mesh, camera: Calibration | None):
        """Stores clouds (k, 3) [m] of frames of a mesh, in the frame of the simulation."""
        random = np.random.default_rng(0)  # The same points are drawn for every evaluation.
        self._clouds = []
        for cloud in clouds:
            some = min(len(cloud), _MOST_POINTS)
            self._clouds.append(random.permutation(cloud)[:some].astype(np.float32))
        self._patches = [_patches(cloud[:_POINTS]) for cloud in self._clouds]
        self._mesh, self._camera = mesh, camera

    def of(self, mesh: Mesh) -> "Clouds":
        """Returns the same clouds for another mesh."""
        other = copy.copy(self)
        other._mesh = mesh
        return other

    def residuals(self, positions):
        surface = SurfaceDistance(self._mesh.triangles)
        found = np.zeros((len(positions), 2**_HALVINGS, 3))
        frames = zip(positions, self._clouds, self._patches, strict=True)
        for means, (vertices, cloud, patches) in zip(found, frames, strict=True):
            displacements = surface.displacements(cloud[:_POINTS].astype(float), vertices)
            for patch, chosen in enumerate(patches):
                means[patch] = displacements[chosen].mean(axis=0) if len(chosen) else 0.0
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
    """Returns the indices of points (k, 3) in each patch; longest extents are halved in turn."""
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


def camera_toward(place: tuple[float, float, float], clouds: list[np.ndarray]) -> Calibration:
    """Returns a camera at a position [m] that looks at clouds (k, 3) [m] with a wide view."""
    middle = np.mean([cloud.mean(axis=0) for cloud in clouds], axis=0)
    forward = middle - np.asarray(place, float)
    forward /= np.linalg.norm(forward)
    right = np.cross(forward, [0.0, 0.0, 1.0])
    if np.linalg.norm(right) < 1e-6:  # It refinements straight down or up.
        right = np.array([1.0, 0.0, 0.0])
    right /= np.linalg.norm(right)
    extrinsics = np.eye(4)
    extrinsics[:3, :3] = right, np.cross(forward, right), forward
    extrinsics[:3, 3] = -extrinsics[:3, :3] @ place
    intrinsics = np.diag([_FOCAL, _FOCAL, 1.0])
    intrinsics[:2, 2] = (_IMAGE[1] - 1) / 2, (_IMAGE[0] - 1) / 2
    return Calibration(intrinsics, extrinsics)


def spread(frames: int, most: int = MOST_FRAMES) -> np.ndarray:
    """Returns the indices (at most `most`,) of evenly spread frames, including first and last."""
    return np.unique(np.round(np.linspace(0, frames - 1, min(frames, most))).astype(int))
