"""PlaNet: its oracles are PyTorch's and torchrl's layers and losses, and one seed alone."""

import dataclasses

import numpy as np
import pytest
import torch
from torch import nn

from softgym_mj.exceptions import InvalidArgumentError
from softgym_mj.learning.learner import Problem, Step
from softgym_mj.learning.methods.planet.latent import WorldModel, centered
from softgym_mj.learning.methods.planet.layers import GRU, Decoder, Encoder
from softgym_mj.learning.methods.planet.learner import PlaNet, PlaNetSettings, losses, make, plan
from softgym_mj.learning.networks import drawn, generators
from softgym_mj.learning.registry import find_method
from softgym_mj.learning.settings import TrainingSettings
from tests.learning.plain_layers import plain_layer

SIZE, ACTION = 16, 1
SIZES = {"belief": 24, "latent": 4, "hidden": 24, "channels": 8}
TINY = PlaNetSettings(
    random_steps=8, updates=1, batch=4, length=5, replay=400, horizon=3, iterations=2,
    candidates=8, elites=3, **SIZES,
)  # fmt: skip


def _model(seeds, **sizes):
    return WorldModel(generators(seeds, "cpu"), SIZE, ACTION, **{**SIZES, **sizes})


def _problem(seeds=(0, 1), num_envs=2, size=SIZE):
    return Problem("none", {}, list(seeds), num_envs, (size, size, 3), ACTION, 1.0, "cpu")


# ---------------------------------------------------------------------- layers


def test_the_recurrent_unit_is_pytorchs():
    sources = generators([1, 2], "cpu")
    ours, x, state = GRU(sources, 5, 7), drawn(sources, 3, 5), drawn(sources, 3, 7)
    for k in range(2):
        own = nn.GRUCell(5, 7)
        own.weight_ih.data, own.bias_ih.data = ours.seen.weight[k].T, ours.seen.bias[k, 0]
        own.weight_hh.data = ours.state_gates.weight[k].T
        own.bias_hh.data = ours.state_gates.bias[k, 0]
        torch.testing.assert_close(ours(x, state)[k], own(x[k], state[k]))


@pytest.mark.parametrize(("size", "kernels"), [(16, [6, 6]), (128, [5, 5, 5, 6, 6])])
def test_images_go_through_pytorchs_convolutions(size, kernels):
    sources = generators([1, 2], "cpu")
    encoder, decoder = Encoder(sources, size, 16), Decoder(sources, size, 9, 64, 16)
    image, features = drawn(sources, 2, size, size, 3), drawn(sources, 2, 9)
    assert [layer.weight.shape[-1] for layer in decoder.layers] == kernels
    assert encoder(image).shape == (2, 2, 64) and decoder(features).shape == image.shape
    for k in range(2):
        x = image[k].permute(0, 3, 1, 2)
        for layer in encoder.layers:
            x = nn.functional.conv2d(x, layer.weight[k], layer.bias[k], stride=2).relu()
        torch.testing.assert_close(encoder(image)[k], x.flatten(1), rtol=1e-4, atol=1e-5)
        x = plain_layer(decoder.first, k)(features[k])[..., None, None]
        for i, layer in enumerate(decoder.layers):
            x = nn.functional.conv_transpose2d(x, layer.weight[k], layer.bias[k], stride=2)
            x = x.relu() if i < len(kernels) - 1 else x
        result = decoder(features)[k].permute(0, 3, 1, 2)
        torch.testing.assert_close(result, x, rtol=1e-4, atol=1e-5)


def test_first_weights_are_spread_as_pytorchs_and_of_their_seed_alone():
    both, alone = (Encoder(generators(seeds, "cpu"), 128, 256) for seeds in ([1, 2], [2]))
    for ours, own in zip(both.layers, alone.layers, strict=True):
        assert torch.equal(ours.weight[1], own.weight[0])
        bound = nn.Conv2d(*reversed(own.weight.shape[1:3]), 4).weight.abs().max().item()
        assert own.weight.abs().max().item() == pytest.approx(bound, rel=0.02)
    transposed = Decoder(generators([3], "cpu"), 128, 230, 1024, 256).layers[0].weight
    bound = nn.ConvTranspose2d(1024, 128, 5).weight.abs().max().item()
    assert transposed.shape == (1, 1024, 128, 5, 5)
    assert transposed.abs().max().item() == pytest.approx(bound, rel=0.02)


