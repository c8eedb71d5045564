"""Soft actor-critic: its oracles are PyTorch's distributions and layers, and one seed alone."""

import dataclasses
import functools
import math

import pytest
import torch

from softgym_mj.learning.learner import Problem
from softgym_mj.learning.methods.sac import SAC, SACSettings, StateSACSettings, make
from softgym_mj.learning.networks import Actor, Linear, drawn, generators
from softgym_mj.learning.replay import Batch
from tests.learning.plain_layers import plain_network
from tests.learning.reaching import distance_after_learning

OBSERVATION, ACTION, NUMBER = 5, 2, 7
SMALL = SACSettings(hidden=(16, 16), norm=True)


def random_batch(seeds, seed=0):
    source = torch.Generator().manual_seed(seed)
    shape = len(seeds), NUMBER

    def normal(*sizes):
        return torch.randn(*shape, *sizes, generator=source)

    return Batch(
        normal(OBSERVATION), normal(ACTION).tanh(), normal(), normal(OBSERVATION),
        torch.full(shape, 0.9),
    )  # fmt: skip


def test_densities_are_those_of_a_transformed_gaussian():
    sources = generators([3, 4], "cpu")
    actor = Actor(sources, OBSERVATION, ACTION, (8,), (-10.0, 2.0))
    observation, noise = drawn(sources, 6, OBSERVATION), drawn(sources, 6, ACTION)
    action, density = actor.sample(observation, noise)
    mean, log_std = actor(observation)
    deviation = log_std.double().exp()
    before = mean.double() + noise.double() * deviation
    base = torch.distributions.Normal(mean.double(), deviation)
    # The density after tanh is divided by its slope, 1 - tanh^2 = 1 / cosh^2.
    expected = (base.log_prob(before) + 2.0 * torch.log(torch.cosh(before))).sum(-1)
    torch.testing.assert_close(density.double(), expected, atol=1e-4, rtol=1e-4)
    torch.testing.assert_close(action.double(), torch.tanh(before), atol=1e-6, rtol=1e-5)
    assert ((log_std >= -10.0) & (log_std <= 2.0)).all()


def test_weights_are_orthogonal_and_of_their_seed_alone():
    both, alone = (Linear(generators(seeds, "cpu"), 6, 4, 2.0) for seeds in ([1, 2], [2]))
    torch.testing.assert_close(both.weight[1], alone.weight[0], rtol=0, atol=0)
    product = both.weight[0].T @ both.weight[0]
    torch.testing.assert_close(product, 4.0 * torch.eye(4), atol=1e-5, rtol=1e-5)


@pytest.mark.parametrize("entropy", [-1.0, 0.25])  # The first is the paper's.
def test_losses_are_those_of_the_paper(entropy):
    seeds = [0, 1]
    sac = SAC(dataclasses.replace(SMALL, target_entropy=entropy), seeds, OBSERVATION, ACTION)
    sac.update(random_batch(seeds))  # So that targets are no copies.
    sac.update(random_batch(seeds, seed=1))
    batch, noise = random_batch(seeds, seed=2), torch.randn(2, NUMBER, ACTION)
    critic, (actor, alpha) = sac.critic_loss(batch, noise), sac.actor_losses(batch, noise)
    for k in range(2):
        pair, targets = (
            [plain_network(critics.body, 2 * k + i) for i in range(2)]
            for critics in (sac.critics, sac.targets)
        )
        weight = sac.alpha[k].item()
        expected, of_actor, of_alpha = 0.0, 0.0, 0.0
        following, later = sac.actor.sample(batch.next_observation, noise)
        chosen, density = sac.actor.sample(batch.observation, noise)
        for i in range(NUMBER):
            next_input = torch.cat([batch.next_observation[k, i], following[k, i]])
            value = min(t(next_input).item() for t in targets) - weight * later[k, i].item()
            target = batch.reward[k, i].item() + 0.9 * value
            own_input = torch.cat([batch.observation[k, i], batch.action[k, i]])
            expected += sum((c(own_input).item() - target) ** 2 for c in pair) / NUMBER
            chosen_input = torch.cat([batch.observation[k, i], chosen[k, i]])
            best = min(c(chosen_input).item() for c in pair)
            of_actor += (weight * density[k, i].item() - best) / NUMBER
            of_alpha += weight * (-density[k, i].item() - entropy * ACTION) / NUMBER
        assert critic[k].item() == pytest.approx(expected, rel=1e-4)
        assert actor[k].item() == pytest.approx(of_actor, rel=1e-4)
        assert alpha[k].item() == pytest.approx(of_alpha, rel=1e-4)


def test_losses_that_are_compiled_teach_the_same(monkeypatch):
    """Without kernels, which take a minute to compile."""
    compiled = functools.partial(torch.compile, fullgraph=True, backend="aot_eager")
    monkeypatch.setattr(torch, "compile", compiled)
    seeds = [0, 1]
    eager, fused = (SAC(SMALL, seeds, OBSERVATION, ACTION) for _ in range(2))
    fused.fuse()
    for k in range(4):
        result = [sac.update(random_batch(seeds, seed=k)) for sac in (eager, fused)]
        for name, losses in result[0].items():
            torch.testing.assert_close(result[1][name], losses, rtol=1e-4, atol=1e-5)
    for one, other in zip(eager.actor.parameters(), fused.actor.parameters(), strict=True):
        torch.testing.assert_close(one, other, rtol=1e-3, atol=1e-5)


def test_it_learns_to_reach_a_point():
    settings = SACSettings(
        hidden=(32, 32), discount=0.9, actor_rate=3e-3, critic_rate=3e-3, tau=0.05, actor_every=1,
        target_every=1,
    )  # fmt: skip
    seeds = [0, 1]
    sac = SAC(settings, seeds, 1, 1)
    assert distance_after_learning(sac, seeds) < 0.06
    assert sac.alpha.max() < 0.1  # There is one best action.


def test_random_actions_last_as_long_as_they_are_told_to():
    lasting, num_envs, steps = 4, 50, 200
    settings = StateSACSettings(
        hidden=(4,), random_steps=num_envs * steps, action_hold=lasting, replay=num_envs * steps
    )
    problem = Problem("straighten_rope", {}, (0, 1), num_envs, (OBSERVATION,), ACTION, 1.0, "cpu")
    learner = make(settings, problem)
    observation, memory, shares = torch.zeros(2, num_envs, OBSERVATION), None, []
    for k in range(steps):
        first, before = torch.full((2, num_envs), k % 20 == 0), memory
        action, memory = learner.act(observation, first, memory, explore=True)
        if before is not None:
            changed = action != before
            assert torch.equal(changed.any(-1), changed.all(-1))
            if first.all():  # An episode begins with an action of its own.
                assert changed.all()
            else:
                shares.append(changed.float().mean())
    error = math.sqrt((lasting - 1.0) / lasting**2 / (2 * num_envs * len(shares)))
    assert abs(torch.stack(shares).mean() - 1.0 / lasting) < 4.0 * error
