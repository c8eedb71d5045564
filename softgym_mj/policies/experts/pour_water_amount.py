"""Expert of PourWaterAmount: pours until the water that has left the cup is the target amount."""

import numpy as np

from softgym_mj.policies.experts.pour_water import DRAINED, PourWater

# Pouring of a part: angles [rad] per env step of tilting and tilting back, env steps for which
# water continues to flow, and share that is left to drops.
TIP, BACK, IN_THE_AIR, SHORT = 0.025, 0.12, 6.0, 0.01


class PourWaterAmount(PourWater):
    """Tilts the cup until the target amount will have left it, then back; repeats if needed."""

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
