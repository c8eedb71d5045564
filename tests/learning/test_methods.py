"""Contract of all methods: killed trainings end with the same bits, seeds learn as alone."""

import dataclasses

import pytest
import torch

from softgym_mj.exceptions import InvalidArgumentError
from softgym_mj.learning import training as module
from softgym_mj.learning.registry import METHODS, find_method
from softgym_mj.learning.settings import TrainingSettings
from softgym_mj.learning.training import POLICY, Training
from softgym_mj.policies.exported import has_images
from tests.learning.test_training import Killed, rows_of
from tests.vector.same import same

SEEDS = [4, 9]
ROPE = TrainingSettings(
    "straighten_rope", env_steps=24, num_envs=2, part=8, evaluate_every=3, episodes=1,
    final_episodes=1, fidelity="fast", episode_steps=6,
)  # fmt: skip
PIXELS = dataclasses.replace(ROPE, observation="rgb", image_size=(36, 38))
OFF_POLICY = {"random_steps": 8, "updates": 2, "batch": 8, "replay": 24, "hidden": (8,)}
IMAGES = {**OFF_POLICY, "channels": 4, "features": 6}
# Settings of the training and of the method.
CASES = {
    "sac": (
        dataclasses.replace(ROPE, part=12, evaluate_every=2),
        {**OFF_POLICY, "actor_every": 2, "n_step": 2, "symmetric": True, "discount": 0.9,
         "final_discount": 0.99, "discount_schedule": (4, 20)},
    ),
    "tqc": (ROPE, {**OFF_POLICY, "critics": 2, "quantiles": 3, "dropped": 1, "symmetric": True}),
    "curl": (PIXELS, {**IMAGES, "crop": 30}),
    "drq": (PIXELS, {**IMAGES, "pad": 1}),
    "distill": (
        dataclasses.replace(PIXELS, observation=("rgb", "held")),
        {"updates": 2, "batch": 4, "buffer": 10, "channels": 4, "features": 6, "hidden": (8,)},
    ),
    "teacher_student": (
        dataclasses.replace(PIXELS, observation=("rgb", "held")),
        {"updates": 2, "batch": 4, "buffer": 10, "channels": 4, "features": 6, "hidden": (8,),
         "teacher_env_steps": 12,
         "teacher_settings": {**OFF_POLICY, "random_steps": 4, "symmetric": True}},
    ),
}  # fmt: skip


# Methods with the networks of drq and of distill.
SAME_POLICIES = ("curl", "teacher_student")
LONG = (*SAME_POLICIES, "wu")  # The others have their learners and more.


@pytest.fixture(
    name="train",
    scope="module",
    params=[pytest.param(name, marks=pytest.mark.long if name in LONG else ()) for name in METHODS],
)
def _train(request, tmp_path_factory):
    """Makes trainings of a method in folders by name."""
    settings, own = _case(request.param)
    root = tmp_path_factory.mktemp(request.param)
    if request.param == "distill":
        teacher = torch.nn.Sequential(torch.nn.Linear(44, 8), torch.nn.Tanh())
        torch.export.save(torch.export.export(teacher, (torch.zeros(1, 44),)), root / "teacher.pt2")
        own = {**own, "teacher": str(root / "teacher.pt2")}
    method = find_method(request.param, **own)
    return lambda name, seeds=SEEDS: Training(settings, method, seeds, root / name, "host")


@pytest.fixture(name="whole", scope="module")
def _whole(train):
    """A training that ran to its end; policies of images are exported once for each network."""
    training = train("whole")
    with pytest.MonkeyPatch.context() as patch:
        if training.method.name in SAME_POLICIES:
            patch.setattr(module, "export_policy", lambda *_: b"")
        training.run()
    return training


def _case(name):
    """Settings of a training and of its method; of larger ones, those of their own tests."""
    if name in CASES:
        return CASES[name]
    from tests.learning import test_planet, test_wu

    own = {"planet": test_planet, "wu": test_wu}[name]
    return own.SETTINGS, dataclasses.asdict(own.METHOD.settings)


