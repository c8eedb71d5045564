"""`GoalEnv`: Gymnasium wrapper with achieved and desired goals, for hindsight."""

from typing import Any

import gymnasium
import numpy as np
from gymnasium.utils import RecordConstructorArgs

from softgym_mj.envs.gymnasium_env import SoftGymEnv
from softgym_mj.exceptions import InvalidArgumentError
from softgym_mj.tasks.shared.goals import Goals, depends_on_goal, goals
from softgym_mj.tasks.shared.observations import STATES, shows_goal
from softgym_mj.validation import as_array, as_finite


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
            InvalidArgumentError: for another task, several observations, or images that show the
                goal.
        """
        RecordConstructorArgs.__init__(self)
        super().__init__(env)
        own = env.unwrapped
        if not isinstance(own, SoftGymEnv):
            raise InvalidArgumentError("env", own, "an environment of softgym_mj")
        task, names = own.dm_env.task, [*own.dm_env.observation_spec()]
        self._goals()
        if len(names) > 1 or not isinstance(env.observation_space, gymnasium.spaces.Box):
            raise InvalidArgumentError("observation", names, "a single observation")
        self._kept: Any = ...  # Of images, all.
        if names[0] in STATES:
            self._kept = np.flatnonzero(~depends_on_goal(task, names[0]))
        elif shows_goal(names, task.goal_marks):
            valid = "a state, or images without the goal, such as 'rgb' with goal_marks=False"
            raise InvalidArgumentError("observation", names[0], valid)
        seen = env.observation_space
        size = self._both()["desired_goal"].shape
        (self._size,) = size
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

        Raises:
            InvalidArgumentError: for goals of another shape, or that are not finite.
        """
        achieved, size = as_array("achieved_goal", achieved_goal), self._size
        if achieved.ndim not in (1, 2) or achieved.shape[-1] != size:
            valid = f"({size},) or (n, {size})"
            raise InvalidArgumentError("achieved_goal.shape", achieved.shape, valid)
        desired = as_finite("desired_goal", desired_goal, achieved.shape)
        return self._goals().reward(as_finite("achieved_goal", achieved), desired)

    def _goals(self) -> Goals:
        own: Any = self.unwrapped  # Copies of this wrapper have another one.
        return goals(own.dm_env.name, own.dm_env.task)

    def _seen(self, observation: np.ndarray) -> dict[str, np.ndarray]:
        return {**self._both(), "observation": observation[self._kept]}

    def _both(self) -> dict[str, np.ndarray]:
        own = self._goals()
        state, episode = own.task.state(), own.task.episode
        return {
            "achieved_goal": own.achieved(state, episode).copy(),
            "desired_goal": own.desired(state, episode).copy(),
        }
