"""TD-MPC2: its oracles are PyTorch's layers, loops over single states, and one seed alone."""

import copy
import math

import numpy as np
import pytest
import torch
from torch import nn

import softgym_mj
from softgym_mj.exceptions import InvalidArgumentError
from softgym_mj.learning.learner import Problem, Step
from softgym_mj.learning.methods.tdmpc2 import losses
from softgym_mj.learning.methods.tdmpc2.learner import TDMPC2, discount_of, make
from softgym_mj.learning.methods.tdmpc2.mppi import MPPISettings, fitted, mppi
from softgym_mj.learning.methods.tdmpc2.networks import (
    WorldModel,
    WorldModelSettings,
    imagined,
    simplicial,
)
from softgym_mj.learning.methods.tdmpc2.settings import TDMPC2Settings
from softgym_mj.learning.methods.tdmpc2.two_hot import (
    cross_entropy,
    expected,
    symexp,
    symlog,
    two_hot,
)
from softgym_mj.learning.networks import drawn, generators
from softgym_mj.learning.optimization import clip_grad_norm
from softgym_mj.learning.registry import find_method, find_preset
from softgym_mj.learning.settings import TrainingSettings

OBSERVATION, ACTION, NUMBER, HORIZON, DISCOUNT, RHO = 5, 2, 6, 3, 0.9, 0.5
SIZES = {
    "latent": 8, "simplex": 4, "encoder": 12, "hidden": (10, 10), "critics": 3, "bins": 21,
    "samples": 16, "proposals": 4, "elites": 5, "iterations": 2,
}  # fmt: skip
SMALL = TDMPC2Settings(
    **SIZES, random_steps=4, pretraining=2, updates=2, batch=NUMBER, replay=40, rate=1e-2,
    dropout=0.2,
)  # fmt: skip


def _normal(source, *shape):
    return torch.randn(*shape, generator=source)


def _stretches(seeds=2, seed=0):
    """Some of which an episode ends in."""
    source = torch.Generator().manual_seed(seed)
    lead = seeds, NUMBER, HORIZON
    ended = torch.zeros(lead, dtype=torch.bool)
    ended[:, 0, 0] = ended[:, 1, 1] = ended[:, 2, 2] = True
    terminated = torch.zeros_like(ended)
    terminated[:, 1, 1] = True
    return Step(
        _normal(source, *lead, OBSERVATION), _normal(source, *lead, ACTION).tanh(),
        3.0 * _normal(source, *lead), _normal(source, *lead, OBSERVATION), terminated, ended,
    )  # fmt: skip


def _model(seeds=(1, 2)):
    """One whose rewards and values are not all alike."""
    model = WorldModel(SMALL, generators(seeds, "cpu"), OBSERVATION, ACTION)
    source = torch.Generator().manual_seed(7)
    for parameter in model.parameters():
        parameter.data += 0.5 * _normal(source, *parameter.shape)
    return model


# ---------------------------------------------------------------------- two hot


def test_two_neighboring_bins_tell_a_number():
    numbers = torch.tensor([-3e4, -200.0, -0.3, 0.0, 0.07, 1.0, 21.5, 22_025.0, 1e6])
    result = two_hot(numbers, 101)
    for row, number in zip(result.tolist(), numbers.tolist(), strict=True):
        logarithm = math.copysign(math.log(1.0 + abs(number)), number)
        place = (min(max(logarithm, -10.0), 10.0) + 10.0) / 0.2
        low = min(math.floor(place), 99)
        target = [0.0] * 101
        target[low], target[low + 1] = 1.0 - (place - low), place - low
        np.testing.assert_allclose(row, target, atol=2e-4)
    inside = numbers[1:-2]
    back = expected((two_hot(inside, 101) + 1e-30).log())
    torch.testing.assert_close(back, inside, rtol=1e-3, atol=1e-4)
    torch.testing.assert_close(symexp(symlog(inside)), inside, rtol=1e-5, atol=1e-6)


def test_cross_entropies_are_those_of_pytorch():
    logits, target = torch.randn(40, 21), 30.0 * torch.randn(40)
    oracle = nn.functional.cross_entropy(logits, two_hot(target, 21), reduction="none")
    torch.testing.assert_close(cross_entropy(logits, target), oracle)
    # Least where the shares are those of the number.
    best = (two_hot(target, 21) + 1e-30).log()
    assert (cross_entropy(best, target) < oracle).all()


