"""Marks of a goal: visible, without contact, and hidden in images of observations.

They are sites, which `CameraView` hides in observations. They are moved by writing the model; the
compiler's note that their frames are those of their bodies is cleared for that.
"""

import math
from collections.abc import Sequence

import mujoco
import numpy as np
from dm_control import mjcf

from softgym_mj.entities.entity import Entity
from softgym_mj.exceptions import InvalidArgumentError
from softgym_mj.validation import typed

LINE_COLOR = (0.1, 0.7, 0.3, 0.8)  # Green: cloths, ropes and water have other colors.
LINE_WIDTH, LINE_HEIGHT = 0.006, 0.002  # [m] Line on the floor; half of its height is visible.
OUTLINE_WIDTH = 0.012  # [m] Width of outlines that are seen from afar or half covered.
LEVEL_COLOR = (1.0, 0.0, 0.0, 1.0)  # SoftGym's red.
LEVEL_HALF = 0.0025  # [m] Half of the bar's thickness (docs/softgym.md 3.3).


class Mark(Entity):
    """Mark of flat boxes; attach it at the world frame."""

    def _add_boxes(
        self, name: str, boxes: Sequence[str], size: Sequence[float], color: Sequence[float]
    ) -> None:
        """Adds boxes; to be called in a subclass's `_build` with names of model and boxes."""
        self._mjcf_root, self._names = mjcf.RootElement(model=name), boxes
        for box in boxes:
            self._mjcf_root.worldbody.add(
                "site", name=box, type="box", size=size, rgba=color, group=0
            )

    def after_compile(self, physics, random_state):
        self._model = physics.model.ptr
        root = self._mjcf_root.model
        self._sites = [self._model.site(f"{root}/{box}").id for box in self._names]
        self._model.site_sameframe[self._sites] = mujoco.mjtSameFrame.mjSAMEFRAME_NONE


class GoalLine(Mark):
    """Tape on the floor: the goal of a rope, or the outline of a cloth's goal.

    It consists of flat boxes, which a software renderer draws much faster than capsules.
    """

    @typed
    def _build(self, num_points: int, width: float = LINE_WIDTH, name: str = "goal"):
        """Builds the line.

        Args:
            num_points: number of its points, 2 or more.
            width: width of the line [m].
            name: model name.
        """
        boxes = [f"{i}" for i in range(num_points - 1)]
        self._half = width / 2
        self._add_boxes(name, boxes, [0.01, self._half, LINE_HEIGHT / 2], LINE_COLOR)

    def draw(self, points: np.ndarray) -> None:
        """Puts the line through points (num_points, 2) [m] on the floor."""
        points = np.asarray(points, float)
        if points.shape != (len(self._sites) + 1, 2):
            raise InvalidArgumentError("points", points.shape, f"shape ({len(self._sites) + 1}, 2)")
        along = np.diff(points, axis=0)
        lengths = np.linalg.norm(along, axis=1)
        angles = [math.atan2(y, x) / 2 for x, y in along]
        for site, middle, length, angle in zip(
            self._sites, points[:-1] + along / 2, lengths, angles, strict=True
        ):
            self._model.site_pos[site] = [*middle, 0.0]
            self._model.site_quat[site] = [math.cos(angle), 0.0, 0.0, math.sin(angle)]
            self._model.site_size[site, 0] = length / 2


class LevelMark(Mark):
    """Thin red bar along Y at the goal height of water."""

    def _build(self, name: str = "level"):
        self._add_boxes(name, ["bar"], [LEVEL_HALF] * 3, LEVEL_COLOR)

    def draw(self, x: float, z: float, width: float) -> None:
        """Puts the bar, `width` [m] long, at X, Z [m]."""
        self._model.site_pos[self._sites] = [x, 0.0, z]
        self._model.site_size[self._sites, 1] = width / 2
