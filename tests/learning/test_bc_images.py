"""Behavior cloning from images: its oracle is the expert's function, its schedule by hand."""

import copy
import dataclasses

import pytest
import torch

from softgym_mj.learning.learner import Offline
from softgym_mj.learning.methods.bc_images import BCImages, BCImagesSettings
from softgym_mj.learning.methods.distill import LABEL
from softgym_mj.learning.registry import find_preset
from tests.learning.test_distill import SHAPES, SMALL, problem, seen_at

STUDIES = 60


def _learner(seeds=(0,)):
    settings = BCImagesSettings(
        **{**SMALL, "hidden": (32,)}, batch=64, rate=3e-3, updates=3, warm_up=10
    )
    shapes = {name: SHAPES[name] for name in ("rgb", "held")}
    own = dataclasses.replace(problem(seeds, num_envs=2), shapes=shapes, env_steps=2 * STUDIES)
    source = torch.Generator().manual_seed(0)
    places = 2.0 * torch.rand(8, 12, 1, generator=source) - 1.0  # Episodes, steps.
    seen = seen_at(places)
    shown = {"rgb": seen["rgb"], "held": seen["held"], LABEL: -0.8 * places}
    return BCImages(settings, own, shown)


def _miss(learner):
    places = torch.linspace(-0.9, 0.9, 16)[None, :, None]
    first = torch.ones(1, 16, dtype=torch.bool)
    seen = {name: array for name, array in seen_at(places).items() if name != "markov"}
    return (learner.act(seen, first, None, explore=False)[0] + 0.8 * places).abs().mean().item()


def test_it_does_what_the_expert_does():
    learner = _learner()
    assert isinstance(learner, Offline) and learner.demonstrated == 8 * 12
    before = _miss(learner)
    for _ in range(STUDIES):
        learner.update_offline()
    assert learner.updates == 3 * STUDIES
    assert learner._rate.item() == pytest.approx(0.0, abs=1e-9)  # Of the last of all studies.
    assert before > 0.25 and _miss(learner) < 0.08


def test_frames_are_of_one_episode_and_labels_of_their_step():
    learner = _learner()
    batch = learner.frames.sample(0, 500)
    bars = batch["rgb"].float().mean((2, 4)).argmax(-1)  # (n, frames).
    places = torch.linspace(-1.0, 1.0, 35)[bars]
    torch.testing.assert_close(-0.8 * places[:, 1:], batch[LABEL], atol=0.03, rtol=0.0)
    kept = {
        tuple(pair)
        for episode in learner.frames._arrays[LABEL][:, 0].transpose(0, 1)[..., 0].tolist()
        for pair in zip([episode[0], *episode[:-1]], episode, strict=True)
    }
    befores = torch.tensor(sorted(kept)) / -0.8
    both = torch.cat([places[:, :1], batch[LABEL] / -0.8], 1)
    assert (both[:, None] - befores).abs().amax(-1).amin(1).max() < 0.04


def test_a_state_has_no_images():
    first, second = _learner(), _learner()
    first.update_offline()
    state = copy.deepcopy(first.get_state())
    assert state["frames"].keys() == {"random"}
    second.set_state(state)
    result = [learner.update_offline()["loss"] for learner in (first, second)]
    assert torch.equal(*result)


def test_presets_see_what_the_actor_has():
    for task, names in (
        ("fold_cloth", ["rgb", "proprioception", "held"]),
        ("pour_water", ["rgb", "proprioception"]),
    ):
        training, method = find_preset("bc_images", "fast", task)
        assert [*training.observation] == names and method.settings.demonstrations == 500