def test_states_are_those_of_torchrl():
    """Of whose RSSM the activations are replaced, and the deviations' bound by a sum."""
    from torchrl.data import Bounded
    from torchrl.modules.models.model_based import RSSMPosterior, RSSMPrior

    model, k = _model([3, 4]), 1
    sources = generators([5, 6], "cpu")
    belief, latent, action = (drawn(sources, 3, n) for n in (24, 4, ACTION))
    seen, noise = drawn(sources, 3, 32), torch.zeros(3, 4)
    prior = RSSMPrior(Bounded(-1.0, 1.0, (ACTION,)), 24, 24, 4, 1e-9, ACTION)
    posterior = RSSMPosterior(24, 4, 1e-9, 24, 32)
    joined, cell = model._join, model._cell
    prior.action_state_projector = nn.Sequential(plain_layer(joined, k), nn.ReLU())
    prior.rnn.weight_ih.data, prior.rnn.bias_ih.data = cell.seen.weight[k].T, cell.seen.bias[k, 0]
    prior.rnn.weight_hh.data = cell.state_gates.weight[k].T
    prior.rnn.bias_hh.data = cell.state_gates.bias[k, 0]
    for network, ours in (
        (prior.rnn_to_prior_projector, model._prior),
        (posterior.obs_rnn_to_post_projector, model._posterior),
    ):
        network[0], network[2] = plain_layer(ours[0], k), plain_layer(ours[2], k)
        network[1] = nn.ReLU()
    after = model.advance(belief, latent, action)
    mean, deviation, _, expected = prior(latent[k], belief[k], action[k], noise)
    torch.testing.assert_close(after[k], expected)
    result = model.prior(after)
    torch.testing.assert_close(result.mean[k], mean)
    torch.testing.assert_close(result.deviation[k], deviation + 0.1)
    mean, deviation, _ = posterior(expected, seen[k], noise)
    result = model.posterior(after, seen)
    torch.testing.assert_close(result.mean[k], mean)
    torch.testing.assert_close(result.deviation[k], deviation + 0.1)


# ---------------------------------------------------------------------- losses


def _stretches(ended=()):
    """Random stretches of env steps, in whose given steps episodes end; images, and noise."""
    sources, lead = generators([1, 2], "cpu"), (3, 6)
    over = torch.zeros(2, *lead, dtype=torch.bool)
    for place in ended:
        over[:, :, place] = True
    frames = drawn(sources, *lead, SIZE, SIZE, 3)
    step = Step(
        frames, drawn(sources, *lead, ACTION), drawn(sources, *lead), frames,
        torch.zeros_like(over), over,
    )  # fmt: skip
    return step, 0.2 * frames, drawn(sources, *lead, 4)


