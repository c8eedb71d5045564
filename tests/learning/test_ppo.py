"""PPO: its oracles are torchrl's losses, PyTorch's Adam, and one seed alone."""

import pytest
import torch
from tensordict import TensorDict
from tensordict.nn import TensorDictModule
from torch import nn
from torchrl.modules import ProbabilisticActor
from torchrl.objectives import ClipPPOLoss
from torchrl.objectives.value.functional import generalized_advantage_estimate

import softgym_mj
from softgym_mj.exceptions import InvalidArgumentError
from softgym_mj.learning.learner import Problem, Step
from softgym_mj.learning.methods.ppo.learner import PPO, PPOSettings
from softgym_mj.learning.methods.ppo.rollout import Rollout, advantages
from softgym_mj.learning.methods.ppo.stopping import StoppingAdam
from softgym_mj.learning.networks import drawn, generators
from softgym_mj.learning.registry import find_method, find_preset
from softgym_mj.learning.settings import TrainingSettings

OBSERVATION, ACTION, NUM_ENVS = 5, 2, 6
SMALL = PPOSettings(steps=4, epochs=2, minibatches=3, hidden=(16,), entropy_weight=0.01)


def _problem(seeds, observation=OBSERVATION, action=ACTION, num_envs=NUM_ENVS):
    return Problem("straighten_rope", {}, seeds, num_envs, (observation,), action, 1.0, "cpu")


def _normal(source, *shape):
    return torch.randn(shape, generator=source)


def _walk(learner, seeds, steps, source):
    """Has a learner act and learn in a random environment; what it last found."""
    result = {}
    for _ in range(steps):
        lead = 3, NUM_ENVS  # The same for each number of seeds.
        seen, following = (_normal(source, *lead, OBSERVATION)[seeds] for _ in range(2))
        reward, share = _normal(source, *lead)[seeds], torch.rand(lead, generator=source)[seeds]
        action, _ = learner.act(seen, torch.zeros(lead)[seeds] > 0, None, explore=True)
        step = Step(seen, action, reward, following, share < 0.1, share < 0.3)
        result = learner.learn(step) or result
    return result


def _weights(learner):
    return [p.detach().clone() for p in (*learner.policies.parameters(), learner.values[0].weight)]


# ------------------------------------------------------------------ losses


def test_advantages_by_hand():
    # Two steps of an episode, then its horizon; a step of the next one, which diverges.
    result = advantages(
        torch.tensor([1.0, 2.0, 3.0, 4.0]),
        torch.tensor([10.0, 20.0, 30.0, 40.0]),
        torch.tensor([20.0, 30.0, 50.0, torch.nan]),
        torch.tensor([False, False, False, True]),
        torch.tensor([False, False, True, True]),
        discount=0.5, trace=0.5,
    )  # fmt: skip
    third = 3.0 + 0.5 * 50.0 - 30.0  # The value of what was seen last counts.
    second = 2.0 + 0.5 * 30.0 - 20.0 + 0.25 * third
    first = 1.0 + 0.5 * 20.0 - 10.0 + 0.25 * second
    torch.testing.assert_close(result, torch.tensor([first, second, third, 4.0 - 40.0]))


def test_advantages_are_torchrls():
    source, shape = torch.Generator().manual_seed(0), (9, 2, 3)
    reward, value, following = (_normal(source, *shape) for _ in range(3))
    ended = torch.rand(shape, generator=source) < 0.3
    terminated = ended & (torch.rand(shape, generator=source) < 0.5)
    result = advantages(reward, value, following, terminated, ended, discount=0.9, trace=0.8)
    expected, _ = generalized_advantage_estimate(
        0.9, 0.8, value, following, reward, ended, terminated, time_dim=0
    )
    torch.testing.assert_close(result, expected)


def _single(body, k):
    """A network of seed number k, of PyTorch's own layers."""
    layers = []
    for layer in body:
        own = nn.Tanh()
        if not isinstance(layer, nn.Tanh):
            own = nn.Linear(*layer.weight.shape[1:])
            own.weight.data, own.bias.data = layer.weight[k].T.clone(), layer.bias[k, 0].clone()
        layers.append(own)
    return nn.Sequential(*layers)


