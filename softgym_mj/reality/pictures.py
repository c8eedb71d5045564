"""Pictures of sheets and clouds side by side, as one camera sees them.

A sheet is drawn as points of its surface, shaded by the light on it; a cloud as its points. Nearer
points hide farther ones. It needs no OpenGL, and what is simulated is drawn as what is recorded.
"""

import dataclasses
import math

import numpy as np

from softgym_mj.exceptions import InvalidArgumentError
from softgym_mj.reality.surfaces import SurfaceSamples, sample_surface
from softgym_mj.rendering.calibration import Calibration

BACKGROUND = (246, 246, 244)
FRONT, BACK, CLOUD, HAND = (192, 57, 84), (226, 196, 140), (52, 96, 150), (30, 30, 30)
GROUND = (222, 222, 218)
_AMBIENT = 0.35  # Share of light that comes from everywhere.
_GROUND_HALF, _GROUND_FAR = 1.2, 2.5  # [m] Half its side; how far away it is at most.
_POINT = 0.005  # [m] Of a cloud or a surface.
_HAND_SIZE = 0.012  # [m] Of a marker of what is held.
_NEAREST = 0.05  # [m] From the camera.


def camera_at(
    position: np.ndarray,
    target: np.ndarray,
    size: tuple[int, int],
    field_of_view: float,
) -> Calibration:
    """A camera at `position` (3,) [m] that looks at `target` (3,) [m], Z up in its image.

    Args:
        position, target: as above; not above each other.
        size: (height, width) of its images [pixels].
        field_of_view: vertical [deg].

    Raises:
        InvalidArgumentError: if it looks straight up or down, or nowhere.
    """
    forward = np.asarray(target, float) - np.asarray(position, float)
    right = np.cross(forward, [0.0, 0.0, 1.0])
    if not np.linalg.norm(right) > 0.0:
        raise InvalidArgumentError("target", np.asarray(target).tolist(), "beside the camera")
    turn = np.stack([right, np.cross(forward, right), forward])
    turn /= np.linalg.norm(turn, axis=1, keepdims=True)
    extrinsics = np.eye(4)
    extrinsics[:3, :3], extrinsics[:3, 3] = turn, -turn @ np.asarray(position, float)
    height, width = size
    focal = height / 2.0 / math.tan(math.radians(field_of_view) / 2.0)
    intrinsics = np.array(
        [[focal, 0.0, (width - 1) / 2.0], [0.0, focal, (height - 1) / 2.0], [0.0, 0.0, 1.0]]
    )
    return Calibration(intrinsics, extrinsics)


@dataclasses.dataclass(frozen=True)
class Painter:
    """Draws sheets of one mesh, and clouds.

    Attributes:
        triangles: (m, 3) of the mesh.
        samples: points of its surface.
        owners: (n,) the triangle of each point, for its shade.
        calibration: of the camera.
        size: (height, width) of pictures [pixels].
        background: a picture of what is behind, (height, width, 3) uint8.
        depth: of that (height, width) [m]; infinite where nothing is.
    """

    triangles: np.ndarray
    samples: SurfaceSamples
    owners: np.ndarray
    calibration: Calibration
    size: tuple[int, int]
    background: np.ndarray
    depth: np.ndarray

    @classmethod
    def of(
        cls,
        points: np.ndarray,
        triangles: np.ndarray,
        calibration: Calibration,
        size: tuple[int, int],
        floor: float | None,
        spacing: float = 0.004,
    ) -> "Painter":
        """For a mesh at rest.

        Args:
            points, triangles: (n, 3) [m] and (m, 3) of the mesh.
            calibration: of the camera.
            size: (height, width) of pictures [pixels].
            floor: height [m] of what is drawn as ground; None for none.
            spacing: of points of its surface [m].
        """
        samples = sample_surface(points, triangles, spacing)
        number = {}
        for i, triangle in enumerate(np.sort(triangles, axis=1).tolist()):
            number[tuple(triangle)] = i
            for k in range(3):
                number.setdefault(tuple(triangle[:k] + triangle[k + 1 :]), i)
                number.setdefault((triangle[k],), i)
        owners = np.array([number[tuple(sorted(set(c)))] for c in samples.corners.tolist()])
        background = np.tile(np.array(BACKGROUND, np.uint8), (*size, 1))
        depth = np.full(size, np.inf)
        if floor is not None:
            depth = _ground(calibration, size, floor)
            background[np.isfinite(depth)] = GROUND
        return cls(triangles, samples, owners, calibration, size, background, depth)

    def sheet(self, positions: np.ndarray, held: np.ndarray | None = None) -> np.ndarray:
        """A picture (height, width, 3) uint8 of vertices (n, 3) [m] and places held (k, 3) [m]."""
        corners = positions[self.triangles]
        normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
        normals /= np.maximum(np.linalg.norm(normals, axis=1, keepdims=True), 1e-12)
        points = self.samples.points(positions)
        eye = -self.calibration.extrinsics[:3, :3].T @ self.calibration.extrinsics[:3, 3]
        to_eye = eye - points
        to_eye /= np.linalg.norm(to_eye, axis=1, keepdims=True)
        facing = np.sum(normals[self.owners] * to_eye, axis=1)
        shade = _AMBIENT + (1.0 - _AMBIENT) * np.abs(facing)
        colors = np.where(facing[:, None] >= 0.0, FRONT, BACK) * shade[:, None]
        return self._picture([(points, colors)], held)

    def cloud(self, points: np.ndarray, colors: np.ndarray | None = None) -> np.ndarray:
        """A picture (height, width, 3) uint8 of a cloud (n, 3) [m], in its colours (n, 3)."""
        paint = np.tile(CLOUD, (len(points), 1)) if colors is None else colors
        return self._picture([(points, np.asarray(paint, float))], None)

    def _picture(
        self, layers: list[tuple[np.ndarray, np.ndarray]], held: np.ndarray | None
    ) -> np.ndarray:
        picture, depth = self.background.copy(), self.depth.copy()
        for points, colors in layers:
            _splat(picture, depth, self.calibration, points, colors, _POINT)
        if held is not None:
            colors = np.tile(HAND, (len(held), 1))
            _splat(picture, depth, self.calibration, held, colors, _HAND_SIZE, _HAND_SIZE)
        return picture