# ---------------------------------------------------------------------- networks


def _single(network, k, simplex=None):
    """Network number k, of PyTorch's own layers."""
    layers = []
    for i, layer in enumerate(network.layers):
        own = nn.Linear(*layer.weight.shape[1:])
        own.weight.data, own.bias.data = layer.weight[k].T.clone(), layer.bias[k, 0].clone()
        layers.append(own)
        if i < len(network.norms):
            norm = nn.LayerNorm(own.out_features)
            kept = network.norms[i]
            norm.weight.data, norm.bias.data = kept.weight[k, 0].clone(), kept.bias[k, 0].clone()
            layers.append(norm)
        if i < len(network.layers) - 1:
            layers.append(nn.Mish())
    if simplex:
        layers += [nn.Unflatten(-1, (-1, simplex)), nn.Softmax(-1), nn.Flatten(-2)]
    return nn.Sequential(*layers)


def test_networks_are_those_of_pytorch():
    model, source = _model(), torch.Generator().manual_seed(3)
    observation = _normal(source, 2, NUMBER, 4, OBSERVATION)
    latent, action = model.encode(observation), _normal(source, 2, NUMBER, 4, ACTION)
    both = torch.cat([latent, action], -1)
    result = (
        latent, model.following(latent, action), model.rewards(latent, action),
        *model.values(latent, action).unbind(1),
    )  # fmt: skip
    assert result[3].shape == (2, NUMBER, 4, 21)
    for k in range(2):
        oracles = (
            _single(model.encoder, k, 4)(observation[k]),
            _single(model.dynamics, k, 4)(both[k]),
            _single(model.reward, k)(both[k]),
            *(_single(model.critics, 3 * k + i)(both[k]) for i in range(3)),
        )
        for own, oracle in zip(result, oracles, strict=True):
            torch.testing.assert_close(own[k], oracle, rtol=1e-4, atol=1e-5)
    groups = latent.unflatten(-1, (2, 4))
    torch.testing.assert_close(groups.sum(-1), torch.ones_like(groups[..., 0]))
    assert torch.equal(simplicial(torch.zeros(1, 8), 4), torch.full((1, 8), 0.25))


def test_dropout_leaves_out_a_share_of_the_first_layer():
    model = _model()
    kept = model.dropout(generators([1, 2], "cpu"), 400)
    assert kept.shape == (2 * 3, 400, 10)
    assert kept.unique().tolist() == [0.0, 1.25]
    assert (kept == 0.0).float().mean().item() == pytest.approx(0.2, abs=0.02)
    both = torch.rand(2, 400, 8 + ACTION)
    result = model.values(*both.split([8, ACTION], -1), kept)
    for k, i in np.ndindex(2, 3):
        layers = _single(model.critics, 3 * k + i)
        oracle = layers[1:](layers[0](both[k]) * kept[3 * k + i])
        torch.testing.assert_close(result[k, i], oracle, rtol=1e-4, atol=1e-4)


def test_the_published_model_has_5_million_parameters():
    model = WorldModel(WorldModelSettings(), generators([0], "cpu"), 36, 8)
    number = sum(p.numel() for p in model.parameters() if p.requires_grad)
    assert number == pytest.approx(5e6, rel=0.03)
    deviation = model.dynamics.layers[1].weight.std().item()
    assert deviation == pytest.approx(0.02, rel=0.01)
    latent, action = torch.rand(1, 3, 512), torch.rand(1, 3, 8)
    for logits in (model.rewards(latent, action), model.values(latent, action)):
        torch.testing.assert_close(
            expected(logits), torch.zeros(logits.shape[:-1]), atol=1e-4, rtol=0
        )


# ---------------------------------------------------------------------- losses