class _Parameters(nn.Module):
    """What torchrl's Gaussian is made of."""

    def __init__(self, policies, k):
        super().__init__()
        self.body, self.log_std = _single(policies.body, k), policies.log_std[k, 0].detach()

    def forward(self, observation):
        mean = self.body(observation)
        return mean, self.log_std.exp().expand_as(mean)


def test_losses_are_torchrls():
    seeds = [0, 1]
    learner, source = PPO(SMALL, _problem(seeds)), torch.Generator().manual_seed(1)
    _walk(learner, [0, 1], 8, source)
    observation, action = (_normal(source, 2, 12, n) for n in (OBSERVATION, ACTION))
    old = learner.policies.log_density(observation, action).detach()
    old = old + 0.3 * _normal(source, 2, 12)  # Some ratios are clipped, some are not.
    part = Rollout(observation, action, old, 3.0 * _normal(source, 2, 12), _normal(source, 2, 12))
    loss, named = learner.losses(part)
    for k in range(2):
        parameters = TensorDictModule(
            _Parameters(learner.policies, k), ["observation"], ["loc", "scale"]
        )
        actor = ProbabilisticActor(
            parameters, in_keys=["loc", "scale"], return_log_prob=True,
            distribution_class=lambda loc, scale: torch.distributions.Independent(
                torch.distributions.Normal(loc, scale), 1
            ),
        )  # fmt: skip
        critic = TensorDictModule(_single(learner.values, k), ["observation"], ["state_value"])
        oracle = ClipPPOLoss(
            actor, critic, clip_epsilon=SMALL.clip, entropy_coeff=SMALL.entropy_weight,
            critic_coeff=0.5 * SMALL.value_weight, loss_critic_type="l2", normalize_advantage=True,
        )  # fmt: skip
        oracle.set_keys(sample_log_prob="action_log_prob")
        batch = {
            "observation": observation[k], "action": action[k], "action_log_prob": old[k],
            "advantage": part.advantage[k][:, None], "value_target": part.value_target[k][:, None],
        }  # fmt: skip
        expected = oracle(TensorDict(batch, [12]))
        assert 0.0 < expected["clip_fraction"] < 1.0
        ratio = (learner.policies.log_density(observation, action) - old)[k].exp()
        assert named["divergence"][k].item() == pytest.approx(
            (ratio - 1.0 - ratio.log()).mean().item(), rel=1e-5
        )
        for name, own in (("objective", "policy_loss"), ("critic", "value_loss")):
            factor = SMALL.value_weight if name == "critic" else 1.0
            torch.testing.assert_close(expected[f"loss_{name}"], factor * named[own][k])
        total = sum(expected[f"loss_{name}"] for name in ("objective", "critic", "entropy"))
        torch.testing.assert_close(total, loss[k])


# ------------------------------------------------------------------ steps


def test_adam_is_pytorchs_and_stops_for_each_seed():
    source = torch.Generator().manual_seed(2)
    weights = [_normal(source, 2, 3, 2).requires_grad_(), _normal(source, 2, 1, 3).requires_grad_()]
    own = StoppingAdam(weights, 0.1, 0.5)
    alone = [[weight[k].detach().clone().requires_grad_() for weight in weights] for k in range(2)]
    oracles = [torch.optim.Adam(each, 0.1, eps=1e-5) for each in alone]
    for step in range(6):
        targets = [_normal(source, *weight.shape) for weight in weights]
        going = torch.tensor([step not in (0, 3), True])
        pairs = zip(weights, targets, strict=True)
        own.step(sum(((w - t) ** 2).flatten(1).sum(1) for w, t in pairs), going)
        for k, (each, oracle) in enumerate(zip(alone, oracles, strict=True)):
            if going[k]:
                oracle.zero_grad()
                pairs = zip(each, targets, strict=True)
                sum(((w - t[k]) ** 2).sum() for w, t in pairs).backward()
                torch.nn.utils.clip_grad_norm_(each, 0.5)
                oracle.step()
            for weight, expected in zip(weights, each, strict=True):
                torch.testing.assert_close(weight[k], expected)


