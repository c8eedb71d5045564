"""SAC with demonstrations: its oracles are plain loops, PyTorch's layers, and one seed alone."""

import dataclasses

import pytest
import torch

from softgym_mj.learning.demonstrations import replay_of
from softgym_mj.learning.learner import Step
from softgym_mj.learning.methods.rlpd import RLPD, RLPDSettings, least
from softgym_mj.learning.methods.sac import SAC
from softgym_mj.learning.networks import drawn
from softgym_mj.learning.registry import find_method
from softgym_mj.learning.replay import Batch
from softgym_mj.learning.settings import TrainingSettings
from softgym_mj.learning.training import Training
from tests.learning.plain_layers import plain_network

OBSERVATION, ACTION, NUMBER = 3, 2, 5
SMALL = RLPDSettings(hidden=(16, 16), critics=4, actor_every=2)


def _normal(source, *shape):
    return torch.randn(*shape, generator=source)


def _shown(seeds, episodes=3, steps=6):
    """Demonstrations whose rewards are 7."""
    source = torch.Generator().manual_seed(1)
    seen = _normal(source, episodes, steps + 1, OBSERVATION)
    action, reward = (
        _normal(source, episodes, steps, ACTION).tanh(),
        torch.full((episodes, steps), 7.0),
    )
    over = torch.zeros(episodes, steps, dtype=torch.bool)
    return replay_of(Step(seen[:, :-1], action, reward, seen[:, 1:], over, over), seeds)


def _made(seeds, settings=SMALL):
    return RLPD(settings, seeds, _shown(seeds), OBSERVATION, ACTION)


def _batch(seeds, seed=0):
    source, shape = torch.Generator().manual_seed(seed), (len(seeds), NUMBER)
    return Batch(
        _normal(source, *shape, OBSERVATION), _normal(source, *shape, ACTION).tanh(),
        _normal(source, *shape), _normal(source, *shape, OBSERVATION), torch.full(shape, 0.9),
    )  # fmt: skip


def _single(ensemble, k, c):
    """Critic c of seed number k, of PyTorch's own layers."""
    return plain_network(ensemble.body, k * ensemble.number + c)


def test_an_ensemble_is_so_many_critics():
    rlpd, batch = _made([0, 1]), _batch([0, 1])
    result = rlpd.critics(batch.observation, batch.action)
    assert result.shape == (4, 2, NUMBER)
    both = torch.cat([batch.observation, batch.action], dim=-1)
    for k in range(2):
        for c in range(4):
            expected = _single(rlpd.critics, k, c)(both[k])[..., 0]
            torch.testing.assert_close(result[c, k], expected, rtol=1e-4, atol=1e-5)
    assert result.std(0).min() > 1e-3  # Each has weights of its own.


def test_the_least_is_of_those_that_are_drawn():
    values = torch.tensor([[[1.0, 9.0]], [[5.0, 2.0]], [[4.0, 7.0]]])  # (critics, 1, 2)
    for shares, expected in (
        ([0.1, 0.9, 0.5], [4.0, 2.0]),
        ([0.9, 0.1, 0.5], [1.0, 7.0]),
        ([0.9, 0.5, 0.1], [1.0, 2.0]),
    ):
        assert least(values, torch.tensor([shares]), 2)[0].tolist() == expected
    assert least(values, torch.tensor([[0.1, 0.2, 0.3]]), 3)[0].tolist() == [1.0, 2.0]
    two = values.expand(-1, 2, -1)  # Each seed has draws of its own.
    assert least(two, torch.tensor([[0.9, 0.0, 0.0], [0.0, 0.0, 0.9]]), 1).tolist() == [
        [1.0, 9.0], [4.0, 7.0],
    ]  # fmt: skip