def test_losses_are_those_of_torchrl():
    """Its `DreamerModelLoss` of what the model of one seed predicts."""
    from tensordict import TensorDict
    from tensordict.nn import TensorDictModule, TensorDictSequential
    from torchrl.objectives import DreamerModelLoss

    model, (step, image, noise) = _model([3, 4]), _stretches()
    result = losses(model, step, image, noise, 3.0)
    path = model.observe(image, step.action, step.ended, noise)
    flat = path.belief.flatten(1, 2), path.latent.flatten(1, 2)
    images, rewards = model.image(*flat), model.reward(*flat)
    world = TensorDictSequential(
        TensorDictSequential(
            TensorDictModule(nn.Identity(), [("next", "images")], [("next", "reco_pixels")])
        ),
        TensorDictModule(nn.Identity(), [("next", "rewards")], [("next", "reward")]),
    )
    for k in range(2):
        following = TensorDict(
            {
                "pixels": image[k], "images": images[k].unflatten(0, (3, 6)),
                "reward": step.reward[k, ..., None], "rewards": rewards[k].reshape(3, 6, 1),
                "prior_mean": path.prior.mean[k], "prior_std": path.prior.deviation[k],
                "posterior_mean": path.posterior.mean[k],
                "posterior_std": path.posterior.deviation[k],
            },
            [3, 6],
        )  # fmt: skip
        both = TensorDict({"next": following}, [3, 6])
        target, _ = DreamerModelLoss(world, free_nats=3.0)(both)
        for name, other in (
            ("image_loss", "reco"),
            ("reward_loss", "reward"),
            ("divergence", "kl"),
        ):
            torch.testing.assert_close(result[name][k], target[f"loss_model_{other}"][0])
        bare, _ = DreamerModelLoss(world, free_nats=0.0)(both)
        expected = losses(model, step, image, noise, 0.0)["divergence"][k]
        torch.testing.assert_close(expected, bare["loss_model_kl"][0])
        assert not torch.isclose(expected, result["divergence"][k])


def test_stretches_never_cross_episodes():
    """Two parts of a stretch are what they are as stretches of their own."""
    model, (step, image, noise) = _model([3, 4]), _stretches(ended=[2])
    whole = losses(model, step, image, noise, 0.0)
    for name, value in whole.items():
        parts = []
        for part in (slice(0, 3), slice(3, 6)):
            own = Step(*(each[:, :, part] for each in step))
            parts.append(losses(model, own, image[:, :, part], noise[:, :, part], 0.0)[name])
        torch.testing.assert_close(value, (parts[0] + parts[1]) / 2.0)
    crossing = losses(model, step._replace(ended=step.terminated), image, noise, 0.0)
    assert not torch.isclose(crossing["divergence"], whole["divergence"]).any()


def test_bfloat16_changes_little_but_the_speed():
    step, image, noise = _stretches()
    result = []
    for kind in (torch.float32, torch.bfloat16):
        model = _model([3, 4], kind=kind)
        result.append(losses(model, step, image, noise, 0.0))
        sum(loss.sum() for loss in result[-1].values()).backward()
        assert all(weight.dtype == weight.grad.dtype for weight in model.parameters())
        assert {weight.dtype for weight in model.parameters()} == {torch.float32}
    for name, loss in result[0].items():
        assert not torch.equal(loss, result[1][name]) or name == "reward_loss"
        torch.testing.assert_close(loss, result[1][name], rtol=0.02, atol=0.02)


def test_frames_are_centered_by_their_bits():
    frames = torch.tensor([0, 7, 8, 255], dtype=torch.uint8)
    steps = np.array([0, 0, 1, 31])
    np.testing.assert_allclose(centered(frames, 5, 0.0), steps / 32 - 0.5)
    np.testing.assert_allclose(centered(frames, 5, 0.75), (steps + 0.75) / 32 - 0.5)
    np.testing.assert_allclose(centered(frames, 8), (frames.numpy() + 0.5) / 256 - 0.5)


# ---------------------------------------------------------------------- planning


def test_plans_are_those_of_a_slow_planner():
    """One environment and one candidate after the other, with the same random numbers."""
    model, seeds, number = _model([3]), [5], 2
    sources = generators([8], "cpu")
    belief, latent = drawn(sources, number, 24), drawn(sources, number, 4)
    with torch.no_grad():
        result = plan(model, belief, latent, generators(seeds, "cpu"), TINY)
        (source,) = generators(seeds, "cpu")
        mean, deviation = np.zeros((number, 3, 1)), np.ones((number, 3, 1))
        for _ in range(TINY.iterations):
            noise = torch.randn(number, 8, 3, 1, generator=source).numpy()
            chances = [torch.randn(number * 8, 4, generator=source) for _ in range(3)]
            for env_index in range(number):
                actions, returns = [], []
                for i in range(8):
                    actions.append(mean[env_index] + deviation[env_index] * noise[env_index, i])
                    state, total = (belief[:, [env_index]], latent[:, [env_index]]), 0.0
                    for t in range(3):
                        action = torch.tensor(actions[-1][t], dtype=torch.float32)[None, None]
                        after = model.advance(*state, action)
                        drawn_latent = model.prior(after).sample(chances[t][env_index * 8 + i])
                        state = after, drawn_latent
                        total += model.reward(*state).item()
                    returns.append(total)
                best = np.array(actions)[np.argsort(returns)[-3:]]
                mean[env_index], deviation[env_index] = best.mean(0), best.std(0)
    np.testing.assert_allclose(result[0], mean[:, 0], rtol=1e-4, atol=1e-4)


