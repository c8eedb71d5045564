"""The expert of FoldCrumpledCloth: drags the cloth out and swings the end it holds over.

It may hold column 0 or the last one: either way the folded cloth is the same.
"""

from collections.abc import Iterator

import numpy as np

from softgym_mj.baselines.scripted.cloth_expert import LAYER, PUT_STEPS, TRAVEL_HEIGHT, ClothExpert
from softgym_mj.baselines.scripted.picker_expert import OPEN

PACE = 0.08  # [m] Way of the pickers in an env step while the cloth is dragged out.
SWINGING = 0.8  # Fraction of full speed.
LEAD = 0.12  # [m] The far end of the cloth slips by about as much while the cloth is dragged out.
ROUND_STEPS = 60  # Env steps that taking a side, dragging the cloth out and folding need at least.
DONE = 0.93  # Normalised performance from which the cloth is left alone.
REDO = 0.1  # Normalised performance below which the cloth is taken up again if time allows.


class FoldCrumpledCloth(ClothExpert):
    """Takes column 0 or the last one, drags the cloth out along X and folds it over."""

    def _episode(self) -> Iterator[np.ndarray]:
        tried = False
        while True:
            score = self._env.task.info()["normalized_performance"]
            left = self._env.horizon - self._env.step_count
            if not tried or (score < REDO and left > ROUND_STEPS):
                tried = True
                grips = [False, False]
                yield from self._take_pair(self._sides()[:2], grips)
                if all(grips):
                    yield from self._drag(
                        grips, way=-1.0, order=self._order(), lead=LEAD, pace=PACE
                    )
                    yield from self._swing(self._far_end(), SWINGING)
                continue
            places = self._misplaced(self._places()) if score < DONE and left > PUT_STEPS else {}
            if places:
                yield from self._put(places)
            else:
                yield from self._move(self._raised(TRAVEL_HEIGHT), OPEN)
                yield self._rest(OPEN)

    def _order(self) -> float:
        """1 if what picker 0 holds is nearer to row 0 (+Y) than what picker 1 holds, else -1."""
        rows = self._actor.held // self._env.task.cloth.shape[1]
        return 1.0 if rows[0] < rows[1] else -1.0

    def _far_end(self) -> np.ndarray:
        """Where what is held belongs (2, 3) [m]: in the last column, on top."""
        return self._places()[self._actor.held] + [0.0, 0.0, LAYER]

    def _places(self) -> np.ndarray:
        """Where the vertices (n, 3) [m] of the folded cloth belong."""
        cloth = self._env.task.cloth
        rows, columns = cloth.shape
        grid = cloth.flat().reshape(rows, columns, 3)
        upper = np.arange(columns) < columns // 2
        grid[:, upper] = grid[:, ::-1][:, upper] + [0.0, 0.0, LAYER]
        return grid.reshape(-1, 3)
