"""The expert of SpreadCloth: takes a side, drags the cloth out, then mends what lies wrong."""

from softgym_mj.baselines.scripted.cloth_expert import PUT_STEPS, TRAVEL_HEIGHT, ClothExpert
from softgym_mj.baselines.scripted.picker_expert import OPEN

DONE = 0.98  # Normalised performance from which the cloth is left alone.
ROUND_STEPS = 45  # Env steps that taking a side and dragging the cloth out need at least.
REDO = 0.35  # Normalised performance below which the cloth is taken up again if time allows.


class SpreadCloth(ClothExpert):
    """Takes the ends of a side, drags the cloth out, then moves what lies wrong to its place."""

    def _episode(self):
        dragged = False
        while True:
            score = self._env.task.info()["normalized_performance"]
            left = self._env.horizon - self._env.step_count
            if not dragged or (score < REDO and left > ROUND_STEPS):
                dragged = True
                grips = [False, False]
                yield from self._take_pair(self._sides(), grips)
                if all(grips):
                    yield from self._drag(grips)
                    yield self._step(self._raised(TRAVEL_HEIGHT), OPEN)
                continue
            mend = score < DONE and left > PUT_STEPS
            places = self._misplaced(self._registered()) if mend else {}
            if places:
                yield from self._put(places)
            else:
                yield from self._move(self._raised(TRAVEL_HEIGHT), OPEN)
                yield self._rest(OPEN)
