"""`Calibration`: intrinsics and extrinsics of a camera in OpenCV's conventions."""

import dataclasses
import math

import numpy as np

from softgym_mj.native.arithmetic import product

_FLIPPED = np.array([1.0, -1.0, -1.0])  # MuJoCo's cameras have Y up and look along -Z.


@dataclasses.dataclass(frozen=True)
class Calibration:
    """A pinhole camera without distortion.

    The camera's axes are OpenCV's: X to the right of the image, Y down, Z forward. An image point
    is (column, row); integers are centers of pixels, and (0, 0) is the center of the upper left
    one, as in OpenCV, Open3D and RealSense. Depth is along Z, not along the ray.

    Attributes:
        intrinsics: Matrix (3, 3) of focal lengths and principal point [pixels].
        extrinsics: Transform (4, 4) from the world frame to the camera frame [m].
    """

    intrinsics: np.ndarray
    extrinsics: np.ndarray

    @classmethod
    def of(cls, model, data, camera: int, height: int, width: int) -> "Calibration":
        """Returns the calibration of a camera id of an MjModel for images of height x width."""
        focal = height / 2 / math.tan(math.radians(model.cam_fovy[camera]) / 2)
        intrinsics = np.diag([focal, focal, 1.0])
        intrinsics[:2, 2] = (width - 1) / 2, (height - 1) / 2
        extrinsics = np.eye(4)
        extrinsics[:3, :3] = (data.cam_xmat[camera].reshape(3, 3) * _FLIPPED).T
        extrinsics[:3, 3] = -product(extrinsics[:3, :3], data.cam_xpos[camera])
        return cls(intrinsics, extrinsics)

    def project(self, points: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Projects world points (n, 3) [m]; returns image points (n, 2) and depths (n,) [m]."""
        turn, place = self.extrinsics[:3, :3], self.extrinsics[:3, 3]
        local = product(points, turn.T) + place
        seen = product(local, self.intrinsics.T)
        return seen[:, :2] / seen[:, 2:], local[:, 2]

    def unproject(self, pixels: np.ndarray, depths: np.ndarray) -> np.ndarray:
        """Returns world points (n, 3) [m] of image points (n, 2) at depths (n,) [m]."""
        focal, middle = self.intrinsics[[0, 1], [0, 1]], self.intrinsics[:2, 2]
        flat = (pixels - middle) / focal * depths[:, None]
        turn, place = self.extrinsics[:3, :3], self.extrinsics[:3, 3]
        return product(np.column_stack([flat, depths]) - place, turn)
