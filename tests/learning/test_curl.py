"""CURL: its oracles are a slow contrastive loss, PyTorch's Adam, one seed alone."""

import copy

import pytest
import torch

from softgym_mj.exceptions import InvalidArgumentError
from softgym_mj.learning.learner import Problem
from softgym_mj.learning.methods.curl import CURL, CURLSettings, make
from softgym_mj.learning.methods.pixels import cropped
from softgym_mj.learning.networks import drawn, generators
from tests.learning.test_pixels import ACTION, TINY, batch_of_images, check_it_learns, pictures

CROP, SIZE = 15, (17, 18)
SMALL = CURLSettings(**TINY, crop=CROP)


def _curl():
    return CURL(SMALL, [0, 1], ACTION)


def test_the_contrastive_loss_is_that_of_the_paper():
    curl = _curl()
    curl.update(batch_of_images(size=SIZE))
    curl.update(batch_of_images(size=SIZE, seed=1))  # So that targets are no copies.
    anchors, others = pictures(2, 4, (CROP, CROP)), pictures(2, 4, (CROP, CROP), seed=1)
    result = curl.contrastive_loss(anchors, others)
    z_a, z_p = curl.critics.seen(anchors).detach(), curl.targets.seen(others)
    for seed in range(2):
        expected = 0.0
        for i in range(4):
            logits = torch.stack(
                [z_a[seed, i] @ curl.contrast.weight[seed] @ z_p[seed, j] for j in range(4)]
            )
            logits = logits - logits.max()
            expected -= (logits[i] - logits.exp().sum().log()).item() / 4
        assert result[seed].item() == pytest.approx(expected, rel=1e-4)
    result.sum().backward()
    assert all(weight.grad is None for weight in curl.targets.parameters())


def test_comparisons_begin_with_numbers_in_0_to_1():
    weight = _curl().contrast.weight
    assert weight.shape == (2, 6, 6) and 0.0 <= weight.min() < 0.2 and 0.8 < weight.max() <= 1.0


def test_an_update_is_that_of_the_paper():
    """Critics learn from crops; then two optimizers follow the contrastive loss."""
    curl, batch = _curl(), batch_of_images(size=SIZE)
    alike = copy.deepcopy(curl)
    source = generators([0, 1], "cpu")
    for mine, theirs in zip(source, curl.sources, strict=True):
        mine.set_state(theirs.get_state())
    crops = [
        cropped(images, (CROP, CROP), drawn(source, 2, 5, normal=False))
        for images in (batch.observation, batch.next_observation, batch.observation)
    ]
    noise = drawn(source, 5, ACTION)
    seen = type(batch)(crops[0], batch.action, batch.reward, crops[1], batch.discount)
    # By an optimizer of PyTorch for each.
    encoder, contrast = [*alike.critics.seen.parameters()], alike.contrast.weight
    for weights, rates, loss in (
        ([*alike.critics.parameters()], [3e-4], lambda: alike.critic_loss(seen, noise)),
        (encoder, [1e-3, 1e-3], lambda: alike.contrastive_loss(crops[0], crops[2])),
        ([contrast], [1e-3], None),
    ):
        if loss:
            alike.critics.zero_grad()
            contrast.grad = None
            loss().sum().backward()
        for rate in rates:
            torch.optim.Adam(weights, rate).step()
    result = curl.update(batch)
    assert result.keys() == {"critic_loss", "alpha", "contrastive_loss"}
    for name in ("critics", "contrast"):
        pairs = (getattr(sac, name).parameters() for sac in (curl, alike))
        for mine, expected in zip(*pairs, strict=True):
            torch.testing.assert_close(mine, expected, rtol=1e-5, atol=1e-6)


def test_targets_of_the_encoder_follow_faster():
    curl = _curl()
    weight, (critic, target) = 0.05, (curl.critics, curl.targets)
    with torch.no_grad():
        for parameter in critic.parameters():
            parameter.fill_(1.0)
        for parameter in target.parameters():
            parameter.fill_(0.0)
    curl._update_targets()
    for parameter in target.seen.parameters():
        torch.testing.assert_close(parameter, torch.full_like(parameter, weight))
    for parameter in target.body.parameters():
        torch.testing.assert_close(parameter, torch.full_like(parameter, 0.01))


def test_it_acts_by_the_middle_of_images():
    curl, whole = _curl(), pictures(2, 3, SIZE)
    other = pictures(2, 3, SIZE, seed=1)
    other[:, :, 1:-1, 1:-2] = whole[:, :, 1:-1, 1:-2]
    assert torch.equal(curl.act(whole, explore=False), curl.act(other, explore=False))


@pytest.mark.long
def test_it_learns_to_move_a_bar():
    settings = CURLSettings(
        hidden=(32, 32), channels=16, features=16, crop=16, actor_rate=3e-3, critic_rate=3e-3,
        alpha=0.01, tau=0.05, actor_every=1, target_every=1,
    )  # fmt: skip
    check_it_learns(CURL(settings, [0, 1], 1), 18, 200)


def test_bad_settings_are_refused():
    problem = Problem("straighten_rope", {}, [0], 1, (90, 128, 3), 8, 1.0, "cpu")
    with pytest.raises(InvalidArgumentError, match="crop=100"):
        make(CURLSettings(), problem)
