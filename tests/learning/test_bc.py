"""Behavior cloning: its oracles are plain loops, one seed alone, and experts that are formulas."""

import numpy as np
import pytest
import torch

import softgym_mj
from softgym_mj.learning.learner import Step
from softgym_mj.learning.methods.bc import BC, BCSettings
from softgym_mj.learning.registry import find_method, find_preset
from softgym_mj.learning.settings import TrainingSettings
from softgym_mj.learning.symmetries import Symmetry
from softgym_mj.learning.training import Training

SMALL = BCSettings(hidden=(16, 16), batch=32)
SAME = Symmetry(np.eye(2), np.eye(1), np.eye(3), "same", (0,))
MIRROR = Symmetry(-np.eye(2), -np.eye(1), np.eye(3), "same", (0,))


def _expert(place):
    """To 0, at most at full speed; the second number of a place says nothing."""
    return (-2.0 * place[..., :1]).clamp(-1.0, 1.0)


def _shown(low=-1.0, episodes=6, steps=20):
    source = torch.Generator().manual_seed(0)
    places = torch.rand(episodes, steps + 1, 2, generator=source)
    seen, following = (low + (1.0 - low) * part for part in (places[:, :-1], places[:, 1:]))
    reward = torch.zeros(episodes, steps)
    over = torch.zeros(episodes, steps, dtype=torch.bool)
    return Step(seen, _expert(seen), reward, following, over, over)


def test_the_loss_is_that_of_a_loop():
    shown = _shown()
    bc = BC(SMALL, [0, 1], shown)
    batch = bc._replay.sample(5)
    center = shown.observation.reshape(-1, 2).numpy().mean(0)
    scale = shown.observation.reshape(-1, 2).numpy().std(0, ddof=1)
    for k, result in enumerate(bc.loss(batch)):
        expected = 0.0
        for i in range(5):
            x = torch.tensor((batch.observation[k, i].numpy() - center) / scale)
            for layer in bc.actor.body:
                is_linear = hasattr(layer, "weight")
                x = x @ layer.weight[k] + layer.bias[k, 0] if is_linear else x.clamp(min=0.0)
            expected += (torch.tanh(x) - batch.action[k, i]).square().item() / 5
        assert result.item() == pytest.approx(expected, rel=1e-4)


def test_what_never_changes_is_not_blown_up():
    shown = _shown()
    shown.observation[..., 1] = 0.3
    bc = BC(SMALL, [0], shown)
    mean, deviation = bc.actor.seen.mean[0, 0], bc.actor.seen.deviation[0, 0]
    assert mean[1].item() == pytest.approx(0.3) and deviation[1].item() == pytest.approx(0.01)


def test_it_does_what_the_expert_does():
    bc = BC(BCSettings(hidden=(32, 32), rate=3e-3), [0, 1], _shown())
    first = bc.update_offline()["loss"]
    for _ in range(400):
        last = bc.update_offline()["loss"]
    assert (last < 0.05 * first).all() and bc.updates == 401 and bc.demonstrated == 120
    place = torch.rand(2, 50, 2, generator=torch.Generator().manual_seed(1)) * 2.0 - 1.0
    result, _ = bc.act(place, torch.ones(2, 50, dtype=torch.bool), None, explore=False)
    assert (result - _expert(place)).abs().mean() < 0.06


def test_symmetries_teach_what_was_not_shown():
    """Demonstrations are on one side alone; in their mirror image the action is the other one."""
    shown = _shown(low=0.0)
    shown.action.fill_(0.8)
    place, errors = -shown.observation.flatten(0, 1)[None], []
    for shapes in ((), (SAME, MIRROR)):
        bc = BC(BCSettings(hidden=(32, 32), rate=3e-3), [0], shown, shapes)
        for _ in range(300):
            bc.update_offline()
        errors.append((bc.actor.mean(place) + 0.8).abs().mean().item())
    assert errors[0] > 1.0 and errors[1] < 0.3


class _Killed(Exception):
    pass


@pytest.mark.parametrize("observation", ["reduced", "full"])
def test_a_training_steps_no_environment_and_counts_what_was_shown(tmp_path, observation):
    settings = TrainingSettings(
        "straighten_rope", observation, env_steps=4, num_envs=1, part=2, episodes=1,
        final_episodes=1, fidelity="fast", episode_steps=6,
    )  # fmt: skip
    symmetric = observation == "reduced"
    method = find_method("bc", symmetric=symmetric, demonstrations=2, jobs=1, hidden=(8,), batch=4)
    training = Training(settings, method, [4, 9], tmp_path, "host")
    training._envs.step = training._envs.reset = None
    training.run()
    steps = 2 * training._problem.example().horizon
    assert [(row["split"], row["env_steps"], row["updates"]) for row in training.rows] == [
        (split, steps, 4) for split in ("train", "evaluate") for _ in range(2)
    ]
    assert {row["replay"] for row in training.rows} == {"symmetric" if symmetric else "plain"}


def test_presets_suit_every_task():
    for task in softgym_mj.TASKS:
        training, method = find_preset("bc", "fast", task)
        assert method.settings.symmetric == ("water" not in task)
        assert training.num_envs == 1
