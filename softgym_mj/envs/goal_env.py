"""`GoalEnv`: Gymnasium wrapper with achieved and desired goals, for hindsight."""

from typing import Any

import gymnasium
import numpy as np
from gymnasium.utils import RecordConstructorArgs

from softgym_mj.envs.gymnasium_env import SoftGymEnv
from softgym_mj.exceptions import InvalidArgumentError
from softgym_mj.tasks.shared.goals import depends_on_goal, goals
from softgym_mj.tasks.shared.observations import STATES
from softgym_mj.validation import as_array


class GoalEnv(gymnasium.Wrapper, RecordConstructorArgs):
    """Wrapper with the interface of Gymnasium-Robotics' `GoalEnv`, for tasks that draw their goal.

    Observations are a Dict: "observation", the environment's without the entries of the goal;
    "achieved_goal" and "desired_goal" (k,) float64, which `compute_reward` compares. For
    `rope_configuration` these are positions and goal positions of the rope's vertices [m], for
    `pour_water_amount` the poured share of the water and the share to pour.
    """

    def __init__(self, env: gymnasium.Env):
        """Wraps an environment.

        Args:
            env: environment with one observation, such as
                `gymnasium.make("softgym_mj/RopeConfiguration-v0")`.

        Raises:
            InvalidArgumentError: for another task, or several observations.
        """
        RecordConstructorArgs.__init__(self)
        super().__init__(env)
        own = env.unwrapped
        if not isinstance(own, SoftGymEnv):
            raise InvalidArgumentError("env", own, "an environment of softgym_mj")
        self._env = own.dm_env
        self._goals = goals(self._env.name, self._env.task)
        names = [*self._env.observation_spec()]
        if len(names) > 1 or not isinstance(env.observation_space, gymnasium.spaces.Box):
            raise InvalidArgumentError("observation", names, "a single observation")
        self._kept: Any = ...  # Images do not contain the goal.
        if names[0] in STATES:
            self._kept = np.flatnonzero(~depends_on_goal(self._env.task, names[0]))
        seen = env.observation_space
        size = self._both()["desired_goal"].shape
        self.observation_space = gymnasium.spaces.Dict(
            {
                "achieved_goal": gymnasium.spaces.Box(-np.inf, np.inf, size, np.float64),
                "desired_goal": gymnasium.spaces.Box(-np.inf, np.inf, size, np.float64),
                "observation": gymnasium.spaces.Box(
                    seen.low[self._kept], seen.high[self._kept], dtype=seen.dtype.type
                ),
            }
        )

    def reset(self, *, seed: int | None = None, options: dict[str, Any] | None = None):
        """Starts an episode as `SoftGymEnv.reset` does; returns the Dict observation and info."""
        observation, info = self.env.reset(seed=seed, options=options)
        return self._seen(observation), info

    def step(self, action: np.ndarray):
        """Applies an action as `SoftGymEnv.step` does; returns the Dict observation and so on."""
        observation, *rest = self.env.step(action)
        return self._seen(observation), *rest

    def compute_reward(self, achieved_goal: np.ndarray, desired_goal: np.ndarray, info: Any) -> Any:
        """Returns the task's rewards for achieved and desired goals.

        Args:
            achieved_goal, desired_goal: (k,), or (n, k) for n rewards.
            info: ignored.

        Returns:
            A number, or (n,).
        """
        goals = {"achieved_goal": achieved_goal, "desired_goal": desired_goal}
        return self._goals.reward(*(as_array(name, goal) for name, goal in goals.items()))

    def _seen(self, observation: np.ndarray) -> dict[str, np.ndarray]:
        return {**self._both(), "observation": observation[self._kept]}

    def _both(self) -> dict[str, np.ndarray]:
        state, episode = self._env.task.state(), self._env.task.episode
        return {
            "achieved_goal": self._goals.achieved(state, episode),
            "desired_goal": self._goals.desired(state, episode),
        }