def test_losses_are_those_of_a_loop_over_states():
    model, step, source = _model(), _stretches(), torch.Generator().manual_seed(4)
    model.targets = copy.deepcopy(_model((8, 9)).critics)
    noise = _normal(source, 2, NUMBER, HORIZON, ACTION)
    pair = torch.tensor([[2, 0], [1, 2]])
    result, _ = losses.model_losses(model, step, noise, pair, discount=DISCOUNT, rho=RHO)
    valid = [[t <= i or i > 2 for t in range(HORIZON)] for i in range(NUMBER)]
    for k in range(2):
        encoder, dynamics = _single(model.encoder, k, 4), _single(model.dynamics, k, 4)
        reward = _single(model.reward, k)
        critics = [_single(model.critics, 3 * k + i) for i in range(3)]
        targets = [_single(model.targets, 3 * k + i) for i in pair[k].tolist()]
        target = {"consistency": 0.0, "reward": 0.0, "value": 0.0}
        for i in range(NUMBER):
            latent = encoder(step.observation[k, i, 0])
            for t in range(HORIZON):
                weight = valid[i][t] * RHO**t / sum(row[t] for row in valid) / HORIZON
                seen = encoder(step.next_observation[k, i, t])
                action, _ = model.sample(seen.expand(2, 1, 8), noise[:, i : i + 1, t])
                later = min(
                    expected(critic(torch.cat([seen, action[k, 0]]))).item() for critic in targets
                )
                value = step.reward[k, i, t] + DISCOUNT * (not step.terminated[k, i, t]) * later
                both = torch.cat([latent, step.action[k, i, t]])
                target["reward"] += weight * cross_entropy(reward(both), step.reward[k, i, t])
                for critic in critics:
                    target["value"] += weight * cross_entropy(critic(both), value) / 3
                latent = dynamics(both)
                target["consistency"] += weight * ((latent - seen) ** 2).mean()
        for name, loss in target.items():
            assert result[name][k].item() == pytest.approx(loss.item(), rel=1e-4), name


def test_nothing_is_learned_beyond_an_end():
    model, step = _model(), _stretches()
    noise, pair = torch.zeros(2, NUMBER, HORIZON, ACTION), torch.tensor([[0, 1], [0, 1]])
    assert losses.counted(step.ended)[0, :4].tolist() == [
        [1, 0, 0],
        [1, 1, 0],
        [1, 1, 1],
        [1, 1, 1],
    ]
    other = Step(*(array.clone() for array in step))
    other.reward[:, 0, 1:], other.next_observation[:, 0, 1:] = 99.0, 99.0
    other.action[:, 1, 2] = -1.0
    gradients = []
    for each in (step, other):
        model.zero_grad()
        result, _ = losses.model_losses(model, each, noise, pair, discount=DISCOUNT, rho=RHO)
        sum(loss.sum() for loss in result.values()).backward()
        gradients.append([p.grad.clone() for p in model.dynamics.parameters()])
    for one, two in zip(*gradients, strict=True):
        torch.testing.assert_close(one, two, rtol=1e-5, atol=1e-7)
    other.reward[:, 0, 0] += 1.0
    changed, _ = losses.model_losses(model, other, noise, pair, discount=DISCOUNT, rho=RHO)
    assert (changed["reward"] - result["reward"]).abs().min() > 1e-4


def test_what_the_policy_is_worth():
    model, source = _model(), torch.Generator().manual_seed(5)
    latent = _normal(source, 2, NUMBER, 4, 8)
    noise, pair = _normal(source, 2, NUMBER, 4, ACTION), torch.tensor([[0, 2], [1, 0]])
    values, entropy = losses.policy_values(model, latent, noise, pair)
    for k in range(2):
        body = _single(model.actor.body, k)
        pairs = [_single(model.critics, 3 * k + i) for i in pair[k].tolist()]
        mean, squashed = body(latent[k]).double().chunk(2, -1)
        deviation = (-10.0 + 6.0 * (squashed.tanh() + 1.0)).exp()
        before = mean + noise[k] * deviation
        both = torch.cat([latent[k], before.tanh().float()], -1)
        oracle = sum(expected(critic(both)) for critic in pairs) / 2
        torch.testing.assert_close(values[k], oracle, rtol=1e-3, atol=1e-3)
        density = torch.distributions.Normal(mean, deviation).log_prob(before)
        density = (density + 2.0 * before.cosh().log()).sum(-1)
        torch.testing.assert_close(entropy[k].double(), -ACTION * density, rtol=1e-3, atol=1e-3)


