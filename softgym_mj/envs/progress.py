"""`ProgressReward`: what an env step has gained as its reward."""

from typing import Any

import gymnasium
import numpy as np
from gymnasium.utils import RecordConstructorArgs


class ProgressReward(gymnasium.Wrapper, RecordConstructorArgs):
    """Rewards are what the normalised performance has gained in an env step.

    They add up to that at the end of an episode less that at its start, whatever lies between: it
    is the last state that counts, as in evaluations, and not how early it is reached.
    """

    def __init__(self, env: gymnasium.Env):
        """Wraps an environment.

        Args:
            env: whose infos have "normalized_performance", such as one of `gymnasium.make`.
        """
        RecordConstructorArgs.__init__(self)
        super().__init__(env)
        self._reached = 0.0

    def reset(self, *, seed: int | None = None, options: dict[str, Any] | None = None):
        """See `SoftGymEnv`; an episode that continues is rewarded for what it gains from there."""
        observation, info = self.env.reset(seed=seed, options=options)
        self._reached = info["normalized_performance"]
        return observation, info

    def step(self, action: np.ndarray):
        """See `SoftGymEnv`; the reward is of about -1 to 1."""
        observation, _, terminated, truncated, info = self.env.step(action)
        before, self._reached = self._reached, info["normalized_performance"]
        return observation, self._reached - before, terminated, truncated, info
