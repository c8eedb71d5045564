"""The expert of PourWaterAmount: pour until what leaves the cup will be enough."""

import numpy as np

from softgym_mj.policies.experts.pour_water import DRAINED, PourWater

# A part of the water: angles [rad] by which the cup is tipped and tipped back in an env step, env
# steps for which water goes on leaving it, and share that is left to drops.
TIP, BACK, IN_THE_AIR, SHORT = 0.025, 0.12, 6.0, 0.01


class PourWaterAmount(PourWater):
    """Tips the cup until what leaves it will be enough, then tips it back; again if it was not."""

    def _pour(self, x, height, theta, used):
        task, least, before = self._env.task, theta - BACK, 0.0
        enough, done = task.episode.goal["share"] - SHORT, False
        while not done:
            out = 1.0 - task.info()["fraction_in_cup"]
            expected = out + IN_THE_AIR * (out - before)
            done = theta == least and out == before >= enough
            before = out
            theta += TIP if expected < enough else -BACK
            theta = float(np.clip(theta, least, DRAINED))
            yield x, height(theta), theta
