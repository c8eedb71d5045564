"""DrQ: its oracles are losses of `SAC` on each shift, one seed alone."""

import pytest
import torch

from softgym_mj.exceptions import InvalidArgumentError
from softgym_mj.learning.learner import Problem
from softgym_mj.learning.methods.drq import DrQ, DrQSettings, make
from softgym_mj.learning.networks import drawn
from softgym_mj.learning.replay import Batch
from tests.learning.test_pixels import ACTION, SIZE, TINY, batch_of_images, check_it_learns

SMALL = DrQSettings(**TINY, pad=2)
NUMBER = 5


def _drq():
    return DrQ(SMALL, [0, 1], SIZE, ACTION)


def _halves(batch):
    return (Batch(*(v[:, part] for v in vars(batch).values())) for part in _PARTS)


_PARTS = slice(NUMBER), slice(NUMBER, 2 * NUMBER)


def test_losses_are_those_of_the_paper():
    drq = _drq()
    drq.update(batch_of_images())
    drq.update(batch_of_images(seed=1))  # So that targets are no copies.
    both = drq._shifted(batch_of_images(seed=2))
    first, second = _halves(both)
    noise = drawn(drq.sources, 2 * NUMBER, ACTION)
    result = drq.critic_loss(both, noise)
    with torch.no_grad():
        targets = []
        for part, own in zip((first, second), noise.split(NUMBER, 1), strict=True):
            action, density = drq.actor.sample(part.next_observation, own)
            values = drq.targets(part.next_observation, action)
            value = torch.minimum(values[0], values[1]) - drq.alpha[:, None] * density
            targets.append(part.reward + 0.9 * value)
        target = (targets[0] + targets[1]) / 2.0
        terms = []
        for part in (first, second):
            for critic in drq.critics(part.observation, part.action):
                terms.append(((critic - target) ** 2).mean(1))
        assert len(terms) == 4
        torch.testing.assert_close(result, sum(terms), rtol=1e-4, atol=1e-5)
        assert not torch.allclose(*targets)  # Shifts differ.
        # The actor learns from the first ones.
        action, density = drq.actor.sample(first.observation, noise[:, :NUMBER])
        values = drq.critics(first.observation, action)
        actor = (drq.alpha[:, None] * density - torch.minimum(values[0], values[1])).mean(1)
        surplus = (-density + ACTION).mean(1)
    result = drq.actor_losses(both, noise)
    torch.testing.assert_close(result[0].detach(), actor, rtol=1e-4, atol=1e-5)
    torch.testing.assert_close(result[1].detach(), drq.alpha * surplus, rtol=1e-4, atol=1e-5)


def test_images_are_shifted_and_all_else_stays():
    drq, batch = _drq(), batch_of_images()
    first, second = _halves(drq._shifted(batch))
    for part in (first, second):
        for name in ("action", "reward", "discount"):
            assert torch.equal(getattr(part, name), getattr(batch, name))
        for name in ("observation", "next_observation"):
            own, shown = getattr(batch, name), getattr(part, name)
            assert shown.shape == own.shape and shown.dtype == torch.uint8
            for i in range(NUMBER):
                shifts = [
                    (row, column)
                    for row in range(-2, 3)
                    for column in range(-2, 3)
                    if torch.equal(_moved(own[0, i], row, column), shown[0, i])
                ]
                assert len(shifts) == 1
    for name in ("observation", "next_observation"):
        assert not torch.equal(getattr(first, name), getattr(second, name))


def _moved(image, row, column):
    height, width = image.shape[:2]
    rows = [min(max(i + row, 0), height - 1) for i in range(height)]
    return image[rows][:, [min(max(i + column, 0), width - 1) for i in range(width)]]


def test_features_are_in_minus_1_to_1():
    drq, batch = _drq(), batch_of_images()
    features = drq.critics.seen(batch.observation)
    assert features.abs().max() < 1.0
    before = drq.critics.seen[:-1](batch.observation)  # Normalized.
    torch.testing.assert_close(before.mean(-1), torch.zeros(2, NUMBER), atol=1e-5, rtol=0)
    torch.testing.assert_close(torch.tanh(before), features)


def test_it_learns_to_move_a_bar():
    settings = DrQSettings(
        hidden=(32, 32), channels=16, features=16, pad=1, actor_rate=3e-3, critic_rate=3e-3,
        alpha=0.01, tau=0.05, actor_every=1, target_every=1,
    )  # fmt: skip
    check_it_learns(DrQ(settings, [0, 1], (16, 16), 1), 16, 120)


def test_bad_settings_are_refused():
    problem = Problem("straighten_rope", {}, [0], 1, (30,), 8, 1.0, "cpu")
    with pytest.raises(InvalidArgumentError, match="rgb"):
        make(DrQSettings(), problem)