def test_what_is_remembered_is_forgotten_where_episodes_begin():
    learner = PlaNet(dataclasses.replace(TINY, random_steps=0), _problem())
    frames = torch.randint(0, 256, (2, 3, SIZE, SIZE, 3), dtype=torch.uint8)
    first, again = torch.ones(2, 3, dtype=torch.bool), torch.zeros(2, 3, dtype=torch.bool)
    again[:, 1] = True
    action, memory = learner.act(frames, first, None, explore=False)
    assert action.shape == (2, 3, ACTION) and action.abs().max() <= 1.0
    changed = memory._replace(belief=memory.belief + 4.0, latent=-memory.latent, action=-action)
    result = []
    for kept in (memory, changed):
        own = kept._replace(sources=generators([1, 2], "cpu"))
        result.append(learner.act(frames, again, own, explore=False)[1])
    assert torch.equal(result[0].belief[:, 1], result[1].belief[:, 1])
    assert torch.equal(result[0].latent[:, 1], result[1].latent[:, 1])
    assert not torch.isclose(result[0].belief[:, [0, 2]], result[1].belief[:, [0, 2]]).all()
    torch.testing.assert_close(learner.act(frames, first, None, explore=False)[0], action)


# ---------------------------------------------------------------------- learning


class _Dot:
    """A dot on a line, moved by actions; rewards are higher the nearer it is to the middle."""

    horizon = 12

    def __init__(self, seeds, num_envs):
        self._sources, self._num_envs = generators(seeds, "cpu"), num_envs
        self._time = torch.arange(num_envs).expand(len(seeds), num_envs) % self.horizon
        self.place = drawn(self._sources, num_envs, normal=False)

    def frames(self):
        columns = torch.arange(SIZE)
        near = (columns - self.place[..., None] * (SIZE - 1)).abs() < 2.5
        rows = (columns - 8).abs() < 4
        lit = 220 * (near[:, :, None, :] & rows[:, None]).to(torch.uint8)
        return lit[..., None].expand(*lit.shape, 3)

    def reward(self):
        return 1.0 - 4.0 * (self.place - 0.5).abs()

    def step(self, observation, action):
        """Steps, and begins anew where an episode has ended."""
        self.place = (self.place + 0.2 * action[..., 0]).clamp(0.0, 1.0)
        self._time = self._time + 1
        ended = self._time % self.horizon == 0
        step = Step(
            observation, action, self.reward(), self.frames(), torch.zeros_like(ended), ended
        )
        fresh = drawn(self._sources, self._num_envs, normal=False)
        self.place = torch.where(ended, fresh, self.place)
        return step


def _go(learner, dots, steps):
    """Acts and learns; returns what was done last."""
    memory, first = None, torch.ones(dots.place.shape, dtype=torch.bool)
    for _ in range(steps):
        observation = dots.frames()
        action, memory = learner.act(observation, first, memory, explore=True)
        step = dots.step(observation, action)
        first = step.ended
        learner.learn(step)
    return action


