"""Where viewers look from at first."""

import numpy as np

from softgym_mj.envs.environment import Environment

LOOK_AT_HEIGHT = 0.1  # [m] At which a view from above is turned.
_SHORTEST = 0.3  # [m] Distance of what a view is turned around, at least.
_STEEP = 0.1  # Horizontal part of a direction below which it counts as from above.


def pose(env: Environment, camera: str) -> tuple[np.ndarray, np.ndarray]:
    """Position (3,) [m] and axes (3, 3), columns: right, up, backward, of a camera of the arena."""
    index = env.physics.model.ptr.camera(camera).id
    data = env.physics.data.ptr
    return data.cam_xpos[index].copy(), data.cam_xmat[index].reshape(3, 3).copy()


def orbit(env: Environment, camera: str) -> tuple[np.ndarray, float]:
    """Point (3,) [m] around which a view from a camera is turned, and its distance [m].

    It is where the camera's line of sight is nearest to the middle of the scene.
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
