"""`ProgressReward`: Gymnasium wrapper that rewards progress."""

from typing import Any

import gymnasium
import numpy as np
from gymnasium.utils import RecordConstructorArgs


class ProgressReward(gymnasium.Wrapper, RecordConstructorArgs):
    """Replaces the reward by the increase of normalized performance in an env step.

    Rewards add up to the increase from the start to the end of an episode: only the last state
    counts, as in evaluations, and not how early it is reached.
    """

    def __init__(self, env: gymnasium.Env):
        """Wraps an environment.

        Args:
            env: environment whose info has "normalized_performance", such as one of
                `gymnasium.make`.
        """
        RecordConstructorArgs.__init__(self)
        super().__init__(env)
        self._reached = 0.0

    def reset(self, *, seed: int | None = None, options: dict[str, Any] | None = None):
        """Starts an episode; if it continues from a snapshot, rewards count from that state on."""
        observation, info = self.env.reset(seed=seed, options=options)
        self._reached = info["normalized_performance"]
        return observation, info

    def step(self, action: np.ndarray):
        """Applies an action; the reward is about -1 to 1."""
        observation, _, terminated, truncated, info = self.env.step(action)
        before, self._reached = self._reached, info["normalized_performance"]
        return observation, self._reached - before, terminated, truncated, info
