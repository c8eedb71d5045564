"""`LaidCloth`: base of the tasks that lay a cloth in a place, folded in half or flat."""

import abc
from typing import Any

import numpy as np

from softgym_mj import metrics
from softgym_mj.entities.cloth import Cloth
from softgym_mj.entities.marks import OUTLINE_WIDTH, GoalLine
from softgym_mj.metrics import Array, Measures
from softgym_mj.tasks.shared import entries, secondary_metrics
from softgym_mj.tasks.shared.base import Task
from softgym_mj.tasks.shared.entries import Entries
from softgym_mj.tasks.shared.state import Episode, State
from softgym_mj.variations.indices import Start


class LaidCloth(Task):
    """Base of the tasks that lay a cloth in a place, which an outline marks.

    Attributes:
        folded: whether the first half of the columns has to lie on the second.
        cloth: the cloth.
    """

    folded = True

    def __init__(self, cloth: Cloth, start: Start, **settings: Any):
        """Builds the task.

        Args:
            cloth: the cloth.
            start: its initial states.
            **settings: settings of `Task`.
        """
        self.cloth, self._outline = cloth, GoalLine(5, OUTLINE_WIDTH)
        super().__init__([cloth], start, marks=[self._outline], **settings)

    @abc.abstractmethod
    def place(self, points: np.ndarray) -> np.ndarray:
        """Returns SoftGym's particles (dimy, dimx, 3) [m] of the unfolded cloth at its goal.

        Args:
            points: (n, 3) [m] of the cloth at the start.
        """

    def goal(self, variation: int, points: dict[str, np.ndarray]) -> dict[str, np.ndarray]:
        """Returns the particles of `place`, and the outline of the area to cover."""
        particles = self.place(points["cloth"])
        return {
            "particles": particles,
            "outline": secondary_metrics.outline(particles, self.folded),
        }

    def draw_goal(self, goal: dict[str, np.ndarray]) -> None:
        self._outline.draw(goal["outline"][secondary_metrics.AROUND, :2])

    def measure(self, state: State, episode: Episode) -> Measures:
        shape, goal = episode.shapes["cloth"], episode.goal["particles"]
        return metrics.fold(shape, state.points["cloth"], goal)

    def bounds(self, episode: Episode) -> tuple[Array, Array]:
        return episode.initial_performance, 0.0

    def secondary_metrics(
        self, state: State, episode: Episode, measures: Measures
    ) -> dict[str, Array]:
        return secondary_metrics.laying(state, episode, self.folded)

    def reduced(self, state: State, episode: Episode) -> Entries:
        return entries.corners(state, episode)

    def key_points(self, state: State, episode: Episode) -> Entries:
        return entries.key_points(state, episode)
