"""`TrainingSettings`: settings of a training that do not depend on the method."""

import dataclasses
from collections.abc import Mapping
from typing import Any

from softgym_mj.exceptions import InvalidArgumentError, check_count, check_name, check_number
from softgym_mj.policies.exported import has_images
from softgym_mj.registry import find
from softgym_mj.tasks.shared.observations import names_of
from softgym_mj.validation import typed
from softgym_mj.variations.indices import SPLITS

OBSERVATIONS = ("reduced", "markov", "key_points", "full", "rgb")
# Arguments of a task that trainings set, and how.
_OWN = {
    "observation": "set this one by observation", "image_size": "set this one by image_size",
    "horizon": "set this one by episode_steps", "actor": "set this one by actor",
    "split": "learn from the training split",
}  # fmt: skip


@typed
@dataclasses.dataclass(frozen=True)
class TrainingSettings:
    """Settings of a training; numbers of env steps and environments are per seed.

    Attributes:
        task: Task name.
        observation: Observation of the policy: one of `OBSERVATIONS`, or, for methods that support
            it, names of several observations.
        image_size: Height and width of images [pixels].
        env_steps: Total number of env steps.
        num_envs: Number of environments.
        reward_scale: Factor of rewards.
        part: Env steps of a part, which ends with a checkpoint.
        evaluate_every: Parts between two evaluations; the last part is always evaluated.
        episodes: Episodes of each split in an evaluation.
        final_episodes: Episodes of each split in the last evaluation.
        fidelity: Fidelity of the task.
        episode_steps: Env steps of an episode; None for the task's.
        learned_steps: Env steps after which training episodes are truncated; None for none.
            Evaluations always run the full horizon.
        actor: Actor of the task; None for the default, also if its name is passed.
        arguments: Further keyword arguments of the task, also for evaluations.

    Raises:
        InvalidArgumentError: for a value out of range, or an argument that is a setting above.
        UnexpectedArgumentError: for an unknown argument of the task.
    """

    task: str
    observation: str | tuple[str, ...] = "reduced"
    image_size: tuple[int, int] = (128, 128)
    env_steps: int = 1_000_000
    num_envs: int = 50
    reward_scale: float = 50.0
    part: int = 50_000
    evaluate_every: int = 1
    episodes: int = 20
    final_episodes: int = 200
    fidelity: str = "default"
    episode_steps: int | None = None
    learned_steps: int | None = None
    actor: str | None = None
    arguments: Mapping[str, Any] = dataclasses.field(default_factory=dict)

    def __post_init__(self):
        for name, own in _OWN.items():
            if name in self.arguments:
                valid = f"other arguments of the task; trainings {own}"
                raise InvalidArgumentError("task settings", name, valid)
        find(self.task).check_arguments(self.arguments)
        if self.actor == find(self.task).resolve().actors[0]:
            object.__setattr__(self, "actor", None)
        if isinstance(self.observation, str):
            check_name("observation", self.observation, OBSERVATIONS)
        elif len({*self.observation}) < max(len(self.observation), 2):
            valid = "a name, or names of two or more different observations"
            raise InvalidArgumentError("observation", self.observation, valid)
        for name in ("env_steps", "num_envs", "part", "evaluate_every"):
            check_count(name, getattr(self, name), 1)
        check_number("reward_scale", self.reward_scale, gt=0.0)
        for name in ("episodes", "final_episodes"):
            check_count(name, getattr(self, name), 1, len(SPLITS["evaluate"]))
        for name in ("env_steps", "part"):
            if getattr(self, name) % self.num_envs:
                low = getattr(self, name) // self.num_envs * self.num_envs
                near = " or ".join(str(n) for n in (low, low + self.num_envs) if n)
                valid = f"a multiple of num_envs={self.num_envs}, such as {near}"
                raise InvalidArgumentError(name, getattr(self, name), valid)
        if self.learned_steps is not None:
            check_count("learned_steps", self.learned_steps, 1)
        if self.env_steps % self.part:
            valid = f"a multiple of part={self.part}, itself a multiple of num_envs={self.num_envs}"
            raise InvalidArgumentError("env_steps", self.env_steps, valid)

    @property
    def observations(self) -> tuple[str, ...]:
        """Names of the policy's observations."""
        return names_of(self.observation)

    @property
    def observed(self) -> dict[str, Any]:
        """Arguments of the task that set the observation of the policy."""
        sized = {"image_size": self.image_size} if has_images(self.observations) else {}
        several = [*self.observations] if len(self.observations) > 1 else self.observations[0]
        return {"observation": several, **sized}

    @property
    def parts(self) -> int:
        """Number of parts."""
        return self.env_steps // self.part

    @property
    def task_settings(self) -> dict[str, Any]:
        """Keyword arguments of the task."""
        named = {"horizon": self.episode_steps, "actor": self.actor}
        result = {name: value for name, value in named.items() if value is not None}
        if "fidelity" in find(self.task).arguments:
            result["fidelity"] = self.fidelity
        return {**result, **self.arguments}
