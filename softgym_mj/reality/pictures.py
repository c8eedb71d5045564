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
_GROUND_SPACING = 0.012  # [m]
_HAND_SIZE = 0.012  # [m] Half the side of a marker of what is held.


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
        floor: height [m] of what is drawn as ground; None for none.
    """

    triangles: np.ndarray
    samples: SurfaceSamples
    owners: np.ndarray
    calibration: Calibration
    size: tuple[int, int]
    floor: float | None

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
        """For a mesh at rest, with points of its surface so far apart [m]."""
        samples = sample_surface(points, triangles, spacing)
        number = {}
        for i, triangle in enumerate(np.sort(triangles, axis=1).tolist()):
            number[tuple(triangle)] = i
            for k in range(3):
                number.setdefault(tuple(triangle[:k] + triangle[k + 1 :]), i)
                number.setdefault((triangle[k],), i)
        owners = np.array([number[tuple(sorted(set(c)))] for c in samples.corners.tolist()])
        return cls(triangles, samples, owners, calibration, size, floor)

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
        picture = np.tile(np.array(BACKGROUND, np.uint8), (*self.size, 1))
        depth = np.full(self.size, np.inf)
        if self.floor is not None:
            ground = self._ground()
            self._splat(picture, depth, ground, np.tile(GROUND, (len(ground), 1)), _GROUND_SPACING)
        for points, colors in layers:
            self._splat(picture, depth, points, colors, 0.005)
        if held is not None:
            colors = np.tile(HAND, (len(held), 1))
            self._splat(picture, depth, held, colors, _HAND_SIZE, nearer=_HAND_SIZE)
        return picture

    def _ground(self) -> np.ndarray:
        """Points of the ground about where the camera looks."""
        turn, place = self.calibration.extrinsics[:3, :3], self.calibration.extrinsics[:3, 3]
        eye, forward = -turn.T @ place, turn[2]
        assert self.floor is not None
        way = (self.floor - eye[2]) / forward[2] if forward[2] < 0.0 else 2.0
        middle = eye + min(way, 2.5) * forward
        line = np.arange(-1.2, 1.2, _GROUND_SPACING)
        x, y = np.meshgrid(middle[0] + line, middle[1] + line)
        return np.column_stack([x.ravel(), y.ravel(), np.full(x.size, self.floor)])

    def _splat(
        self,
        picture: np.ndarray,
        depth: np.ndarray,
        points: np.ndarray,
        colors: np.ndarray,
        diameter: float,
        nearer: float = 0.0,
    ) -> None:
        """Paints points (n, 3) of a diameter [m] as squares where nothing is nearer."""
        with np.errstate(divide="ignore", invalid="ignore"):
            places, depths = self.calibration.project(points)
        depths = depths - nearer
        good = np.isfinite(places).all(axis=1) & (depths > 0.05)
        places, depths, colors = places[good], depths[good], colors[good]
        focal = self.calibration.intrinsics[0, 0]
        half = (
            math.ceil(0.5 * focal * diameter / max(np.median(depths), 1e-3)) if len(depths) else 0
        )
        order = np.argsort(-depths, kind="stable")
        places, depths, colors = np.rint(places[order]).astype(int), depths[order], colors[order]
        height, width = self.size
        for row in range(-half, half + 1):
            for column in range(-half, half + 1):
                x, y = places[:, 0] + column, places[:, 1] + row
                inside = (x >= 0) & (x < width) & (y >= 0) & (y < height)
                x, y, d, c = x[inside], y[inside], depths[inside], colors[inside]
                nearest = np.full(self.size, np.inf)
                np.minimum.at(nearest, (y, x), d)
                wins = (d <= nearest[y, x]) & (d < depth[y, x])
                picture[y[wins], x[wins]] = np.clip(c[wins], 0, 255).astype(np.uint8)
                depth[y[wins], x[wins]] = d[wins]


def beside(pictures: list[np.ndarray], gap: int = 4) -> np.ndarray:
    """Pictures (height, width, 3) of one height beside each other, white between."""
    white = np.full((pictures[0].shape[0], gap, 3), 255, np.uint8)
    parts = [part for picture in pictures for part in (picture, white)]
    return np.concatenate(parts[:-1], axis=1)
