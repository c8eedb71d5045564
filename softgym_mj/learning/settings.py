"""`TrainingSettings`: what is learned, whatever the method."""

import dataclasses
from collections.abc import Mapping
from typing import Any

from softgym_mj.exceptions import InvalidArgumentError, check_count, check_name
from softgym_mj.policies.exported import has_images
from softgym_mj.registry import find
from softgym_mj.validation import typed
from softgym_mj.variations.indices import SPLITS

OBSERVATIONS = ("reduced", "markov", "full", "rgb")
# Arguments of a task that trainings set themselves, and by which of their settings.
_OWN = {
    "observation": "observation", "image_size": "image_size", "horizon": "episode_steps",
    "split": "none: they learn from the training split",
}  # fmt: skip


@typed
@dataclasses.dataclass(frozen=True)
class TrainingSettings:
    """What is learned, and from how much.

    Attributes:
        task: its name.
        observation: what the policy observes: one of `OBSERVATIONS`, or names of several
            observations of the task, for methods that take them.
        image_size: height and width of images [pixels].
        env_steps: of each seed, in all.
        num_envs: environments of each seed.
        reward_scale: factor to rewards.
        part: env steps of each seed between two checkpoints.
        evaluate_every: parts from an evaluation to the next; the last one is evaluated, too.
        episodes: of each split in an evaluation.
        final_episodes: of each split in the last one.
        fidelity: of the task.
        episode_steps: env steps of an episode; None for the task's own.
        learned_steps: env steps after which an episode that is learned from is left for another
            one, while its value goes on; None for all of it. Evaluations play all of it.
        actor: of the task.
        arguments: further keyword arguments of the task, such as domain, action, action_repeat,
            fidelity or actor; evaluations have them as well.

    Raises:
        InvalidArgumentError: for numbers out of range, or an argument that has a setting above.
        UnexpectedArgumentError: for an argument that the task does not have.
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
                valid = f"other arguments of the task; the setting of a training for it is {own}"
                raise InvalidArgumentError("task settings", name, valid)
        find(self.task).check_arguments(self.arguments)
        if isinstance(self.observation, str):
            check_name("observation", self.observation, OBSERVATIONS)
        elif len({*self.observation}) < max(len(self.observation), 2):
            valid = "a name, or names of two or more different observations"
            raise InvalidArgumentError("observation", self.observation, valid)
        for name in ("env_steps", "num_envs", "evaluate_every"):
            check_count(name, getattr(self, name), 1)
        for name in ("episodes", "final_episodes"):
            check_count(name, getattr(self, name), 1, len(SPLITS["evaluate"]))
        for name in ("env_steps", "part"):
            if getattr(self, name) % self.num_envs:
                raise InvalidArgumentError(
                    name, getattr(self, name), f"{self.num_envs} times a number"
                )
        if self.learned_steps is not None:
            check_count("learned_steps", self.learned_steps, 1)
        if self.env_steps % self.part:
            raise InvalidArgumentError("env_steps", self.env_steps, f"{self.part} times a number")

    @property
    def observations(self) -> tuple[str, ...]:
        """Names of what the policy observes."""
        return (self.observation,) if isinstance(self.observation, str) else self.observation

    @property
    def observed(self) -> dict[str, Any]:
        """What the policy observes, as arguments of the task."""
        sized = {"image_size": self.image_size} if has_images(self.observations) else {}
        several = [*self.observations] if len(self.observations) > 1 else self.observations[0]
        return {"observation": several, **sized}

    @property
    def parts(self) -> int:
        """How many there are."""
        return self.env_steps // self.part

    @property
    def task_settings(self) -> dict[str, Any]:
        """Keyword arguments of the task."""
        named = {"horizon": self.episode_steps, "actor": self.actor}
        result = {name: value for name, value in named.items() if value is not None}
        if "fidelity" in find(self.task).arguments:
            result["fidelity"] = self.fidelity
        return {**result, **self.arguments}
