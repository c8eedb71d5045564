"""Teacher and student (Chen et al., 2020): a policy of images imitates one of states.

Only training needs the state, and only simulation trains: there the state is known. The teacher
learns by `sac`; the student learns from the teacher by `distill`, in the same environments and the
same training.
"""

import dataclasses
from collections.abc import Mapping
from typing import Any

import torch
from torch import Tensor, nn

from softgym_mj.exceptions import InvalidArgumentError, check_count
from softgym_mj.learning.learner import Learner, Problem, Step, check_random_steps
from softgym_mj.learning.methods.distill import Distill
from softgym_mj.learning.methods.students import Observation, StudentSettings
from softgym_mj.learning.registry import find_preset
from softgym_mj.validation import typed


@typed
@dataclasses.dataclass(frozen=True)
class TeacherStudentSettings(StudentSettings):
    """Settings of teacher and student.

    Attributes:
        teacher_settings: settings by name of the teacher, which has the preset "fast" of `sac`.
        teacher_env_steps: number of env steps of each seed from which the teacher learns; the
            student learns from those that follow.

    Raises:
        InvalidArgumentError: for a number out of range.
    """

    teacher_settings: Mapping[str, Any] = dataclasses.field(default_factory=dict)
    teacher_env_steps: int = 204_800

    def __post_init__(self):
        super().__post_init__()
        check_count("teacher_env_steps", self.teacher_env_steps, 1)


class TeacherStudent:
    """Teachers of several seeds, and a student of each.

    Attributes:
        teacher: the learner of the teachers, which takes the privileged observation alone.
        student: the learner of the students.
    """

    def __init__(self, settings: TeacherStudentSettings, problem: Problem, teacher: Learner):
        """Draws the students.

        Args:
            settings: how they learn.
            problem: learning problem.
            teacher: the learner of the teachers.
        """
        self._privileged, self.teacher = settings.privileged, teacher
        left = problem.env_steps - settings.teacher_env_steps
        own = dataclasses.replace(problem, env_steps=left)
        self.student = Distill(settings, own, self._labels)
        self._last = settings.teacher_env_steps // problem.num_envs  # Vector steps of the teachers.
        self._steps = 0

    def _labels(self, observation: Observation) -> Tensor:
        states = observation[self._privileged]
        first = torch.zeros(states.shape[:2], dtype=torch.bool, device=states.device)
        return self.teacher.act(states, first, None, explore=False)[0]

    @property
    def updates(self) -> int:
        """Number of updates of a teacher and its student together."""
        return self.teacher.updates + self.student.updates

    def act(
        self, observation: Observation, first: Tensor, memory: Any, *, explore: bool
    ) -> tuple[Tensor, Any]:
        """Returns actions (seeds, n, action); exploration starts with those of the teachers."""
        if explore and self._steps < self._last:
            return self.teacher.act(observation[self._privileged], first, memory, explore=True)
        if explore and self._steps == self._last:  # The student has not seen what came before.
            first, memory = torch.ones_like(first), None
        return self.student.act(observation, first, memory, explore=explore)

    def learn(self, step: Step) -> dict[str, Tensor]:
        """Updates the teachers, or later the students; returns their losses (seeds,) by name."""
        self._steps += 1
        if self._steps > self._last:
            return self.student.learn(step)
        before, after = (
            seen[self._privileged] for seen in (step.observation, step.next_observation)
        )
        return self.teacher.learn(step._replace(observation=before, next_observation=after))

    def policy(self, seed: int) -> nn.Module:
        """Returns the student of the seed at a place, on the CPU."""
        return self.student.policy(seed)

    def get_state(self) -> dict[str, Any]:
        """Returns all that `set_state` needs to continue with the same numbers."""
        return {
            "teacher": self.teacher.get_state(),
            "student": self.student.get_state(),
            "steps": self._steps,
        }

    def set_state(self, state: Mapping[str, Any]) -> None:
        """Continues from what `get_state` returned."""
        self.teacher.set_state(state["teacher"])
        self.student.set_state(state["student"])
        self._steps = state["steps"]


def make(settings: TeacherStudentSettings, problem: Problem) -> TeacherStudent:
    """Returns the learner of a problem.

    Raises:
        InvalidArgumentError: for a problem without images, or env steps that leave none for the
            student, or several privileged observations.
    """
    share = settings.teacher_env_steps
    if share % problem.num_envs or share >= problem.env_steps:
        valid = f"a multiple of {problem.num_envs} below {problem.env_steps}"
        raise InvalidArgumentError("teacher_env_steps", share, valid)
    own_settings = {"actor": problem.task_settings.get("actor"), **settings.teacher_settings}
    _, method = find_preset("sac", "fast", problem.task, **own_settings)
    check_random_steps(method.settings, share, problem.num_envs)
    if settings.privileged not in problem.shapes:
        raise InvalidArgumentError("privileged", settings.privileged, tuple(problem.shapes))
    own = dataclasses.replace(
        problem, observed=settings.privileged, observation=problem.shapes[settings.privileged],
        shapes={}, env_steps=share,
    )  # fmt: skip
    return TeacherStudent(settings, problem, method.make(method.settings, own))
