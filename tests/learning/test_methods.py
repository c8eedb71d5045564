"""What all methods have in common: a training that was killed ends with the same bits."""

import dataclasses

import pytest
import torch

from softgym_mj.learning import training as module
from softgym_mj.learning.registry import METHODS, find_method
from softgym_mj.learning.settings import TrainingSettings
from softgym_mj.learning.training import POLICY, Training
from softgym_mj.policies.exported import has_images

SEEDS = [4, 9]
ROPE = TrainingSettings(
    "straighten_rope", env_steps=24, worlds=2, part=8, evaluate_every=3, episodes=1,
    final_episodes=1, fidelity="fast", episode_steps=6,
)  # fmt: skip
PIXELS = dataclasses.replace(ROPE, observation="rgb", image_size=(36, 38))
GOALS = dataclasses.replace(ROPE, task="rope_configuration", observation="full")
OFF_POLICY = {"random_steps": 8, "updates": 2, "batch": 8, "replay": 24, "hidden": (8,)}
IMAGES = {**OFF_POLICY, "channels": 4, "features": 6}
SHOWN = {"demonstrations": 2, "jobs": 1}
# Settings of the training and of the method.
CASES = {
    "sac": (ROPE, {**OFF_POLICY, "added": 2, "symmetric": True, "averaged": True}),
    "sac_hindsight": (GOALS, {**OFF_POLICY, "symmetric": True}),
    "sac_points": (GOALS, {**OFF_POLICY, "points": (8, 8), "symmetric": True}),
    "rlpd": (
        dataclasses.replace(ROPE, part=12, evaluate_every=2),
        {**OFF_POLICY, **SHOWN, "updates": 4, "actor_every": 2, "added": 2, "symmetric": True,
         "critics": 3, "discount": 0.9, "last_discount": 0.99, "rising": (4, 20)},
    ),
    "bc": (ROPE, {**SHOWN, "hidden": (8,), "batch": 4}),
    # A part ends in the midst of a rollout.
    "ppo": (
        dataclasses.replace(ROPE, part=12, evaluate_every=2),
        {"steps": 4, "epochs": 2, "minibatches": 2, "hidden": (16,)},
    ),
    "curl": (PIXELS, {**IMAGES, "crop": 30}),
    "drq": (PIXELS, {**IMAGES, "pad": 1}),
    "distill": (
        dataclasses.replace(PIXELS, observation=("rgb", "held")),
        {"updates": 2, "batch": 4, "buffer": 10, "channels": 4, "features": 6, "hidden": (8,)},
    ),
}  # fmt: skip


class _Killed(Exception):
    pass


@pytest.fixture(
    name="train",
    params=[pytest.param(name, marks=pytest.mark.long if name == "wu" else ()) for name in METHODS],
)
def _train(request, tmp_path):
    """Makes trainings of a method in folders by name."""
    settings, own = _case(request.param)
    if request.param == "distill":
        teacher = torch.nn.Sequential(torch.nn.Linear(44, 8), torch.nn.Tanh())
        torch.export.save(
            torch.export.export(teacher, (torch.zeros(1, 44),)), tmp_path / "teacher.pt2"
        )
        own = {**own, "teacher": str(tmp_path / "teacher.pt2")}
    method = find_method(request.param, **own)
    device = "cpu" if settings.actor else "host"
    return lambda name: Training(settings, method, SEEDS, tmp_path / name, device)


def _case(name):
    """Settings of a training and of its method; of larger ones, those of their own tests."""
    if name in CASES:
        return CASES[name]
    from tests.learning import test_planet, test_tdmpc2, test_wu

    own = {"planet": test_planet, "tdmpc2": test_tdmpc2, "wu": test_wu}[name]
    settings = dataclasses.asdict(own.METHOD.settings)
    if name == "tdmpc2":
        settings["plans"] = "always"  # It remembers them.
    return own.SETTINGS, settings


def same(first, second):
    """Whether two states are equal, bit by bit."""
    if isinstance(first, torch.Tensor):
        return torch.equal(first, second)
    if isinstance(first, dict):
        return first.keys() == second.keys() and all(same(first[k], second[k]) for k in first)
    if isinstance(first, list | tuple):
        return len(first) == len(second) and all(map(same, first, second))
    return first == second


def _rows(training):
    return [{name: row[name] for name in row if name != "seconds"} for row in training.rows]


def test_a_training_killed_after_a_part_ends_alike(train):
    def kill(training, news):
        raise _Killed

    whole = train("whole")
    whole.run()
    assert whole.learner.updates > 0 and len(whole.rows) == 2 * len(SEEDS)
    for _ in range(2):
        with pytest.raises(_Killed):
            train("killed").run(kill)
    again = train("killed")
    again.run()
    assert _rows(again) == _rows(whole)
    assert same(again.learner.get_state(), whole.learner.get_state())
    file = again.folder / POLICY.format(seed=SEEDS[1])
    if not file.exists() or has_images(again.settings.observations):
        return
    seen = torch.randn(len(SEEDS), 3, *again._problem.observation)
    expected, _ = again.learner.act(seen, None, None, explore=False)
    policy = torch.export.load(file).module()
    for k in range(3):
        found = policy(seen[1, k : k + 1])
        torch.testing.assert_close(found[0], expected[1, k], rtol=1e-4, atol=1e-5)


def test_a_training_killed_within_a_part_ends_alike(train, monkeypatch):
    monkeypatch.setattr(Training, "_evaluate", lambda self, final: None)
    whole = train("whole")
    whole.run()
    monkeypatch.setattr(module, "KEEP_SECONDS", -1.0)  # A checkpoint after each vector step.
    monkeypatch.setattr(module, "KEEP_RATIO", 0.0)
    killed = train("killed")
    keep = killed._keep

    def kill():
        keep()
        if killed.done == 1 and killed._step == 1:
            raise _Killed

    killed._keep = kill
    with pytest.raises(_Killed):
        killed.run()
    again, starts = train("killed"), []
    again.run(on_start=lambda now: starts.append(now.covered))
    assert starts == [whole.settings.part + whole.settings.worlds]
    assert same(again.learner.get_state(), whole.learner.get_state())
