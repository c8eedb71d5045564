"""`ClothTask`: what the tasks on a cloth share."""

from typing import Protocol

import numpy as np

from softgym_mj import metrics
from softgym_mj.entities.cloth import Cloth, grid_shape
from softgym_mj.metrics import Array
from softgym_mj.robots.gripper import Gripper
from softgym_mj.tasks.flex_task import FlexTask, Layout
from softgym_mj.tasks.shared.state import Episode, State
from softgym_mj.variations.indices import Initializer
from softgym_mj.variations.store import VariationStore


class ClothInitializer(Initializer, Protocol):
    """Produces cloths of many sizes."""

    @property
    def fidelity(self) -> str:
        """Of the cloth: one of `Cloth`'s."""

    @property
    def largest(self) -> int:
        """Longest side of any variation [particles]."""
        ...

    def dims(self, index: int) -> tuple[int, int]:
        """Size (dimx, dimy) of a variation [particles]."""
        ...


class ClothTask(FlexTask):
    """A task on one cloth. Its reduced state lists the corners p1 p2 p3 p4, see `Cloth.corners`."""

    def __init__(
        self,
        layout: Layout,
        cloth: Cloth,
        actor: Gripper,
        initializer: ClothInitializer,
        count_intersections: bool = False,
        **settings,
    ):
        """Wires the parts together.

        Args:
            layout: the fixed numbers.
            cloth: the cloth, not yet attached.
            actor: what acts, not yet attached.
            initializer: the initial states.
            count_intersections: adds "intersections" to info.
            **settings: observation, image_size, action_repeat and domain as in `DeformableTask`.
        """
        self._cloth, self._initializer = cloth, initializer
        self._count_intersections = count_intersections
        rows, columns = grid_shape((initializer.largest,) * 2, initializer.fidelity)
        super().__init__(
            layout,
            cloth,
            actor,
            VariationStore(initializer),
            max_vertices=rows * columns,
            **settings,
        )

    @property
    def cloth(self) -> Cloth:
        """The cloth."""
        return self._cloth

    def resize(self, variation: int) -> bool:
        return self._cloth.resize(self._initializer.dims(variation))

    def shapes(self) -> dict[str, dict[str, np.ndarray]]:
        return {"cloth": self._cloth.arrays}

    def reduced(self, state: State, episode: Episode) -> dict[str, Array]:
        corners = metrics.taken(state.points["cloth"], episode.shapes["cloth"]["corners"])
        return {f"corner p{i + 1} (x, y, z) [m]": corners[..., i, :] for i in range(4)}

    def diagnostics(self) -> dict[str, float | int]:
        diagnostics = super().diagnostics()
        if self._count_intersections:
            diagnostics["intersections"] = self._cloth.intersections()
        return diagnostics
