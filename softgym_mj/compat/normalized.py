"""`normalize`: SoftGym's wrapper with actions in [-1, 1]."""

from typing import Any

import gymnasium
import numpy as np

from softgym_mj.compat.actions import checked
from softgym_mj.compat.environment import OldEnv
from softgym_mj.compat.names import check_settings
from softgym_mj.envs.clipping import Clipping
from softgym_mj.validation import typed

FIXED = {  # Keyword arguments that have a single value here.
    "normalize_obs": False, "normalize_reward": False, "obs_alpha": 0.001, "reward_alpha": 0.001,
}  # fmt: skip


class NormalizedEnv:
    """Environment with SoftGym's interface and actions in [-1, 1]; all else is as in `OldEnv`."""

    @typed
    def __init__(
        self,
        env: OldEnv,
        scale_reward: float = 1.0,
        *,
        clip: bool | int = True,
        clip_obs: tuple[float, float] | None = None,
        **fixed: Any,
    ):
        """Wraps an environment.

        Args:
            env: Environment of `SOFTGYM_ENVS`.
            scale_reward: Factor of rewards.
            clip: Whether actions outside [-1, 1] are clipped, with a warning the first time;
                otherwise they raise an error.
            clip_obs: Bounds (low, high) to which observations are clipped.
            **fixed: Arguments of `FIXED`.

        Raises:
            InvalidArgumentError: for a bad value; the message names the replacement.
        """
        check_settings(fixed, ("scale_reward", "clip", "clip_obs"), FIXED)
        self._wrapped_env, self._scale, self._clip = env, scale_reward, bool(clip)
        space = env.observation_space
        self._clip_obs = (space.low.min(), space.high.max()) if clip_obs is None else clip_obs
        self.action_space = gymnasium.spaces.Box(-1.0, 1.0, env.action_space.shape)
        self._clipped = Clipping(self.action_space)

    def __getattr__(self, name: str) -> Any:
        if name == "_wrapped_env":  # A copy that is not initialized yet.
            raise AttributeError(name)
        return getattr(self._wrapped_env, name)

    @property
    def eval_flag(self) -> bool:
        """Whether resets draw from the evaluation variations; SoftGym's wrapper cannot set it."""
        return self._wrapped_env.eval_flag

    @eval_flag.setter
    def eval_flag(self, value: bool) -> None:
        self._wrapped_env.eval_flag = value

    def denormalize(self, action: np.ndarray) -> np.ndarray:
        """Converts an action (n,) in [-1, 1] to SoftGym's units."""
        box = self._wrapped_env.action_space
        low, high = box.low.astype(float), box.high.astype(float)
        action = self._clipped(action) if self._clip else action
        return low + (checked(action, self.action_space) + 1.0) / 2.0 * (high - low)

    def reset(self, **kwargs: Any) -> np.ndarray:
        """Starts an episode, as `OldEnv.reset`; returns the observation (n,)."""
        return np.clip(self._wrapped_env.reset(**kwargs), *self._clip_obs)

    def step(self, action: np.ndarray, **kwargs: Any) -> tuple[np.ndarray, float, bool, dict]:
        """Applies an action (n,) in [-1, 1]; returns observation, reward, done and info."""
        result = self._wrapped_env.step(self.denormalize(action), **kwargs)
        observation, reward, done, info = result
        return np.clip(observation, *self._clip_obs), self._scale * reward, done, info
