"""Asymmetric soft actor-critic: what actor and critics see, losses, a toy that images tell."""

import pytest
import torch

from softgym_mj.exceptions import InvalidArgumentError
from softgym_mj.learning.learner import Problem, Step
from softgym_mj.learning.methods.asymmetric import (
    AsymmetricSAC,
    AsymmetricSettings,
    make,
    squares,
)
from softgym_mj.learning.replay import Batch

SIDE = 32
SHAPES = {"rgb": (SIDE, SIDE, 3), "held": (2,), "markov": (1,)}
SMALL = {
    "channels": 8, "features": 16, "hidden": (32, 32), "batch": 64, "replay": 6_400,
    "random_steps": 64, "updates": 8, "shift": 1, "norm": True,
}  # fmt: skip


def _images(places):
    """A bright column (seeds, n, SIDE, SIDE, 3) where places (seeds, n) in -1..1 are."""
    columns = torch.arange(SIDE)
    centers = (0.5 * (places + 1.0) * (SIDE - 9) + 4.0)[..., None]
    bright = (255.0 * ((columns - centers).abs() < 4.0)).to(torch.uint8)
    return bright[..., None, :, None].expand(*places.shape, SIDE, SIDE, 3).clone()


def _seen(places):
    held = torch.zeros(*places.shape, 2)
    return {"rgb": _images(places), "held": held, "markov": places[..., None]}


def _problem(num_envs=16):
    return Problem("toy", {}, [3], num_envs, (), 1, 1.0, "cpu", ("rgb", "held"), SHAPES, 10_000)


def test_squares_are_means():
    pictures = torch.randint(0, 256, (2, 7, 9, 3), dtype=torch.uint8)
    found = squares(pictures, 2)
    assert found.shape == (2, 3, 4, 3)
    for row in range(3):
        for column in range(4):
            block = pictures[:, 2 * row : 2 * row + 2, 2 * column : 2 * column + 2].double()
            expected = block.sum((1, 2)) / 4.0
            torch.testing.assert_close(found[:, row, column].double(), expected)


def _batch(n=5):
    source = torch.Generator().manual_seed(0)
    places = 2.0 * torch.rand(2, 1, n, generator=source) - 1.0
    action = 2.0 * torch.rand(1, n, 1, generator=source) - 1.0
    reward, discount = torch.rand(2, 1, n, generator=source)
    return Batch(_seen(places[0]), action, reward, _seen(places[1]), discount)


def test_losses_are_those_of_the_formulas():
    settings = AsymmetricSettings(**SMALL, min_q_weight=1.0, alpha=0.2, target_entropy=-1.0)
    sac, batch = AsymmetricSAC(settings, [0], SHAPES, 1), _batch()
    noise = torch.randn(1, 5, 1)
    with torch.no_grad():
        mean, log_std = sac.actor(batch.next_observation)
        before = mean + noise * log_std.exp()
        density = torch.distributions.Normal(mean, log_std.exp()).log_prob(before)
        density = (density - torch.log(1.0 - torch.tanh(before) ** 2))[..., 0]
        values = sac.targets(batch.next_observation, torch.tanh(before))
        least = torch.minimum(values[0], values[1])
        wanted = batch.reward + batch.discount * (least - 0.2 * density)
        first, second = sac.critics(batch.observation, batch.action)
        expected = ((first - wanted) ** 2 + (second - wanted) ** 2).mean(-1)
    torch.testing.assert_close(sac.critic_loss(batch, noise), expected, rtol=1e-4, atol=1e-5)


def test_the_actor_sees_images_and_critics_the_state():
    sac, batch = AsymmetricSAC(AsymmetricSettings(**SMALL), [0], SHAPES, 1), _batch()
    other = _batch(5).next_observation
    as_seen = {**batch.observation, "markov": other["markov"]}
    as_known = {**batch.observation, "rgb": other["rgb"], "held": 1.0 + other["held"]}
    act, value = sac.actor.mean, sac.critics
    assert torch.equal(act(as_seen), act(batch.observation))
    assert not torch.equal(act(as_known), act(batch.observation))
    assert torch.equal(value(as_known, batch.action), value(batch.observation, batch.action))
    assert not torch.equal(value(as_seen, batch.action), value(batch.observation, batch.action))


def test_it_learns_what_only_an_image_tells_the_actor():
    settings = AsymmetricSettings(
        **SMALL, discount=0.5, actor_rate=3e-3, critic_rate=3e-3, alpha=0.01, actor_every=1
    )
    learner, num_envs = make(settings, _problem()), 16
    source = torch.Generator().manual_seed(0)
    first = torch.ones(1, num_envs, dtype=torch.bool)
    tested = torch.linspace(-0.8, 0.8, num_envs)[None]

    def miss():
        action, _ = learner.act(_seen(tested), first, None, explore=False)
        return (action[..., 0] - tested).abs().mean().item()

    before = miss()
    for _ in range(60):  # Each env step is an episode: go where the bright column is.
        places = 1.6 * torch.rand(1, num_envs, generator=source) - 0.8
        seen = _seen(places)
        action, _ = learner.act(seen, first, None, explore=True)
        reward = -((action[..., 0] - places) ** 2)
        learner.learn(Step(seen, action, reward, seen, first, first))
    assert before > 0.3 and miss() < 0.1


@pytest.mark.parametrize(
    "shapes",
    [
        {"held": (2,), "markov": (1,)},
        {"rgb": (28, 32, 3), "markov": (1,)},
        {"rgb": (32, 32, 3), "depth": (32, 32), "markov": (1,)},
    ],
)
def test_a_single_image_of_enough_pixels_is_needed(shapes):
    with pytest.raises(InvalidArgumentError, match="one image"):
        AsymmetricSAC(AsymmetricSettings(**SMALL), [0], shapes, 1)
