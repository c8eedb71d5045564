"""Expert of FoldCrumpledCloth: lifts the cloth by its middle column and lays it down folded.

Cloth that hangs by the ends of its middle column is folded without being spread first.
"""

from collections.abc import Iterator

import numpy as np

from softgym_mj.native.arithmetic import length
from softgym_mj.policies.experts.cloth_expert import LAYER, LIFT, TRAVEL_HEIGHT
from softgym_mj.policies.experts.crumpled_cloth_expert import CrumpledClothExpert
from softgym_mj.policies.experts.picker_expert import OPEN, PASSED, SLOW

PACE = 0.05  # [m] Distance of the pickers per env step while the cloth is laid down.
END_ROWS = 1, 4  # Numbers of rows at either end of the middle column that may be grasped.
ASTRAY = 2  # Maximum distance in columns from the middle where arms may grasp.
HANGING = 4  # Env steps for the cloth to come to rest before it is laid down.


class FoldCrumpledCloth(CrumpledClothExpert):
    """Grasps both ends of the middle column, lifts the cloth and lays it down towards +X."""

    redo, holds = 0.93, 8

    def _pairs(self) -> list[list[tuple[int, int, float]]]:
        """Returns the ends of the middle column, or vertices nearby, with their distances [m]."""
        cloth = self._env.task.cloth
        rows, columns = cloth.shape
        middle, pitch = columns // 2, cloth.size[1] / (rows - 1)
        return [
            [
                (cloth.index(i, middle), cloth.index(-1 - j, middle), (rows - 1 - i - j) * pitch)
                for i in range(number)
                for j in range(number)
            ]
            for number in END_ROWS
        ]

    def _handles(self) -> list[int]:
        """Returns the vertices of the columns in the middle."""
        vertices = self._env.task.cloth.arrays["grid"]
        middle = vertices.shape[1] // 2
        return vertices[:, middle - ASTRAY : middle + ASTRAY + 1].ravel().tolist()

    def _hold_worth(self, a: int, b: int) -> float:
        """Returns the distance of the vertices minus their distances to the middle column [m]."""
        flat, columns = self._env.task.cloth.flat(), self._env.task.cloth.shape[1]
        middle = flat[columns // 2, 0]
        return length(flat[a] - flat[b]) - float(np.abs(flat[[a, b], 0] - middle).sum())

    def _lay(self, grips: list[bool]) -> Iterator[np.ndarray]:
        """Stretches the held column along Y and lays the cloth down, its edges first."""
        low, high = self._actor.limits
        flat, held = self._env.task.cloth.flat(), self._actor.held.tolist()
        depth = float(np.ptp(flat[:, 0]) / 2)
        offset = (self._target.points()[held] - self._actor.positions()) * [1.0, 1.0, 0.0]
        goals = flat[held] - offset

        def pose(x: float, z: float) -> np.ndarray:
            moved = goals + [x, 0.0, 0.0]
            moved[:, 2] = z
            return moved

        yield from self._move(self._raised(high[2]), grips, LIFT, PASSED)
        yield from self._move(pose(depth, high[2]), grips, SLOW)
        for _ in range(HANGING):
            yield self._step(pose(depth, high[2]), grips)
        x = depth
        while x > 0.0:
            x = max(x - PACE, 0.0)
            # The arc of edges that stick to the floor.
            height = np.sqrt(max(depth**2 - (depth - x) ** 2, 0.0))
            yield self._step(pose(x, np.clip(height, low[2], high[2])), grips)
        yield from self._move(pose(0.0, low[2]), grips, SLOW)
        yield self._step(self._raised(TRAVEL_HEIGHT), OPEN)

    def _places(self) -> np.ndarray:
        """Returns the target positions (n, 3) [m] of the vertices of the folded cloth."""
        cloth = self._env.task.cloth
        rows, columns = cloth.shape
        grid = cloth.flat().reshape(rows, columns, 3)
        upper = np.arange(columns) < columns // 2
        grid[:, upper] = grid[:, ::-1][:, upper] + [0.0, 0.0, LAYER]
        return grid.reshape(-1, 3)
