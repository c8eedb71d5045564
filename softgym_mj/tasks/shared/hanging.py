"""`HangingTask`: base of the tasks that start with a cloth hanging from two grippers."""

from typing import Any

import numpy as np

from softgym_mj.entities.cloth import Cloth
from softgym_mj.exceptions import InvalidArgumentError
from softgym_mj.robots.arm.models import ARMS
from softgym_mj.robots.workspace import ToolStart, Workspace
from softgym_mj.tasks.shared.laid_cloth import LaidCloth
from softgym_mj.tasks.shared.starts.cloths import HangingCloth
from softgym_mj.tasks.shared.symmetry import mirrored

ACTORS = ("picker", "pick_and_place", *ARMS)  # Actors with two grippers, one per held corner.


class HangingTask(LaidCloth):
    """Base of the tasks that lay a cloth that hangs by the corners p1 and p2 of column 0."""

    actors = ACTORS
    workspace = Workspace((-0.3, -0.5, 0.5), (0.5, 0.5, 2.0))  # docs/softgym.md 2.2.
    arm_height = 0.5  # [m] Base of arms: at the height of the lowest pickers.
    symmetries = mirrored("rows")

    def __init__(self, start: HangingCloth, **settings: Any):
        """Builds the task with a start and settings of `Task`.

        Raises:
            InvalidArgumentError: unless there is a gripper for each corner.
        """
        super().__init__(Cloth(fidelity=start.fidelity), start, **settings)
        if (number := self.actor.num_grippers) != 2:
            raise InvalidArgumentError(self.actor.counted_by, number, "2, one per held corner")

    def tool_start(self, points: dict[str, np.ndarray]) -> ToolStart:
        first, second = self.cloth.corners[:2].tolist()
        return ToolStart((0.0, 0.0, 0.0), self.workspace, held=(first, second))

    def place(self, points: np.ndarray) -> np.ndarray:
        return self.cloth.particles(self.cloth.flat(center=(self.cloth.size[0] / 2, 0.0)))
