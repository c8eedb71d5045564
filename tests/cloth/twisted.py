"""Scenes of ropes that twist."""

import numpy as np

from softgym_mj.cloth import solver
from tests.cloth.flex_scene import FlexScene

BEND = TWIST = 1e-4  # [N m^2]


def wavy() -> np.ndarray:
    """Points of a bent and writhing rope (12, 3) [m]."""
    ways = np.array([1.0, 0.0, 0.0]) + np.random.default_rng(0).normal(0.0, 0.4, (11, 3))
    return np.concatenate([np.zeros((1, 3)), np.cumsum(0.0125 * ways, axis=0)])


def angle_of(scene: FlexScene) -> np.ndarray:
    """The twist angle (1,) [rad] of the first flex, a view."""
    return solver.twist_angle(scene.model, scene.data, 0)
