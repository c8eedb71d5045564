"""Where viewers look from at first."""

import numpy as np

LOOK_AT_HEIGHT = 0.1  # [m] Of the point that a view is turned around.
_SHORTEST = 0.3  # [m] Distance of that point from the camera, at least.


def pose(physics, camera: str) -> tuple[np.ndarray, np.ndarray]:
    """Position (3,) [m] and axes (3, 3), columns: right, up, backward, of a camera of the arena."""
    index = physics.model.ptr.camera(camera).id
    data = physics.data.ptr
    return data.cam_xpos[index].copy(), data.cam_xmat[index].reshape(3, 3).copy()


def orbit(position: np.ndarray, axes: np.ndarray) -> tuple[np.ndarray, float]:
    """Point (3,) [m] near the floor that a camera looks at, and how far it is [m].

    Args:
        position, axes: of the camera, as in `pose`.
    """
    forward = -axes[:, 2]
    distance = max((LOOK_AT_HEIGHT - position[2]) / min(forward[2], -0.1), _SHORTEST)
    return position + distance * forward, distance
