"""Smooth paths for the tool of an arm, and scenes of arms with an object out of reach."""

import itertools
import math

import mujoco
import numpy as np

from softgym_mj.entities.arena import Arena
from softgym_mj.entities.cloth import Cloth
from softgym_mj.entities.rope import Rope
from softgym_mj.robots.arm.arms import Arms
from softgym_mj.robots.arm.models import ARMS
from softgym_mj.robots.base import SIM_STEP
from softgym_mj.robots.workspace import Workspace

SPEED = 0.6  # [m/s] Largest of the smooth motions.
WORKSPACE = Workspace((-0.7, -0.7, 0.0), (0.7, 0.7, 0.5))
# The box that the smooth motions fill, in front of the base: forward, left, up [m].
LOW, HIGH = np.array([0.3, -0.25, 0.03]), np.array([0.6, 0.25, 0.4])
SET_IN = 50  # Sim steps in which the curve speeds up.


def waypoints(steps: int) -> np.ndarray:
    """Minimum-jerk ways in the arm's frame (steps, 3) [m], one point a sim step."""
    points, rows = np.random.default_rng(0).uniform(LOW, HIGH, (steps, 3)), []
    for start, end in itertools.islice(itertools.pairwise(points), steps // 10):
        # The peak speed is 1.875 times the mean speed.
        number = math.ceil(1.875 * np.linalg.norm(end - start) / SPEED / SIM_STEP)
        s = (np.arange(number) + 1.0)[:, None] / number
        rows.append(start + (10 * s**3 - 15 * s**4 + 6 * s**5) * (end - start))
    return np.concatenate(rows)[:steps]


def lissajous(steps: int) -> np.ndarray:
    """A curve that fills the box, in the arm's frame (steps, 3) [m]; it sets in within 0.5 s."""
    half = (HIGH - LOW) / 2
    rate = np.array([1.5, 0.9, 1.2])
    rate *= SPEED / np.linalg.norm(rate * half)
    time = np.cumsum(np.minimum(np.arange(steps) / SET_IN, 1.0)) * SIM_STEP
    return (LOW + HIGH) / 2 + half * np.sin(rate * time[:, None])


def scene(
    kind: str, arm: str, number: int = 1, action: str = "position", timestep: float = SIM_STEP
) -> tuple[mujoco.MjModel, mujoco.MjData, Arms]:
    """Arms, acting as `action` says, and an object that lies out of reach."""
    target = Cloth(dims=(20, 20), fidelity="fast") if kind == "cloth" else Rope("fast")
    arena, arms = Arena(), Arms(ARMS[arm], number, action=action)
    arena.attach(target)
    arms.join(arena)
    arms.manipulate(target)
    physics = arena.compile(min(timestep, target.timestep), target, arms)
    vertices = target.points() + [2.0, 0.0, 0.0]
    vertices[:, 2] = target.radius
    target.set_points(vertices)
    return physics.model.ptr, physics.data.ptr, arms