def test_weights_of_losses_and_spreads_of_values():
    counts = torch.tensor([[[1.0, 1.0, 0.0], [1.0, 0.0, 0.0]]])
    target = torch.tensor([[[0.5, 0.5, 0.0], [0.5, 0.0, 0.0]]]) / 3.0
    torch.testing.assert_close(losses.shares(counts, 0.5), target)
    values = torch.randn(3, 37)
    low, high = np.percentile(values.numpy(), [5, 95], axis=1)
    np.testing.assert_allclose(losses.spread(values), high - low, rtol=1e-4)


def test_gradients_are_cut_as_by_pytorch_in_each_seed():
    arrays = [nn.Parameter(torch.zeros(4, 3, 2)), nn.Parameter(torch.zeros(2, 5))]
    for array, factor in zip(arrays, (1.0, 5.0), strict=True):
        array.grad = factor * torch.randn(array.shape)
    arrays[0].grad[2:] *= 0.01
    arrays[1].grad[1:] *= 0.01  # The second seed's are small.
    alone = []
    for k in range(2):
        own = [
            nn.Parameter(a.detach()[k * n : (k + 1) * n])
            for a, n in zip(arrays, (2, 1), strict=True)
        ]
        for parameter, array, n in zip(own, arrays, (2, 1), strict=True):
            parameter.grad = array.grad[k * n : (k + 1) * n].clone()
        nn.utils.clip_grad_norm_(own, 3.0)
        alone.append(own)
    clip_grad_norm(arrays, 2, 3.0)
    for i, n in enumerate((2, 1)):
        for k in range(2):
            torch.testing.assert_close(arrays[i].grad[k * n : (k + 1) * n], alone[k][i].grad)


# ---------------------------------------------------------------------- planning


def test_the_next_distribution_is_that_of_the_elites():
    settings = MPPISettings(samples=9, proposals=1, elites=4, std=(0.3, 2.0))
    actions, values = torch.randn(2, 3, 9, HORIZON, ACTION), 3.0 * torch.randn(2, 3, 9)
    _, weights, mean, std = fitted(actions, values, settings)
    for k, i in np.ndindex(2, 3):
        best = np.argsort(-values[k, i].numpy())[:4]
        own = np.exp(0.5 * values[k, i].numpy()[best].astype(float))
        own /= own.sum()
        elites = actions[k, i].numpy()[best]
        average = np.einsum("e,eta->ta", own, elites)
        variance = np.einsum("e,eta->ta", own, (elites - average) ** 2)
        np.testing.assert_allclose(weights[k, i], own, rtol=1e-4)
        np.testing.assert_allclose(mean[k, i], average, atol=1e-5)
        np.testing.assert_allclose(std[k, i], np.clip(np.sqrt(variance), 0.3, 2.0), atol=1e-5)


def test_it_plans_to_the_best_actions():
    settings = MPPISettings(samples=256, elites=32, proposals=8, temperature=5.0, iterations=8)
    best = 1.6 * torch.rand(2, 3, 1, HORIZON, ACTION) - 0.8

    def value(actions):
        return -((actions - best) ** 2).sum((-1, -2))

    start, none = torch.zeros(2, 3, HORIZON, ACTION), torch.ones(2, 3, 8, HORIZON, ACTION)
    sources = generators([1, 2], "cpu")
    action, mean = mppi(value, none, start, settings, sources, explore=False)
    assert (mean - best[:, :, 0]).abs().max() < 0.15
    assert (action - best[:, :, 0, 0]).abs().max() < 0.3
    # What a policy proposes is found where nothing else comes near.
    only = MPPISettings(samples=9, elites=1, proposals=8, iterations=1)
    given = none.clone()
    given[:, :, 3] = best[:, :, 0]
    action, mean = mppi(value, given, start, only, sources, explore=False)
    torch.testing.assert_close(mean, best[:, :, 0])
    torch.testing.assert_close(action, best[:, :, 0, 0])
    noisy, _ = mppi(value, given, start, only, sources, explore=True)
    away = (noisy - action).flatten()
    assert 0.02 < away.std().item() < 0.1  # The least deviation is 0.05.


