"""Gymnasium environment with LeRobot's observations, info and attributes."""

from collections.abc import Mapping
from typing import Any

import gymnasium
import numpy as np
from lerobot.envs.utils import NEW_ROLLOUT_OPTION
from lerobot.utils.constants import OBS_ENV_STATE, OBS_IMAGES, OBS_STATE, OBS_STR

from softgym_mj import registry
from softgym_mj.envs.gymnasium_env import SoftGymEnv, space_of
from softgym_mj.recording.lerobot_format import FrameRate, observed
from softgym_mj.robots.base import Actor

PIXELS = "pixels"
# LeRobot's names in environments of its features in datasets.
NAMES = {OBS_STATE: "agent_pos", OBS_ENV_STATE: "environment_state"}


def converted(observations: Mapping[str, np.ndarray], actor: Actor) -> dict[str, Any]:
    """Returns a batch of observations (n, ...) under LeRobot's names.

    LeRobot's `preprocess_observation` maps them to the features of recorded datasets: "agent_pos"
    to "observation.state", "environment_state" to "observation.environment_state", images
    "pixels" by camera to "observation.images.CAMERA", others such as "depth" to
    "observation.depth".
    """
    result: dict[str, Any] = {}
    for key, column in observed(observations, actor).items():
        if key.startswith(f"{OBS_IMAGES}."):
            result.setdefault(PIXELS, {})[key.removeprefix(f"{OBS_IMAGES}.")] = column.values
        else:
            result[NAMES.get(key, key.removeprefix(f"{OBS_STR}."))] = column.values
    return result


class LeRobotEnv(gymnasium.Wrapper):
    """`SoftGymEnv` as LeRobot's rollouts expect it.

    `info["is_success"]` is False before the last env step of an episode, because LeRobot counts
    an episode as successful if any step is. Its success rate is thus that of
    `softgym-mj evaluate`.

    Attributes:
        task: Name of the task.
        task_description: Goal of the task, the "task" of recorded datasets.
    """

    def __init__(self, env: SoftGymEnv):
        """Wraps an environment."""
        super().__init__(env)
        self._dm_env = env.dm_env
        record = registry.find(env.dm_env.name)
        self.task, self.task_description = record.name, record.summary or record.name
        self._max_episode_steps = env.horizon  # LeRobot reads this name.
        self.metadata = {**env.metadata, "render_fps": FrameRate(env.metadata["render_fps"])}
        specs = env.dm_env.observation_spec()
        zeros = {name: np.zeros(spec.shape, space_of(spec).dtype) for name, spec in specs.items()}
        self._names = tuple(specs)
        self.observation_space = _space(self.observation(zeros))

    def observation(self, seen: Mapping[str, np.ndarray] | np.ndarray) -> dict[str, Any]:
        """Returns an observation of `SoftGymEnv` under LeRobot's names."""
        named = seen if isinstance(seen, Mapping) else {self._names[0]: seen}
        batch = converted({k: v[None] for k, v in named.items()}, self._dm_env.task.actor)
        return {
            name: {k: image[0] for k, image in part.items()} if name == PIXELS else part[0]
            for name, part in batch.items()
        }

    def reset(self, *, seed: int | None = None, options: dict[str, Any] | None = None):
        """Starts an episode.

        Args:
            seed: Number of a variation in the split, modulo its size; None draws one. The 200
                seeds from 1000 on, LeRobot's default, are the 200 evaluation variations.
            options: Options of `SoftGymEnv.reset`.
        """
        options = {k: v for k, v in (options or {}).items() if k != NEW_ROLLOUT_OPTION}
        if seed is not None and not options:
            variations = self._dm_env.variations
            options["variation"] = int(variations[seed % len(variations)])
        seen, info = self.env.reset(seed=seed, options=options)
        return self.observation(seen), {**info, "is_success": np.asarray(False)}

    def step(self, action: np.ndarray):
        """Applies an action (n,), which is clipped to [-1, 1]."""
        seen, reward, terminated, truncated, info = self.env.step(action)
        info["is_success"] = np.asarray((terminated or truncated) and bool(info["success"]))
        return self.observation(seen), reward, terminated, truncated, info


def _space(value: Any) -> gymnasium.Space:
    """Returns the space of an observation, which may be nested."""
    if isinstance(value, dict):
        return gymnasium.spaces.Dict({key: _space(part) for key, part in value.items()})
    low, high = (0, 255) if value.dtype == np.uint8 else (-np.inf, np.inf)
    return gymnasium.spaces.Box(low, high, value.shape, value.dtype.type)


def make(**settings: Any) -> LeRobotEnv:
    """Makes an environment; the arguments are those of `SoftGymEnv`."""
    return LeRobotEnv(SoftGymEnv(**settings))
