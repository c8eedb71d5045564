"""`Calibration`: where a camera is and how it projects, in OpenCV's conventions."""

import dataclasses
import math

import numpy as np

from softgym_mj.native.arithmetic import product

_FLIPPED = np.array([1.0, -1.0, -1.0])  # MuJoCo's cameras have Y up and look along -Z.


@dataclasses.dataclass(frozen=True)
class Calibration:
    """A pinhole camera without distortion.

    The camera's axes are OpenCV's: X to the right of the image, Y down, Z forward. A point of an
    image is (column, row), and whole numbers are the middles of pixels: (0, 0) is that of the upper
    left one, as for OpenCV, Open3D and RealSense. Depth is along Z, not along the ray.

    Attributes:
        intrinsics: (3, 3) from the camera's frame to the image: focal lengths and the principal
            point [pixels].
        extrinsics: (4, 4) from the world's frame to the camera's; lengths in metres.
    """

    intrinsics: np.ndarray
    extrinsics: np.ndarray

    @classmethod
    def of(cls, model, data, camera: int, height: int, width: int) -> "Calibration":
        """That of a camera of an MjModel, by its number, for images of height x width pixels."""
        focal = height / 2 / math.tan(math.radians(model.cam_fovy[camera]) / 2)
        intrinsics = np.diag([focal, focal, 1.0])
        intrinsics[:2, 2] = (width - 1) / 2, (height - 1) / 2
        extrinsics = np.eye(4)
        extrinsics[:3, :3] = (data.cam_xmat[camera].reshape(3, 3) * _FLIPPED).T
        extrinsics[:3, 3] = -product(extrinsics[:3, :3], data.cam_xpos[camera])
        return cls(intrinsics, extrinsics)

    def project(self, points: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Where points (n, 3) [m] of the world are seen: (n, 2) in the image, (n,) depths [m]."""
        turn, place = self.extrinsics[:3, :3], self.extrinsics[:3, 3]
        local = product(points, turn.T) + place
        seen = product(local, self.intrinsics.T)
        return seen[:, :2] / seen[:, 2:], local[:, 2]

    def unproject(self, pixels: np.ndarray, depths: np.ndarray) -> np.ndarray:
        """The points (n, 3) [m] of the world that are seen at (n, 2) in the image, (n,) deep."""
        focal, middle = self.intrinsics[[0, 1], [0, 1]], self.intrinsics[:2, 2]
        flat = (pixels - middle) / focal * depths[:, None]
        turn, place = self.extrinsics[:3, :3], self.extrinsics[:3, 3]
        return product(np.column_stack([flat, depths]) - place, turn)