def test_an_elite_is_drawn_by_its_weight():
    settings = MPPISettings(samples=2, proposals=1, elites=2, iterations=1, temperature=1.0)

    def value(actions):  # What is proposed is 3 times as likely.
        shown = torch.zeros(actions.shape[:3])
        shown[:, :, 0] = math.log(3.0)
        return shown

    start = torch.full((1, 3000, 1, 1), -5.0)
    action, _ = mppi(
        value, torch.ones(1, 3000, 1, 1, 1), start, settings, generators([0], "cpu"), explore=False
    )
    assert (action == 1.0).float().mean().item() == pytest.approx(0.75, abs=0.04)


def test_returns_are_imagined_step_by_step():
    model, source = _model(), torch.Generator().manual_seed(6)
    latent = model.encode(_normal(source, 2, NUMBER, 4, OBSERVATION))
    actions = _normal(source, 2, NUMBER, 4, HORIZON, ACTION).tanh()
    noise, pair = _normal(source, 2, NUMBER, 4, ACTION), torch.tensor([[2, 1], [0, 2]])
    result = imagined(model, latent, actions, noise, pair, DISCOUNT)
    target = torch.zeros(2, NUMBER, 4)
    for t in range(HORIZON):
        action = actions[..., t, :]
        target += DISCOUNT**t * expected(model.rewards(latent, action)).detach()
        latent = model.following(latent, action)
    last, _ = model.sample(latent, noise)
    values = expected(model.values(latent, last)).detach()
    for k in range(2):
        own = (values[k, pair[k, 0]] + values[k, pair[k, 1]]) / 2
        torch.testing.assert_close(result[k], target[k] + DISCOUNT**HORIZON * own)


# ---------------------------------------------------------------------- learner


def _learner(seeds, settings=SMALL):
    return TDMPC2(settings, seeds, 2, OBSERVATION, ACTION, discount=DISCOUNT)


def _step(seeds, t):
    """Of two environments of each seed, which depends on the seed alone."""
    arrays = []
    for seed in seeds:
        source = torch.Generator().manual_seed(1000 * seed + t)
        no = torch.full((2,), t % 5 == 4)
        arrays.append((
            _normal(source, 2, OBSERVATION), _normal(source, 2, ACTION).tanh(),
            _normal(source, 2), _normal(source, 2, OBSERVATION), torch.zeros_like(no), no,
        ))  # fmt: skip
    return Step(*(torch.stack(each) for each in zip(*arrays, strict=True)))


def _acted(learner, seeds, explore):
    """Actions in two steps, of which the second goes on from the first."""
    first, memory, actions = torch.ones(len(seeds), 2, dtype=torch.bool), None, []
    for t in range(2):
        seen = _step(seeds, 50 + t).observation
        action, memory = learner.act(seen, first, memory, explore=explore)
        actions.append(action)
        first = torch.zeros_like(first)
    return torch.stack(actions, 1)


def _perturbed(learner, seed=7):
    """The same learner, whose networks, targets and scale are unlike those at first."""
    source = torch.Generator().manual_seed(seed)
    for parameter in learner.model.parameters():
        parameter.data += 0.3 * _normal(source, *parameter.shape)
    learner.scale.fill_(2.0)
    return learner