@pytest.fixture(name="trained", scope="module")
def _trained():
    """A learner of the dot, of 432 env steps and 240 updates."""
    settings = PlaNetSettings(
        random_steps=240, updates=20, batch=16, length=9, replay=640, bits=8, noise=0.3,
        evaluation_noise=0.0, horizon=4, iterations=3, candidates=60, elites=8, rate=3e-3,
        belief=32, latent=4, hidden=32, channels=16, bfloat16=True, fused=True,
    )  # fmt: skip
    learner = PlaNet(settings, _problem([3], num_envs=16))
    _go(learner, _Dot([3], 16), 27)
    return learner


def _played(seed, number, steps):
    """Frames and random actions of dots, and their rewards after each."""
    dots, source = _Dot([seed], number), generators([seed], "cpu")
    dots.horizon = 1000
    frames, actions, rewards = [dots.frames()], [], []
    for _ in range(steps):
        actions.append(2.0 * drawn(source, number, 1, normal=False) - 1.0)
        dots.step(frames[-1], actions[-1])
        frames.append(dots.frames())
        rewards.append(dots.reward())
    return torch.stack(frames, 2), torch.stack(actions, 2), torch.stack(rewards, 2)


@pytest.mark.long
def test_it_predicts_rewards_and_images_from_actions_alone(trained):
    frames, actions, rewards = _played(11, 40, 12)
    model = trained.model
    with torch.no_grad():
        belief, latent = model.nothing(40)
        before = torch.zeros(1, 40, 1)
        for t in range(3):
            belief = model.advance(belief, latent, before)
            latent = model.posterior(belief, model.encoder(centered(frames[:, :, t], 8))).mean
            before = actions[:, :, t]
        states = []
        for action in actions[:, :, 2:].unbind(2):
            belief = model.advance(belief, latent, action)
            latent = model.prior(belief).mean
            states.append((belief, latent))
        expected = torch.stack([model.reward(*state) for state in states], 2)
        images = 255.0 * (torch.stack([model.image(*state) for state in states], 2) + 0.5)
    target = rewards[:, :, 2:]
    error, spread = ((expected - target) ** 2).mean(), target.var()
    assert error < 0.5 * spread
    # Images, too, are predicted better than by their mean or by the last that was seen: by 1 dB.
    future = frames[:, :, 3:].float()
    predicted, mean, still = (
        ((future - other) ** 2).mean((3, 4, 5)).median()
        for other in (images, future.mean((1, 2), keepdim=True), frames[:, :, 2:3].float())
    )
    assert predicted < 10**-0.1 * min(mean, still)


@pytest.mark.long
def test_it_reaches_the_middle_more_often_than_random_actions(trained):
    reached = {}
    for name in ("planned", "random"):
        dots, source = _Dot([21], 24), generators([4], "cpu")
        dots.horizon, memory = 1000, None
        first = torch.ones(1, 24, dtype=torch.bool)
        for _ in range(6):
            action, memory = trained.act(dots.frames(), first, memory, explore=False)
            first = torch.zeros_like(first)
            if name == "random":
                action = 2.0 * drawn(source, 24, 1, normal=False) - 1.0
            dots.step(dots.frames(), action)
        reached[name] = ((dots.place - 0.5).abs() < 0.12).float().mean().item()
    assert reached["planned"] > reached["random"] + 0.4


# ---------------------------------------------------------------------- trainings

METHOD = find_method("planet", **dataclasses.asdict(TINY))
SETTINGS = TrainingSettings(
    "straighten_rope", observation="rgb", image_size=(SIZE, SIZE), env_steps=32, num_envs=2,
    part=16, evaluate_every=2, episodes=1, final_episodes=1, fidelity="fast", episode_steps=6,
)  # fmt: skip


def test_bad_settings_are_refused():
    for problem, name in (
        (dataclasses.replace(_problem(), observation=(7,)), "observation"),
        (_problem(size=24), "image_size"),
        (_problem(num_envs=200), "replay"),
        (_problem(size=128), "channels"),
    ):
        with pytest.raises(InvalidArgumentError, match=name):
            make(TINY, problem)
    with pytest.raises(InvalidArgumentError, match="depend on past observations"):
        make(TINY, _problem()).policy(0)
