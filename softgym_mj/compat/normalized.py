"""`normalize`: SoftGym's wrapper with actions in [-1, 1]."""

from typing import Any

import gymnasium
import numpy as np

from softgym_mj.compat.actions import checked
from softgym_mj.compat.environment import OldEnv
from softgym_mj.compat.names import check_settings
from softgym_mj.envs.clipping import Clipping
from softgym_mj.validation import typed

FIXED = {  # Keyword arguments that have one value here.
    "normalize_obs": False, "normalize_reward": False, "obs_alpha": 0.001, "reward_alpha": 0.001,
}  # fmt: skip


class NormalizedEnv:
    """An environment with actions in [-1, 1]; everything else is as in `OldEnv`."""

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
            env: of `SOFTGYM_ENVS`.
            scale_reward: factor of rewards.
            clip: whether actions outside [-1, 1] are clipped, with a warning the first time; else
                they are refused.
            clip_obs: (low, high) that observations are clipped to.
            **fixed: `FIXED`.

        Raises:
            InvalidArgumentError: for a bad value; it names what to use instead.
        """
        check_settings(fixed, ("scale_reward", "clip", "clip_obs"), FIXED)
        self._wrapped_env, self._scale, self._clip = env, scale_reward, bool(clip)
        space = env.observation_space
        self._clip_obs = (space.low.min(), space.high.max()) if clip_obs is None else clip_obs
        self.action_space = gymnasium.spaces.Box(-1.0, 1.0, env.action_space.shape)
        self._clipped = Clipping(self.action_space)

    def __getattr__(self, name: str) -> Any:
        if name == "_wrapped_env":  # Of a copy in the making.
            raise AttributeError(name)
        return getattr(self._wrapped_env, name)

    @property
    def eval_flag(self) -> bool:
        """As of `OldEnv`; SoftGym's wrapper does not pass it on when it is set."""
        return self._wrapped_env.eval_flag

    @eval_flag.setter
    def eval_flag(self, value: bool) -> None:
        self._wrapped_env.eval_flag = value

    def denormalize(self, action: np.ndarray) -> np.ndarray:
        """The action (n,) in SoftGym's units."""
        box = self._wrapped_env.action_space
        low, high = box.low.astype(float), box.high.astype(float)
        action = self._clipped(action) if self._clip else action
        return low + (checked(action, self.action_space) + 1.0) / 2.0 * (high - low)

    def reset(self, **kwargs: Any) -> np.ndarray:
        """As `OldEnv.reset`: the observation (n,)."""
        return np.clip(self._wrapped_env.reset(**kwargs), *self._clip_obs)

    def step(self, action: np.ndarray, **kwargs: Any) -> tuple[np.ndarray, float, bool, dict]:
        """As `OldEnv.step`, with an action (n,) in [-1, 1]."""
        result = self._wrapped_env.step(self.denormalize(action), **kwargs)
        observation, reward, done, info = result
        return np.clip(observation, *self._clip_obs), self._scale * reward, done, info
