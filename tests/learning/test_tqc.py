"""Truncated quantile critics against loops over quantiles, and on a line."""

import pytest
import torch

from softgym_mj.learning.methods.tqc import TQC, TQCSettings, quantile_loss
from tests.learning.plain_layers import plain_network
from tests.learning.reaching import distance_after_learning
from tests.learning.test_sac import ACTION, NUMBER, OBSERVATION, random_batch

SMALL = TQCSettings(hidden=(16,), norm=True, critics=2, quantiles=3, dropped=1)


def _loss(quantiles, targets):
    total = 0.0
    for i, value in enumerate(quantiles):
        for target in targets:
            apart = target - value
            huber = 0.5 * apart**2 if abs(apart) <= 1.0 else abs(apart) - 0.5
            total += abs((i + 0.5) / len(quantiles) - (apart < 0.0)) * huber
    return total / len(quantiles) / len(targets)


def test_the_loss_is_least_at_the_quantiles():
    """Huber's threshold blurs quantiles of narrow distributions: this one is 100 wide."""
    targets = torch.linspace(0.0, 100.0, 1001)
    quantiles = torch.full((5,), 50.0, requires_grad=True)
    adam = torch.optim.Adam([quantiles], 0.5)
    for _ in range(1500):
        adam.zero_grad()
        quantile_loss(quantiles, targets).backward()
        adam.step()
    torch.testing.assert_close(
        quantiles.detach(), torch.tensor([10.0, 30, 50, 70, 90]), atol=1, rtol=0
    )
    assert quantile_loss(torch.tensor([0.0, 3.0]), torch.tensor([1.0])).item() == pytest.approx(
        (0.25 * 0.5 + 0.25 * 1.5) / 2
    )


def test_losses_are_those_of_loops():
    seeds = [0, 1]
    tqc = TQC(SMALL, seeds, OBSERVATION, ACTION)
    for k in range(2):  # So that targets are no copies.
        tqc.update(random_batch(seeds, seed=k))
    own, noise = random_batch(seeds, seed=2), torch.randn(2, NUMBER, ACTION)
    critic, (actor, _) = tqc.critic_loss(own, noise), tqc.actor_losses(own, noise)
    following, later = tqc.actor.sample(own.next_observation, noise)
    chosen, density = tqc.actor.sample(own.observation, noise)
    for k in range(2):
        pair, targets = (
            [plain_network(critics.body, 2 * k + i) for i in range(2)]
            for critics in (tqc.critics, tqc.targets)
        )
        weight, expected, of_actor = tqc.alpha[k].item(), 0.0, 0.0
        for i in range(NUMBER):
            after = torch.cat([own.next_observation[k, i], following[k, i]])
            kept = sorted(value for t in targets for value in t(after).tolist())[:4]
            goals = [
                own.reward[k, i].item() + 0.9 * (v - weight * later[k, i].item()) for v in kept
            ]
            now = torch.cat([own.observation[k, i], own.action[k, i]])
            expected += sum(_loss(c(now).tolist(), goals) for c in pair) / NUMBER
            best = torch.cat([own.observation[k, i], chosen[k, i]])
            mean = sum(value for c in pair for value in c(best).tolist()) / 6
            of_actor += (weight * density[k, i].item() - mean) / NUMBER
        assert critic[k].item() == pytest.approx(expected, rel=1e-4)
        assert actor[k].item() == pytest.approx(of_actor, rel=1e-4)


def test_it_learns_to_reach_a_point():
    settings = TQCSettings(
        hidden=(32, 32), actor_rate=3e-3, critic_rate=3e-3, tau=0.05, actor_every=1,
        target_every=1, critics=2, quantiles=5, dropped=1,
    )  # fmt: skip
    seeds = [0, 1]
    assert distance_after_learning(TQC(settings, seeds, 1, 1), seeds) < 0.06