def test_updates_are_those_of_pytorch_s_own_optimizers():
    settings = TDMPC2Settings(**{**vars(SMALL), "largest_gradient": 0.3, "tau": 0.2})
    learner = _perturbed(_learner([1], settings))
    oracle, scale, draws = copy.deepcopy(learner.model), 2.0, []
    rest = [*oracle.dynamics.parameters(), *oracle.reward.parameters()]
    rest += oracle.critics.parameters()
    encoder, actor = [*oracle.encoder.parameters()], [*oracle.actor.parameters()]
    adam = torch.optim.Adam([{"params": encoder, "lr": 9e-5}, {"params": rest}], 1e-2)
    of_policy = torch.optim.Adam(actor, 1e-2, eps=1e-5)
    draw = learner._draws
    learner._draws = lambda *sizes: draws.append(draw(*sizes)) or draws[-1]
    for seed in range(3):
        step = _stretches(1, seed)
        learner.update(step)
        result, latent = losses.model_losses(
            oracle, step, *draws[-2], discount=DISCOUNT, rho=settings.rho
        )
        adam.zero_grad()
        (20.0 * result["consistency"] + 0.1 * result["reward"] + 0.1 * result["value"]).backward()
        assert nn.utils.clip_grad_norm_([*encoder, *rest], 0.3) > 0.3
        adam.step()
        of_policy.zero_grad()
        values, entropy = losses.policy_values(oracle, latent, *draws[-1])
        low, high = np.percentile(values[0, :, 0].detach().numpy(), [5, 95])
        scale += 0.2 * (max(high - low, 1.0) - scale)
        counts = losses.counted(step.ended)
        counts = torch.cat([torch.ones(1, NUMBER, 1), counts], -1)
        weights = losses.shares(counts, settings.rho)
        (-(weights * (values / scale + 1e-4 * entropy)).sum()).backward()
        nn.utils.clip_grad_norm_(actor, 0.3)
        of_policy.step()
        pairs = zip(oracle.targets.parameters(), oracle.critics.parameters(), strict=True)
        for mean, own in pairs:
            mean.data = 0.8 * mean.data + 0.2 * own.data
        assert learner.scale.item() == pytest.approx(scale, rel=1e-4)
    for own, other in zip(learner.model.parameters(), oracle.parameters(), strict=True):
        torch.testing.assert_close(own, other, rtol=1e-3, atol=1e-4)


def test_values_are_never_scaled_up():
    learner = _learner([1])
    learner.scale.fill_(2.0)
    learner.update(_stretches(1))  # All values are about 0.
    assert learner.scale.item() == pytest.approx(2.0 + 0.01 * (1.0 - 2.0))


def test_a_state_goes_on_with_the_same_bits():
    seeds = [1, 2]
    first, second = (_learner(seeds) for _ in range(2))
    for t in range(6):
        first.learn(_step(seeds, t))
    _perturbed(first)
    _acted(first, seeds, explore=True)
    second.set_state(first.get_state())
    before = _acted(first, seeds, explore=False)
    for learner in (first, second):
        learner.learn(_step(seeds, 9))
    assert torch.equal(*(_acted(each, seeds, explore=True) for each in (first, second)))
    assert all(map(torch.equal, first.model.parameters(), second.model.parameters()))
    assert first.updates == second.updates and torch.equal(first.scale, second.scale)
    assert not torch.equal(before, _acted(first, seeds, explore=False))


def test_evaluations_begin_alike_and_plans_go_on_within_an_episode():
    seeds = [1, 2]
    learner = _learner(seeds)
    seen, no = _step(seeds, 0).observation, torch.zeros(2, 2, dtype=torch.bool)
    state = learner.get_state()["random"]
    assert torch.equal(*(_acted(learner, seeds, explore=False) for _ in range(2)))
    assert all(map(torch.equal, state, learner.get_state()["random"]))
    given = []

    def plan(latent, mean, *, explore):
        given.append(mean)
        return None, None

    learner._plan = plan
    memory = torch.arange(2.0 * 2 * HORIZON * ACTION).reshape(2, 2, HORIZON, ACTION) + 1.0
    first = no.clone()
    first[1, 0] = True
    learner.act(seen, first, memory, explore=False)
    assert torch.equal(given[0][0, :, :2], memory[0, :, 1:])
    assert (given[0][0, :, 2] == 0.0).all() and (given[0][1, 0] == 0.0).all()
    assert torch.equal(given[0][1, 1, :2], memory[1, 1, 1:])


def test_the_policy_prior_is_what_acts_without_plans():
    seeds = [1, 2]
    learner = _learner(seeds, TDMPC2Settings(**{**vars(SMALL), "plans": "never"}))
    for t in range(4):
        learner.learn(_step(seeds, t))
    seen = _step(seeds, 3).observation
    action, memory = learner.act(seen, None, None, explore=False)
    assert memory is None
    for k in range(2):
        program = torch.export.export(learner.policy(k).eval(), (seen[k, :1],))
        torch.testing.assert_close(program.module()(seen[k, :1]), action[k, :1])
    for plans in ("always", "evaluation"):
        planner = _learner(seeds, TDMPC2Settings(**{**vars(SMALL), "plans": plans}))
        with pytest.raises(InvalidArgumentError, match=f"plans='{plans}'"):
            planner.policy(0)