def _ground(calibration: Calibration, size: tuple[int, int], floor: float) -> np.ndarray:
    """Depth (height, width) [m] of the ground about where the camera looks; infinite beside it."""
    turn, place = calibration.extrinsics[:3, :3], calibration.extrinsics[:3, 3]
    eye, forward = -turn.T @ place, turn[2]
    columns, rows = np.meshgrid(np.arange(size[1]), np.arange(size[0]))
    middle, focal = calibration.intrinsics[:2, 2], calibration.intrinsics[[0, 1], [0, 1]]
    across = (np.stack([columns, rows], axis=-1) - middle) / focal
    rays = np.concatenate([across, np.ones((*size, 1))], axis=-1) @ turn  # A metre deep each.
    with np.errstate(divide="ignore"):
        depth = (floor - eye[2]) / rays[..., 2]
    way = (floor - eye[2]) / forward[2] if forward[2] < 0.0 else _GROUND_FAR
    about = (eye + min(way, _GROUND_FAR) * forward)[:2]
    with np.errstate(invalid="ignore"):
        hit = eye[:2] + depth[..., None] * rays[..., :2]
        near = np.abs(hit - about).max(axis=-1) <= _GROUND_HALF
    return np.where((depth > 0.0) & near, depth, np.inf)


def _splat(
    picture: np.ndarray,
    depth: np.ndarray,
    calibration: Calibration,
    points: np.ndarray,
    colors: np.ndarray,
    diameter: float,
    nearer: float = 0.0,
) -> None:
    """Paints points (n, 3) of a diameter [m] as squares where nothing is nearer than they are.

    They count as `nearer` [m] than they are.
    """
    with np.errstate(divide="ignore", invalid="ignore"):
        places, depths = calibration.project(points)
    depths = depths - nearer
    good = np.isfinite(places).all(axis=1) & (depths > _NEAREST)
    if not good.any():
        return
    places, depths, colors = np.rint(places[good]).astype(int), depths[good], colors[good]
    paint = np.clip(colors, 0, 255).astype(np.uint8)
    half = math.ceil(0.5 * calibration.intrinsics[0, 0] * diameter / np.median(depths))
    height, width = depth.shape
    for row in range(-half, half + 1):
        for column in range(-half, half + 1):
            x, y = places[:, 0] + column, places[:, 1] + row
            inside = (x >= 0) & (x < width) & (y >= 0) & (y < height)
            pixel, d = y[inside] * width + x[inside], depths[inside]
            best = depth.ravel()
            np.minimum.at(best, pixel, d)
            wins = d <= best[pixel]
            picture.reshape(-1, 3)[pixel[wins]] = paint[inside][wins]


def beside(pictures: list[np.ndarray], gap: int = 4) -> np.ndarray:
    """Pictures (height, width, 3) of one height beside each other, white between."""
    white = np.full((pictures[0].shape[0], gap, 3), 255, np.uint8)
    parts = [part for picture in pictures for part in (picture, white)]
    return np.concatenate(parts[:-1], axis=1)
