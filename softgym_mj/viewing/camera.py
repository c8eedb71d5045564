"""Initial views of viewers."""

import numpy as np

from softgym_mj.envs.environment import Environment

LOOK_AT_HEIGHT = 0.1  # [m] Height of the orbit center for a view from above.
_SHORTEST = 0.3  # [m] Least distance of the orbit center.
_STEEP = 0.1  # Horizontal part of a direction below which it counts as from above.


def pose(env: Environment, camera: str) -> tuple[np.ndarray, np.ndarray]:
    """Returns position (3,) [m] and axes (3, 3), columns right, up, backward, of a camera."""
    index = env.physics.model.ptr.camera(camera).id
    data = env.physics.data.ptr
    return data.cam_xpos[index].copy(), data.cam_xmat[index].reshape(3, 3).copy()


def orbit(env: Environment, camera: str) -> tuple[np.ndarray, float]:
    """Returns the orbit center (3,) [m] of a camera's view, and its distance [m].

    It is the point on the camera's line of sight nearest to the middle of the scene.
    """
    position, axes = pose(env, camera)
    forward = -axes[:, 2]
    middle = np.array([env.task.root_entity.view.middle, 0.0])
    flat = forward[:2] @ forward[:2]
    if flat < _STEEP**2:
        distance = (LOOK_AT_HEIGHT - position[2]) / forward[2]
    else:
        distance = (middle - position[:2]) @ forward[:2] / flat
    distance = max(distance, _SHORTEST)
    return position + distance * forward, distance
