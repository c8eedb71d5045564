"""Settings of the tasks that start with a cloth hanging from two grippers."""

import numpy as np

from softgym_mj.entities.cloth import Cloth
from softgym_mj.exceptions import InvalidArgumentError
from softgym_mj.robots.arm.models import ARMS
from softgym_mj.robots.gripper import Gripper
from softgym_mj.robots.workspace import ToolStart, Workspace

WORKSPACE = Workspace((-0.3, -0.5, 0.5), (0.5, 0.5, 2.0))  # docs/softgym.md 2.2.
ACTORS = ("picker", "pick_and_place", *ARMS)  # Actors with two grippers, one per held corner.
BASE_HEIGHT = 0.5  # [m] Base of arms: at the height of the lowest pickers.


def check_grippers(actor: Gripper) -> None:
    """Raises `InvalidArgumentError` unless there is a gripper for each corner."""
    if actor.num_grippers != 2:
        number = actor.num_grippers
        raise InvalidArgumentError("number of grippers", number, "2, for the two corners held")


def held_by_corners(cloth: Cloth) -> ToolStart:
    """Returns a start with two grippers that hold the corners p1 and p2 of column 0."""
    first, second = cloth.corners[:2].tolist()
    return ToolStart((0.0, 0.0, 0.0), WORKSPACE, held=(first, second))


def laid_down(cloth: Cloth) -> np.ndarray:
    """Returns SoftGym's particles (dimy, dimx, 3) [m] of the flat cloth at its goal."""
    return cloth.particles(cloth.flat(center=(cloth.size[0] / 2, 0.0)))
