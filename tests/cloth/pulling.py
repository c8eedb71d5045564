"""Two pickers that take two vertices and move apart."""

import dataclasses

import mujoco
import numpy as np

from softgym_mj.entities.arena import Arena
from softgym_mj.entities.flex import Flex
from softgym_mj.robots.base import SIM_STEP
from softgym_mj.robots.picker import Picker
from softgym_mj.robots.workspace import Workspace

_WORKSPACE = Workspace((-1.0, -1.0, 0.0), (1.0, 1.0, 1.5))
_GRIP_HEIGHT = 0.055  # [m] Of a picker's centre above the vertex that it takes.


@dataclasses.dataclass
class Pulled:
    """What came of it.

    Attributes:
        held_before, held_after: number of holds before and after pulling.
        strain: largest of an edge until the pickers open.
        drift: largest speed [m/s] of a vertex over a step, a second after that.
        lowest: lowest vertex [m] at the end.
    """

    held_before: int
    held_after: int
    strain: float
    drift: float
    lowest: float


def pull_apart(target: Flex, start: np.ndarray, first: int, second: int) -> Pulled:
    """Pulls `first` along +X and `second` along -X, at 1 m/s each for 0.32 s, from rest."""
    arena, picker = Arena("cloth"), Picker()
    arena.attach(target)
    picker.join(arena)
    picker.manipulate(target)
    physics = arena.compile(target.timestep, target, picker)
    target.set_points(start)
    above = np.array([target.vertex(first), target.vertex(second)]) + [0.0, 0.0, _GRIP_HEIGHT]
    picker.place(above, _WORKSPACE)
    strains = []

    def step(direction: float, grip: float) -> None:
        action = np.array([[direction, 0.0, 0.0, grip], [-direction, 0.0, 0.0, grip]])
        picker.command(action.ravel())
        picker.plan()
        picker.move(1.0, SIM_STEP)
        mujoco.mj_step(physics.model.ptr, physics.data.ptr)
        strains.append(target.edge_strain().max())

    step(0.0, 1.0)
    before = int((picker.held >= 0).sum())
    for _ in range(32):
        step(1.0, 1.0)
    after, strain = int((picker.held >= 0).sum()), max(strains)
    for _ in range(100):
        step(0.0, -1.0)
    last = target.points()
    step(0.0, -1.0)
    drift = np.linalg.norm(target.points() - last, axis=1).max() / SIM_STEP
    return Pulled(before, after, strain, float(drift), float(target.points()[:, 2].min()))
