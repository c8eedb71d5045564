"""Marks that show a goal: drawn, and felt by nothing.

They are moved by writing the model, where the compiler has noted that their frames are those of
their bodies: that note has to go.
"""

import math
from collections.abc import Sequence

import mujoco
import numpy as np
from dm_control import mjcf

from softgym_mj.entities.entity import Entity
from softgym_mj.exceptions import InvalidArgumentError
from softgym_mj.kinds import typed

LINE_COLOR = (0.95, 0.35, 0.1, 0.6)
LINE_HALF = (0.003, 0.001)  # [m] Half of its width and of its height; half of that shows.
LEVEL_COLOR = (1.0, 0.0, 0.0, 1.0)  # SoftGym's red.
LEVEL_HALF = 0.0025  # [m] Half of its thickness (facts 3.3).


class Mark(Entity):
    """Flat boxes. Attach it at the world frame."""

    def _add_boxes(
        self, name: str, boxes: Sequence[str], size: Sequence[float], color: Sequence[float]
    ) -> None:
        """To be called in a subclass's `_build`, with the names of the model and its boxes."""
        self._mjcf_root, self._names = mjcf.RootElement(model=name), boxes
        for box in boxes:
            self._mjcf_root.worldbody.add(
                "geom", name=box, type="box", size=size, contype=0, conaffinity=0, mass=0.0,
                rgba=color,
            )  # fmt: skip

    def after_compile(self, physics, random_state):
        self._model = physics.model.ptr
        root = self._mjcf_root.model
        self._geoms = [self._model.geom(f"{root}/{box}").id for box in self._names]
        self._model.geom_sameframe[self._geoms] = mujoco.mjtSameFrame.mjSAMEFRAME_NONE


class GoalLine(Mark):
    """A tape on the floor: where a rope ought to lie.

    It is made of flat boxes, which a software renderer draws much faster than capsules.
    """

    @typed
    def _build(self, num_points: int, name: str = "goal"):
        """Builds the line.

        Args:
            num_points: number of its points, 2 or more.
            name: model name.
        """
        boxes = [f"{i}" for i in range(num_points - 1)]
        self._add_boxes(name, boxes, [0.01, *LINE_HALF], LINE_COLOR)

    def draw(self, points: np.ndarray) -> None:
        """Puts the line through points (num_points, 2) [m] on the floor."""
        points = np.asarray(points, float)
        if points.shape != (len(self._geoms) + 1, 2):
            raise InvalidArgumentError("points", points.shape, f"shape ({len(self._geoms) + 1}, 2)")
        along = np.diff(points, axis=0)
        lengths = np.linalg.norm(along, axis=1)
        angles = [math.atan2(y, x) / 2 for x, y in along]
        for geom, middle, length, angle in zip(
            self._geoms, points[:-1] + along / 2, lengths, angles, strict=True
        ):
            self._model.geom_pos[geom] = [*middle, 0.0]
            self._model.geom_quat[geom] = [math.cos(angle), 0.0, 0.0, math.sin(angle)]
            self._model.geom_size[geom, 0] = length / 2
            self._model.geom_rbound[geom] = length / 2 + LINE_HALF[0]


class LevelMark(Mark):
    """A thin red bar along Y: how high water ought to stand."""

    def _build(self, name: str = "level"):
        self._add_boxes(name, ["bar"], [LEVEL_HALF] * 3, LEVEL_COLOR)

    def draw(self, x: float, z: float, width: float) -> None:
        """Puts the bar, `width` [m] long, at X, Z [m]."""
        self._model.geom_pos[self._geoms] = [x, 0.0, z]
        self._model.geom_size[self._geoms, 1] = width / 2
        self._model.geom_rbound[self._geoms] = width
