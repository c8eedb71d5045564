"""Teacher and student: who acts, who learns from what, a toy that only images tell the student."""

import pytest
import torch

from softgym_mj.exceptions import InvalidArgumentError
from softgym_mj.learning.learner import Step
from softgym_mj.learning.methods.teacher_student import TeacherStudent, TeacherStudentSettings, make
from tests.learning.test_distill import SMALL, problem, seen_at

NUM_ENVS, LAST = 16, 60  # Vector steps of the teacher.
TEACHER = {
    "random_steps": 64, "updates": 8, "batch": 64, "replay": 6_400, "hidden": (32, 32),
    "discount": 0.5, "actor_rate": 3e-3, "critic_rate": 3e-3, "alpha": 0.01, "symmetric": False,
}  # fmt: skip


def _learner(env_steps=NUM_ENVS * 110, **settings):
    own = {
        **SMALL, "hidden": (32,), "updates": 4, "batch": 64, "rate": 3e-3,
        "teacher_env_steps": NUM_ENVS * LAST,
    }  # fmt: skip
    found = TeacherStudentSettings(**own | settings, teacher_settings=TEACHER)
    return make(found, problem(env_steps=env_steps))


def _train(learner, number):
    """Each env step is an episode: go to the middle from where the bar is."""
    source = torch.Generator().manual_seed(0)
    first = torch.ones(1, NUM_ENVS, dtype=torch.bool)
    for _ in range(number):
        places = 1.8 * torch.rand(1, NUM_ENVS, 1, generator=source) - 0.9
        seen = seen_at(places)
        action, _ = learner.act(seen, first, None, explore=True)
        reward = -((action + places) ** 2)[..., 0]
        learner.learn(Step(seen, action, reward, seen, first, first))


def test_the_student_learns_from_images_what_its_teacher_learned_from_states():
    learner = _learner()
    places = torch.linspace(-0.8, 0.8, NUM_ENVS)[None, :, None]
    first = torch.ones(1, NUM_ENVS).bool()

    def miss(act, seen):
        return (act(seen, first, None, explore=False)[0] + places).abs().mean().item()

    before = miss(learner.act, seen_at(places))
    _train(learner, LAST)
    taught = learner.teacher.updates
    assert learner.student.updates == 0 and miss(learner.teacher.act, places) < 0.1
    _train(learner, 110 - LAST)
    assert learner.teacher.updates == taught and learner.updates == taught + 4 * (110 - LAST)
    assert before > 0.3 and miss(learner.act, seen_at(places)) < 0.12
    blind = {**seen_at(places), "markov": 0.0 * places}
    assert torch.equal(
        learner.act(blind, first, None, explore=False)[0],
        learner.act(seen_at(places), first, None, explore=False)[0],
    )


class _Fixed:
    """A teacher whose actions are 0.5, and -0.25 while it explores."""

    updates = 0

    def act(self, observation, first, memory, *, explore):
        return torch.full((*observation.shape[:2], 1), -0.25 if explore else 0.5), "memory"

    def learn(self, step):
        self.learned = step
        return {}


def test_teachers_act_alone_before_students_do_and_label_later():
    settings = TeacherStudentSettings(
        **SMALL, updates=1, batch=4, noise=0.0, wild_noise=0.0, teacher_share=1.0,
        teacher_until=1.0, teacher_env_steps=2 * NUM_ENVS,
    )  # fmt: skip
    teacher = _Fixed()
    learner = TeacherStudent(settings, problem(env_steps=6 * NUM_ENVS), teacher)
    first = torch.ones(1, NUM_ENVS, dtype=torch.bool)
    places, memory, found = torch.zeros(1, NUM_ENVS, 1), None, []
    for _ in range(4):
        action, memory = learner.act(seen_at(places), first, memory, explore=True)
        seen, none = seen_at(places), torch.zeros(1, NUM_ENVS)
        learner.learn(Step(seen, action, none, seen, none, none))
        first = torch.zeros_like(first)
        found.append(action[0, :, 0])
    assert (found[0] == -0.25).all() and (found[1] == -0.25).all()  # Explored by the teacher.
    assert (found[2] == 0.5).all()  # Labels, in all environments at first,
    assert (found[3] == 0.5).sum() == 12  # then in 1 - 1 / 4 of them.
    assert torch.equal(teacher.learned.observation, places)
    assert learner.student.frames.sample(0, 8)["label"].eq(0.5).all()


def test_env_steps_must_be_left_for_the_student():
    with pytest.raises(InvalidArgumentError, match="teacher_env_steps"):
        _learner(env_steps=NUM_ENVS * LAST)


def test_env_steps_must_be_left_for_the_teacher():
    with pytest.raises(InvalidArgumentError, match="random_steps"):
        _learner(teacher_env_steps=TEACHER["random_steps"])