@pytest.mark.parametrize(("plans", "remembers"), [("always", (1, 1)), ("evaluation", (0, 1))])
def test_when_it_plans(plans, remembers):
    learner = _learner([1], TDMPC2Settings(**{**vars(SMALL), "plans": plans, "random_steps": 0}))
    seen, first = _step([1], 0).observation, torch.ones(1, 2, dtype=torch.bool)
    for explore, target in zip((True, False), remembers, strict=True):
        action, memory = learner.act(seen, first, None, explore=explore)
        assert (memory is not None) == bool(target)
        assert action.shape == (1, 2, ACTION) and (action.abs() <= 1.0).all()


@pytest.mark.long
def test_it_learns_to_reach_a_point():
    """A point in 0..1 on a line is moved by the action; what counts is where it ends, at 0.5.

    Two numbers tell where it is, as an encoder without biases knows but the direction of vectors.
    """
    settings = TDMPC2Settings(
        latent=16, simplex=4, encoder=32, hidden=(32,), critics=2, bins=41, log_std=(-2.5, 2.0),
        samples=64, proposals=8, elites=8, iterations=3, plans="evaluation", random_steps=64,
        updates=4, pretraining=60, batch=64, replay=2_000, rate=3e-3, encoder_rate=2e-3, tau=0.05,
        entropy=0.1,
    )  # fmt: skip
    seeds, num_envs = [0, 1], 16
    learner, source = (
        TDMPC2(settings, seeds, num_envs, 2, 1, discount=0.9),
        generators(seeds, "cpu"),
    )

    def seen(place):
        return torch.cat([place, 1.0 - place], -1)

    no, place = torch.zeros(2, num_envs, dtype=torch.bool), drawn(source, num_envs, 1, normal=False)
    for t in range(60):
        action, _ = learner.act(seen(place), no, None, explore=True)
        following = (place + 0.5 * action).clamp(0.0, 1.0)
        reward = -10.0 * (following - 0.5).abs()[..., 0]
        ends = torch.full_like(no, t % 4 == 3)
        learner.learn(Step(seen(place), action, reward, seen(following), no, ends))
        place = drawn(source, num_envs, 1, normal=False) if t % 4 == 3 else following
    place = torch.linspace(0.0, 1.0, 9)[None, :, None].expand(2, -1, -1)
    planned, _ = learner.act(seen(place), no[:, :9], None, explore=False)
    for action in (planned, learner.model.actor.mean(learner.model.encode(seen(place)))):
        ends = (place + 0.5 * action).clamp(0.0, 1.0)
        assert (ends - 0.5).abs().mean() < 0.1  # Where it stays put: 0.28.


# ---------------------------------------------------------------------- settings, training


def test_bad_settings_are_refused():
    with pytest.raises(InvalidArgumentError, match="replay"):
        _learner([0], TDMPC2Settings(**{**vars(SMALL), "replay": 5}))
    images = Problem("straighten_rope", {}, [0], 1, (64, 64, 3), 8, 1.0, "cpu")
    with pytest.raises(InvalidArgumentError, match="observation"):
        make(SMALL, images)


def test_discounts_grow_with_episodes():
    assert [discount_of(n) for n in (3, 15, 75, 100)] == [0.95] * 4
    assert discount_of(500) == pytest.approx(0.99) and discount_of(10_000) == 0.995


@pytest.mark.parametrize("preset", ["paper", "fast"])
def test_presets_suit_every_task(preset):
    for task in softgym_mj.TASKS:
        training, method = find_preset("tdmpc2", preset, task)
        assert (training.task, method.preset) == (task, preset)
        assert method.settings.replay >= training.num_envs * method.settings.horizon
    defaults, published = TDMPC2Settings(updates=10), find_preset("tdmpc2", "paper", "fold_cloth")
    assert published[1].settings == defaults


SEEDS = [4, 9]
METHOD = find_method(
    "tdmpc2", **{**SIZES, "iterations": 1}, random_steps=4, pretraining=2, updates=2, batch=8,
    replay=24,
)  # fmt: skip
SETTINGS = TrainingSettings(
    "straighten_rope", env_steps=24, num_envs=2, part=8, evaluate_every=3, episodes=1,
    final_episodes=1, fidelity="fast", episode_steps=6,
)  # fmt: skip