def test_a_seed_stops_when_its_policy_is_too_far_away():
    settings = PPOSettings(**{**vars(SMALL), "target_divergence": 1e-9})
    learner = PPO(settings, _problem([0, 1]))
    result = _walk(learner, [0, 1], 4, torch.Generator().manual_seed(3))
    # The first minibatch is that of the policy itself.
    assert learner.get_state()["adam"]["count"].tolist() == [1.0, 1.0]
    assert result["going"].tolist() == [0.0, 0.0]
    going = PPO(PPOSettings(**{**vars(SMALL), "target_divergence": 1e9}), _problem([0, 1]))
    result = _walk(going, [0, 1], 4, torch.Generator().manual_seed(3))
    assert going.get_state()["adam"]["count"].tolist() == [6.0, 6.0]
    assert going.updates == 6 and result["going"].tolist() == [1.0, 1.0]


def test_what_is_learned_is_what_was_drawn():
    learner = PPO(SMALL, _problem([0, 1]))
    with torch.no_grad():
        learner.policies.log_std.fill_(1.0)
    seen = torch.zeros(2, NUM_ENVS, OBSERVATION)
    action, _ = learner.act(seen, seen[..., 0] > 0, None, explore=True)
    zeros = torch.zeros(2, NUM_ENVS)
    learner.learn(Step(seen, action, zeros, seen, zeros > 0, zeros > 0))
    drawn_ones = learner.get_state()["steps"]["arrays"]["action"][0]
    assert action.abs().max() == 1.0 < drawn_ones.abs().max()
    torch.testing.assert_close(drawn_ones.clamp(-1.0, 1.0), action)


# ------------------------------------------------------------------ learning


def test_it_learns_to_reach_a_point():
    """A point in 0..1 on a line is moved by the action; what counts is where it ends, at 0.5."""
    settings = PPOSettings(steps=16, epochs=4, minibatches=4, hidden=(32,), rate=3e-3, discount=0.9)
    seeds, num_envs = [0, 1], 32
    learner, source = PPO(settings, _problem(seeds, 1, 1, num_envs)), generators(seeds, "cpu")
    place = drawn(source, num_envs, 1, normal=False)
    for k in range(1, 16 * 25 + 1):
        action, _ = learner.act(place, place[..., 0] > 2.0, None, explore=True)
        following = (place + 0.5 * action).clamp(0.0, 1.0)
        ended = torch.full((2, num_envs), k % 4 == 0)
        reward = -(following - 0.5).abs()[..., 0]
        learner.learn(Step(place, action, reward, following, ended & False, ended))
        place = drawn(source, num_envs, 1, normal=False) if k % 4 == 0 else following
    place = torch.linspace(0.0, 1.0, 9)[None, :, None].expand(2, -1, -1)
    action, _ = learner.act(place, place[..., 0] > 2.0, None, explore=False)
    ends = (place + 0.5 * action).clamp(0.0, 1.0)
    assert (ends - 0.5).abs().mean() < 0.06
    module = learner.policy(1)
    torch.testing.assert_close(module(place[1]), action[1])


METHOD = find_method("ppo", steps=4, epochs=2, minibatches=2, hidden=(16,))
SETTINGS = TrainingSettings(
    "straighten_rope", env_steps=24, num_envs=2, part=12, evaluate_every=2, episodes=1,
    final_episodes=1, fidelity="fast", episode_steps=6,
)  # fmt: skip


def test_the_preset_suits_every_task():
    for task in softgym_mj.TASKS:
        training, method = find_preset("ppo", "fast", task)
        settings = method.settings
        assert (training.task, method.preset, settings.discount) == (task, "fast", 0.97)
        method.make(settings, _problem([0], num_envs=training.num_envs))  # Minibatches are even.


def test_bad_settings_are_refused():
    for number in (5, 24):
        with pytest.raises(InvalidArgumentError, match="minibatches"):
            PPO(PPOSettings(steps=4, minibatches=number), _problem([0]))
