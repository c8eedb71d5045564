"""`Explorer`: the environments in which the seeds of a training explore."""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
import torch
from torch import Tensor

from softgym_mj.learning.learner import Problem, Step, split_by_seed
from softgym_mj.learning.networks import where
from softgym_mj.learning.settings import TrainingSettings

_PARTS = 1_000_003  # Separates the seeds of environments of different parts.


def problem_of(settings: TrainingSettings, seeds: Sequence[int], envs: Any, device: str) -> Problem:
    """Returns the learning problem of vector environments: sizes, seeds and PyTorch device."""
    space = envs.single_observation_space
    shapes = {name: each.shape for name, each in getattr(space, "spaces", {}).items()}
    return Problem(
        settings.task, settings.task_settings, seeds, settings.num_envs, space.shape or (),
        envs.single_action_space.shape[-1], settings.reward_scale, device, settings.observation,
        shapes, settings.env_steps,
    )  # fmt: skip


class Explorer:
    """Environments of all seeds, which reset at the end of an episode."""

    def __init__(self, problem: Problem, envs: Any, device: str):
        """Sets the environments.

        Args:
            problem: Learning problem.
            envs: Vector environment of seeds * num_envs environments, with same-step autoreset.
            device: Device of the environments.
        """
        self._problem, self._envs, self._device = problem, envs, device
        self._scores: tuple[Any, Any] | None = None  # Sums since the last call of `scores`.

    def begin(self, part: int, actions: Sequence[Tensor]) -> tuple[Tensor, Tensor]:
        """Starts the episodes of a part of a training and replays the actions already taken in it.

        Args:
            part: Number of earlier parts.
            actions: Actions (seeds, num_envs, n) of the part so far.

        Returns:
            Observations, and whether each is the first of an episode (seeds, num_envs).
        """
        seeds, number = self._problem.seeds, self._problem.num_envs
        firsts = [(seed * _PARTS + part) * number for seed in seeds]
        each = [first + i for first in firsts for i in range(number)]
        seen, _ = self._envs.reset(seed=each, options={"stagger": number})
        observation = self._split(seen)
        first = torch.ones(len(seeds), number, dtype=torch.bool, device=self._problem.device)
        for action in actions:
            seen, _, terminated, truncated, _ = self._envs.step(self.env_actions(action))
            observation = self._split(seen)
            first = self._split(terminated) | self._split(truncated)
        return observation, first

    def step(
        self, observation: Tensor, action: Tensor, is_last: bool
    ) -> tuple[Step, Tensor, Tensor]:
        """Steps all environments.

        Args:
            observation: Observations before the step (seeds, num_envs, ...).
            action: Actions (seeds, num_envs, n).
            is_last: Whether the part ends with this step.

        Returns:
            The step to learn from, the next observations, and whether each is the first of an
            episode (seeds, num_envs).
        """
        seen, rewards, terminated, truncated, infos = self._envs.step(self.env_actions(action))
        self._note_scores(infos)
        following, terminated = self._split(seen), self._split(terminated)
        ended = terminated | self._split(truncated)
        step = Step(
            observation, action,
            self._problem.reward_scale * self._split(rewards).float(),
            self._last(following, infos), terminated, ended | is_last,
        )  # fmt: skip
        return step, following, ended

    def scores(self) -> dict[str, Tensor]:
        """Returns mean scores (seeds,) of episodes that ended since the last call, by name."""
        if self._scores is None:
            return {}
        (total, number), self._scores = self._scores, None
        return {"explored/normalized_performance": total / number}  # NaN without episodes.

    def env_actions(self, action: Tensor) -> Any:
        """Converts actions (seeds, num_envs, n) to those of the vector environment."""
        flat = action.flatten(0, 1)
        return flat if self._device == "cuda" else flat.cpu().numpy()

    def _split(self, array: Any) -> Any:
        return split_by_seed(self._problem, array)

    def _note_scores(self, infos: Mapping[str, Any]) -> None:
        """Adds scores of finished episodes to sums and counts (seeds,)."""
        if "final_info" not in infos:
            return
        ended = self._split(infos["_final_info"])
        scores = self._split(infos["final_info"]["normalized_performance"])
        now = torch.where(ended, scores, 0.0).sum(dim=1), ended.sum(dim=1)
        before = self._scores or (0.0, 0)
        self._scores = before[0] + now[0], before[1] + now[1]

    def _last(self, following: Any, infos: Mapping[str, Any]) -> Any:
        """Returns final observations of finished episodes, next observations of others."""
        if "final_obs" not in infos:
            return following
        return self._replaced(following, infos["final_obs"], infos["_final_obs"])

    def _replaced(self, following: Any, final: Any, ended: Any) -> Any:
        if isinstance(following, Mapping):
            parts = {
                name: final[name]
                if isinstance(final, Mapping)
                else [each and each[name] for each in final]
                for name in following
            }
            return {n: self._replaced(seen, parts[n], ended) for n, seen in following.items()}
        if isinstance(final, Tensor):
            return where(self._split(ended), self._split(final), following)
        result = following.clone().flatten(0, 1)
        for i in np.flatnonzero(ended).tolist():
            result[i] = torch.as_tensor(final[i])
        return result.reshape(following.shape)
