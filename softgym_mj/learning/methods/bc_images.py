"""Behavior cloning from images: trains students of `distill` on episodes of the expert.

Unlike `distill` it collects no states of the student (no DAgger). It suits tasks without a good
state policy as a teacher.
"""

import dataclasses
from collections.abc import Mapping
from typing import Any

import torch
from torch import Tensor

from softgym_mj.learning.demonstrations import check_demonstrations, collect_images
from softgym_mj.learning.frames import Frames
from softgym_mj.learning.learner import Problem, Step
from softgym_mj.learning.methods.distill import LABEL, Distill
from softgym_mj.learning.methods.students import StudentSettings
from softgym_mj.recording.noise import check_noise
from softgym_mj.validation import typed

_NOTHING = Step(*[torch.zeros(())] * 6)  # `Distill` ignores the step: it learns from its frames.


@typed
@dataclasses.dataclass(frozen=True)
class BCImagesSettings(StudentSettings):
    """Settings of behavior cloning from images.

    Attributes:
        privileged, buffer: Unused.
        demonstrations: Number of the expert's episodes.
        jobs: Number of processes that play them; None for the number of cores.
        demonstration_noise: Standard deviation of the noise on applied actions, as in
            `recording.record`; labels are the expert's own actions.

    Raises:
        InvalidArgumentError: for a value out of range.
    """

    privileged: str = ""
    updates: int = 1
    buffer: int = 1_000_000
    demonstrations: int = 200
    jobs: int | None = None
    demonstration_noise: float = 0.0

    def __post_init__(self):
        super().__post_init__()
        check_demonstrations(self.demonstrations, self.jobs)
        check_noise(self.demonstration_noise)


class _Shown(Frames):
    """Frames of cached demonstrations; their state has only random generators."""

    def get_state(self) -> dict[str, Any]:
        return {"random": [source.get_state() for source in self.sources]}

    def set_state(self, state: Mapping[str, Any]) -> None:
        for source, saved in zip(self.sources, state["random"], strict=True):
            source.set_state(saved)


class BCImages(Distill):
    """`Offline` learner of behavior cloning from images.

    Attributes:
        demonstrated: Number of demonstrated env steps.
    """

    FRAMES = _Shown

    def __init__(self, settings: BCImagesSettings, problem: Problem, shown: Mapping[str, Tensor]):
        """Draws the students and stores the demonstrations.

        Args:
            settings: Settings of the students.
            problem: Learning problem.
            shown: Observations and actions (`LABEL`) of the expert (episodes, steps, ...) by name.
        """
        episodes, steps = shown[LABEL].shape[:2]
        self.demonstrated = episodes * steps
        # One update for each vector step of the whole training.
        total = problem.env_steps // problem.num_envs * episodes
        own = dataclasses.replace(problem, num_envs=episodes, env_steps=total)
        whole = dataclasses.replace(settings, buffer=self.demonstrated)
        super().__init__(whole, own, lambda states: states)
        for t in range(steps):
            first = torch.full((len(problem.seeds), episodes), t == 0, device=problem.device)
            self.frames.add({name: array[:, t] for name, array in shown.items()}, first)

    def act(
        self, observation: Any, first: Tensor, memory: Any, *, explore: bool
    ) -> tuple[Tensor, Any]:
        """Returns actions and stacks of images; a single observation is an array without a name."""
        if isinstance(observation, Tensor):
            observation = {str(self._problem.observed): observation}
        return super().act(observation, first, memory, explore=explore)

    def update_offline(self) -> dict[str, Tensor]:
        """Updates the students; returns their last losses (seeds,)."""
        return self.learn(_NOTHING)


def make(settings: BCImagesSettings, problem: Problem) -> BCImages:
    """Creates the learner of a problem, after collecting missing demonstrations."""
    if not problem.shapes:
        shapes = {str(problem.observed): problem.observation}
        problem = dataclasses.replace(problem, shapes=shapes)
    own = settings.demonstrations, settings.jobs, settings.demonstration_noise
    observations, actions = collect_images(problem, *own)
    return BCImages(settings, problem, {**observations, LABEL: actions})