def test_losses_are_those_of_the_authors():
    seeds = [0, 1]
    rlpd = _made(seeds, dataclasses.replace(SMALL, tau=0.5))
    for step in range(2):  # So that targets are no copies.
        rlpd.update(_batch(seeds, step))
    batch, noise = _batch(seeds, 5), torch.randn(2, NUMBER, ACTION)
    before = [source.get_state() for source in rlpd.sources]
    critic, (actor, alpha) = rlpd.critic_loss(batch, noise), rlpd.actor_losses(batch, noise)
    for source, state in zip(rlpd.sources, before, strict=True):
        source.set_state(state)
    shares = drawn(rlpd.sources[:2], 4, normal=False)
    following, _ = rlpd.actor.sample(batch.next_observation, noise)
    chosen, density = rlpd.actor.sample(batch.observation, noise)
    for k in range(2):
        critics, targets = (
            [_single(ensemble, k, c) for c in range(4)] for ensemble in (rlpd.critics, rlpd.targets)
        )
        taken = sorted(range(4), key=lambda c: -shares[k, c].item())[:2]
        weight, expected, of_actor, of_alpha = rlpd.alpha[k].item(), 0.0, 0.0, 0.0
        for i in range(NUMBER):
            after = torch.cat([batch.next_observation[k, i], following[k, i]])
            value = min(targets[c](after).item() for c in taken)
            target = batch.reward[k, i].item() + 0.9 * value
            own = torch.cat([batch.observation[k, i], batch.action[k, i]])
            expected += sum((c(own).item() - target) ** 2 for c in critics) / NUMBER
            own = torch.cat([batch.observation[k, i], chosen[k, i]])
            mean = sum(c(own).item() for c in critics) / 4
            of_actor += (weight * density[k, i].item() - mean) / NUMBER
            of_alpha += weight * (-density[k, i].item() + ACTION / 2) / NUMBER
        assert critic[k].item() == pytest.approx(expected, rel=1e-4)
        assert actor[k].item() == pytest.approx(of_actor, rel=1e-4)
        assert alpha[k].item() == pytest.approx(of_alpha, rel=1e-4)


def test_half_of_what_it_learns_from_is_demonstrated(monkeypatch):
    learned = []
    monkeypatch.setattr(SAC, "update", lambda self, batch: learned.append(batch) or {})
    rlpd, batch = _made([0, 1]), _batch([0, 1])
    rlpd.update(batch)
    rlpd.update(batch)
    for result in learned:
        assert result.reward.shape == (2, 2 * NUMBER)
        for name, value in vars(batch).items():
            assert torch.equal(getattr(result, name)[:, :NUMBER], value)
        assert (result.reward[:, NUMBER:] == 7.0).all()
    assert not torch.equal(learned[0].action, learned[1].action)


def test_it_learns_to_reach_a_point_that_was_shown():
    """One of 4 numbers has to be near 1 for a reward, which is rarely found by chance."""
    source = torch.Generator().manual_seed(0)

    def reward(action):
        return 5.0 * ((action - 0.9).abs().amax(-1) < 0.2).float()

    def steps(episodes, number, action):
        over = torch.ones(episodes, number, dtype=torch.bool)
        seen = torch.rand(episodes, number, 1, generator=source)
        return Step(seen, action, reward(action), seen, over, over)

    best = 0.9 + 0.05 * torch.randn(4, 8, 4, generator=source)
    settings = RLPDSettings(
        hidden=(32, 32), critics=4, actor_every=2, actor_rate=3e-3, critic_rate=3e-3, tau=0.05,
        alpha=0.01,
    )  # fmt: skip
    rlpd = RLPD(settings, [0], replay_of(steps(4, 8, best.clamp(-1, 1)), [0]), 1, 4)
    for _ in range(300):
        seen = torch.rand(1, 32, 1, generator=source)
        action = rlpd.act(seen, explore=True)
        rlpd.update(Batch(seen, action, reward(action), seen, torch.zeros(1, 32)))
    place = torch.rand(1, 50, 1, generator=source)
    assert (reward(rlpd.act(place, explore=False)) > 0.0).float().mean() > 0.9


def test_demonstrations_have_the_discount_of_what_was_done(tmp_path):
    settings = TrainingSettings(
        "straighten_rope", env_steps=24, num_envs=2, part=12, episodes=1, final_episodes=1,
        evaluate_every=2, fidelity="fast", episode_steps=6,
    )  # fmt: skip
    method = find_method(
        "rlpd", hidden=(8,), random_steps=4, updates=4, batch=4, replay=16, actor_every=2,
        n_step=2, symmetric=True, demonstrations=2, jobs=1, critics=3, discount=0.9,
        final_discount=0.99, discount_schedule=(4, 20),
    )  # fmt: skip
    training = Training(settings, method, [4, 9], tmp_path, "host")
    training.run()
    assert training.learner.updates == 4 * (24 - 4) // 2
    shown = training.learner.algorithm._shown.sample(9)
    assert shown.discount.max() == pytest.approx(0.99**2)