def _observations(problem, number):
    """Random observations (1, number, ...), several by name."""
    if problem.shapes:
        own = {n: dataclasses.replace(problem, observation=s, shapes={})
               for n, s in problem.shapes.items()}  # fmt: skip
        return {name: _observations(each, number) for name, each in own.items()}
    shape = 1, number, *problem.observation
    if len(shape) > 3:
        return torch.randint(0, 256, shape, dtype=torch.uint8)
    return torch.randn(shape)


def _best(training, seen):
    """Actions (seeds, number, ...) of all seeds, of which each sees the same."""
    number, seeds = len(training.seeds), {}
    if isinstance(seen, dict):
        seeds = {name: each.expand(number, *each.shape[1:]) for name, each in seen.items()}
        first = torch.ones(next(iter(seeds.values())).shape[:2], dtype=torch.bool)
    else:
        seeds = seen.expand(number, *seen.shape[1:])
        first = torch.ones(seeds.shape[:2], dtype=torch.bool)
    return training.learner.act(seeds, first, None, explore=False)[0]


def test_a_training_that_was_killed_ends_alike(train, whole, no_policies, monkeypatch):
    """It is killed within its second part; `test_training` kills between parts."""
    part, num_envs = whole.settings.part, whole.settings.num_envs

    def kill(training, news):
        if training.env_steps == part + 2 * num_envs:
            raise Killed

    assert whole.learner.updates > 0 and len(whole.rows) == 2 * len(SEEDS)
    monkeypatch.setattr(module, "KEEP_SECONDS", -1.0)  # A checkpoint after each vector step.
    monkeypatch.setattr(module, "KEEP_RATIO", 0.0)
    with pytest.raises(Killed):  # Before the checkpoint of its last vector step is written.
        train("killed").run(kill, points=whole.settings.env_steps)
    again, starts = train("killed"), []
    again.run(on_start=lambda now: starts.append(now.env_steps))
    assert starts == [part + num_envs]
    assert rows_of(again) == rows_of(whole)
    assert same(again.learner.get_state(), whole.learner.get_state())


def test_a_policy_file_acts_as_the_learner(whole):
    file = whole.folder / POLICY.format(seed=SEEDS[1])
    assert file.exists() == (whole.method.name not in ("planet", "wu"))  # These have memory.
    if not file.exists() or has_images(whole.settings.observations):
        return
    seen, policy = _observations(whole._problem, 3), torch.export.load(file).module()
    for k, expected in enumerate(_best(whole, seen)[1]):
        result = policy(seen[0, k : k + 1])
        torch.testing.assert_close(result[0], expected, rtol=1e-4, atol=1e-5)


def test_seeds_together_learn_what_each_learns_alone(train, whole, no_policies):
    alone = train("alone", SEEDS[1:])
    alone.run()
    seen = _observations(alone._problem, 3)
    expected, result = _best(whole, seen), _best(alone, seen)
    torch.testing.assert_close(result[0], expected[1], rtol=0, atol=1e-5)
    assert (expected[0] - expected[1]).abs().max() > 1e-2


# Values of settings that are refused by name.
BAD_SETTINGS = {
    "sac": [
        ("tau", 0.0), ("discount", 1.5), ("actor_every", 0), ("target_entropy", 0.7),
    ],
    "tqc": [("critics", 0), ("quantiles", 0), ("dropped", 25)],
    "curl": [("crop", 14), ("encoder_rate", 0.0), ("encoder_tau", 1.5)],
    "drq": [("pad", -1)],
    "wu": [("channels", (0,)), ("best_share", 0.0), ("symmetric", True)],
    "distill": [("frames", 0), ("batch", 0), ("shift", -1), ("teacher_share", 1.5)],
    "planet": [
        ("bits", 9), ("elites", 1001), ("length", 1), ("rate", 0.0), ("noise", -1.0), ("batch", 0)
    ],
    "teacher_student": [("teacher_env_steps", 0), ("batch", 0), ("teacher_share", 1.5)],
}  # fmt: skip


@pytest.mark.parametrize("method", METHODS)
def test_bad_settings_are_refused_by_name(method):
    for name, value in BAD_SETTINGS[method]:
        with pytest.raises(InvalidArgumentError, match=name):
            find_method(method, **{name: value})
