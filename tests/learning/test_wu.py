"""Wu et al.'s pick and place: its oracles are labels of pixels and PyTorch's layers."""

import numpy as np
import pytest
import torch
from torch.nn import functional

import softgym_mj
from softgym_mj.exceptions import InvalidArgumentError
from softgym_mj.learning.learner import Problem
from softgym_mj.learning.methods.wu.cloth_pixels import cloth_pixels, pixel_centers
from softgym_mj.learning.methods.wu.learner import PickAndPlace, WuSettings, make
from softgym_mj.learning.networks import LayerNorm, Linear, drawn, generators
from softgym_mj.learning.registry import find_method
from softgym_mj.learning.replay import Batch
from softgym_mj.learning.settings import TrainingSettings

LINEN, CRIMSON, FLOOR, SHADOW, RING = (
    (213, 180, 129), (150, 20, 60), (209, 206, 202), (124, 122, 119), (235, 128, 25),
)  # fmt: skip
SIZE = 8, 12
SMALL = WuSettings(channels=(4, 3), hidden=(16,), random_steps=8, updates=2, batch=8, replay=24)


def _blobs(corner, size, half=1):
    """Images (..., *size, 3) of a piece of cloth whose middle is at these rows and columns."""
    rows, columns = (torch.arange(number) for number in size)
    near = (rows[:, None] - corner[..., 0, None, None]).abs().maximum(
        (columns - corner[..., 1, None, None]).abs()
    ) <= half  # fmt: skip
    colors = torch.tensor([FLOOR, LINEN], dtype=torch.uint8)
    return colors[near.long()]


def _images(source, number):
    """Of a piece of cloth anywhere, with some noise, for two seeds."""
    corner = torch.rand(2, number, 2, generator=source) * torch.tensor(SIZE)
    noise = torch.randint(0, 8, (2, number, *SIZE, 3), generator=source, dtype=torch.uint8)
    return _blobs(corner.long(), SIZE) + noise


def _batch(seed=0):
    """Six steps of two seeds."""
    source = torch.Generator().manual_seed(seed)
    images, following = (_images(source, 6) for _ in range(2))
    action = 2.0 * torch.rand(2, 6, 5, generator=source) - 1.0
    reward = torch.randn(2, 6, generator=source)
    return Batch(images, action, reward, following, torch.full((2, 6), 0.9))


# ------------------------------------------------------------------ cloth


def test_cloth_is_linen_or_crimson():
    result = cloth_pixels(torch.tensor([LINEN, CRIMSON, FLOOR, SHADOW, RING, (0, 0, 0)]))
    assert result.tolist() == [True, True, False, False, False, False]
    dark = cloth_pixels((torch.tensor([LINEN, CRIMSON, FLOOR, SHADOW, RING]) * 0.4).byte())
    assert dark.tolist() == [True, True, False, False, False]


@pytest.mark.parametrize("task", ["spread_cloth", "fold_cloth"])
def test_cloth_pixels_are_those_of_the_labels(task):
    env = softgym_mj.load(
        task, split="all", actor="pixel_pick_and_place", fidelity="fast",
        observation=["rgb", "segmentation"], image_size=(64, 64),
    )  # fmt: skip
    masks, labels = [], []
    for variation in (1, 804):
        timestep = env.reset(variation)
        for end in (False, True):
            masks.append(cloth_pixels(torch.tensor(timestep.observation["rgb"])).numpy())
            labels.append(timestep.observation["segmentation"] == 1)
            if not end:
                row, column = np.argwhere(labels[-1])[0]
                pick = pixel_centers(64, 64)[64 * row + column].numpy()
                timestep = env.step(np.array([*pick, 0.3, 0.2, -0.5]))
    mask, label = np.array(masks), np.array(labels)
    each = (mask & label).sum((1, 2)) / (mask | label).sum((1, 2))
    assert (mask & label).sum() / (mask | label).sum() > 0.95
    assert each.min() > 0.9  # A tenth of the pixels of the smallest pieces are edges.
    near = functional.max_pool2d(torch.tensor(label).float(), 3, 1, 1).numpy() > 0
    assert (mask & ~near).sum() < 0.01 * mask.sum()


def test_picks_are_cloth_pixels_with_equal_chances():
    wu, number = PickAndPlace(SMALL, [0, 1], SIZE), 4000
    corner = torch.tensor([[[3, 4]], [[0, 11]]])  # Nine pixels, and four of them in the corner.
    images = _blobs(corner, SIZE).expand(-1, number, -1, -1, -1)
    pick = wu.draw_pick(images)
    for k, cloth in enumerate(cloth_pixels(images)[:, 0].flatten(1)):
        centers = pixel_centers(*SIZE)[cloth]
        shares = (pick[k][:, None] == centers).all(-1).float().mean(0)
        assert len(shares) == (9, 4)[k] and shares.sum() == 1.0
        assert (shares * len(shares) - 1.0).abs().max() < 0.2
    bare = torch.tensor(FLOOR, dtype=torch.uint8).expand(2, number, *SIZE, 3)
    anywhere = wu.draw_pick(bare)
    assert len(anywhere[0].unique(dim=0)) == SIZE[0] * SIZE[1]  # There is no cloth.


def test_pixels_are_told_as_the_actor_takes_them():
    centers = pixel_centers(2, 4)
    assert centers[1].tolist() == [-0.25, -0.5] and centers[4].tolist() == [-0.75, 0.5]


# ------------------------------------------------------------------ losses


def _looked(looking, k, image, *numbers):
    """What a network of seed number k finds, by PyTorch's own layers."""
    x = (image.float() / 255.0 * 2.0 - 1.0).permute(2, 0, 1)[None]
    parts = looking.convolutions
    for weight, bias, norm in zip(parts.weights, parts.biases, parts.norms, strict=True):
        x = functional.conv2d(x, weight[k], bias[k], stride=2, padding=1)
        scale, shift = (value[k, 0].view(x.shape[1:]) for value in (norm.weight, norm.bias))
        x = functional.leaky_relu(functional.layer_norm(x, x.shape[1:], scale, shift))
    pick, *place = numbers
    x = torch.cat([x.flatten(), pick.tile(50), *place])
    for layer in looking.head:
        if isinstance(layer, Linear):
            x = x @ layer.weight[k] + layer.bias[k, 0]
        elif isinstance(layer, LayerNorm):
            x = functional.layer_norm(x, x.shape, layer.weight[k, 0], layer.bias[k, 0])
        else:
            x = functional.leaky_relu(x)
    return x


def _drawn_place(wu, k, image, pick, noise):
    """A place and its log density, by PyTorch's distributions."""
    mean, log_std = _looked(wu.actor.body, k, image, pick).chunk(2)
    base = torch.distributions.Normal(mean, log_std.clamp(-20.0, 2.0).exp())
    squashed = torch.distributions.TransformedDistribution(
        base, [torch.distributions.transforms.TanhTransform(cache_size=1)]
    )
    place = squashed.transforms[0](mean + noise * base.scale)
    return place, squashed.log_prob(place).sum()


def test_losses_are_those_of_the_paper(monkeypatch):
    wu = PickAndPlace(SMALL, [0, 1], SIZE)
    for step in range(2):  # So that targets are no copies, nor the entropy weight its start.
        wu.update(_batch(seed=step))
    batch, noises = _batch(seed=5), torch.randn(2, 2, 6, 3)
    following = torch.rand(2, 6, 2)
    monkeypatch.setattr(wu, "draw_pick", lambda images: following)
    left = iter(noises)
    monkeypatch.setattr(wu, "_noise", lambda *shape: next(left))
    before = wu.alpha
    calls = []
    monkeypatch.setattr(
        "softgym_mj.learning.methods.sac.step", lambda adam, loss: calls.append(loss)
    )
    separate, losses = [], wu._actor_losses
    monkeypatch.setattr(
        wu, "_actor_losses", lambda *of: separate.append(losses(*of)) or separate[0]
    )
    wu.update(batch)  # No step is taken, so that all losses are of the same networks.
    critic, both = calls
    actor, alpha = separate[0]
    torch.testing.assert_close(both, actor + alpha)
    assert (before - 1.0).abs().min() > 1e-4
    for k in range(2):
        expected, of_actor, surplus = 0.0, 0.0, 0.0
        for i in range(6):
            picked, placed = batch.action[k, i, :2], batch.action[k, i, 2:]
            next_image, image = batch.next_observation[k, i], batch.observation[k, i]
            place, density = _drawn_place(wu, k, next_image, following[k, i], noises[0, k, i])
            each = [_looked(t, k, next_image, following[k, i], place) for t in wu.targets.pair]
            target = batch.reward[k, i] + 0.9 * (min(each) - before[k] * density)
            for own in wu.critics.pair:
                expected += 0.5 * (_looked(own, k, image, picked, placed) - target) ** 2 / 6
            place, density = _drawn_place(wu, k, image, picked, noises[1, k, i])
            each = [_looked(own, k, image, picked, place) for own in wu.critics.pair]
            of_actor += (before[k] * density - min(each)) / 6
            surplus -= (density - 3.0) / 6
        assert critic[k].item() == pytest.approx(expected.item(), rel=1e-3)
        assert actor[k].item() == pytest.approx(of_actor.item(), rel=1e-3)
        of_alpha = before[k].log().item() * surplus.item()
        assert alpha[k].item() == pytest.approx(of_alpha, rel=1e-3, abs=1e-6)


def test_the_best_are_a_fifth_of_the_cloth_by_what_critics_say():
    wu, number = PickAndPlace(SMALL, [0, 1], SIZE), 60
    wu.update(_batch())
    corner = torch.tensor([[[3, 4]], [[4, 8]]])
    images = _blobs(corner, SIZE, half=2)
    images[1, 0, 2, 6:9] = torch.tensor(FLOOR, dtype=torch.uint8)  # Fewer than of the other.
    cloth = cloth_pixels(images)[:, 0].flatten(1)
    result = wu.best(images.expand(-1, number, -1, -1, -1), generators([0, 1], "cpu"))
    for k in range(2):
        actions = []
        for pick in pixel_centers(*SIZE)[cloth[k]]:
            place = _looked(wu.actor.body, k, images[k, 0], pick).chunk(2)[0].tanh()
            both = [_looked(own, k, images[k, 0], pick, place) for own in wu.critics.pair]
            actions.append((min(both).item(), torch.cat([pick, place])))
        actions.sort(key=lambda each: -each[0])
        assert len(actions) == (25, 22)[k]
        best = torch.stack([action for _, action in actions[:5]])  # Rounded up.
        near = (result[k][:, None] - best).abs().amax(-1) < 1e-4
        assert near.any(1).all() and near.any(0).all()


# ------------------------------------------------------------------ learning


def _problem(observation=(*SIZE, 3), action=5):
    settings = {"actor": "pixel_pick_and_place"}
    return Problem("spread_cloth", settings, (0, 1), 2, observation, action, 1.0, "cpu")


def test_what_is_done_at_random_begins_at_cloth():
    learner, source = make(SMALL, _problem()), torch.Generator().manual_seed(5)
    images, no = _images(source, 200), torch.zeros(2, 200, dtype=torch.bool)
    action, _ = learner.act(images, no, None, explore=True)
    at = (action[..., None, :2] == pixel_centers(*SIZE)).all(-1)
    assert at.sum() == 400 and (at & cloth_pixels(images).flatten(2)).sum() == 400
    assert action[..., 2:].abs().max() > 0.99 and action[..., 2:].mean().abs() < 0.1


def test_an_evaluation_has_random_numbers_of_its_own():
    learner, source = make(SMALL, _problem()), torch.Generator().manual_seed(5)
    images, no = _images(source, 3), torch.zeros(2, 3, dtype=torch.bool)
    state = learner.get_state()
    (one, memory), (again, _) = (learner.act(images, no, None, explore=False) for _ in range(2))
    assert torch.equal(one, again)
    others = [learner.act(images, no, memory, explore=False)[0] for _ in range(8)]
    assert any(not torch.equal(one, other) for other in others)
    for kept, now in zip(
        state["algorithm"]["random"], learner.get_state()["algorithm"]["random"], strict=True
    ):
        assert torch.equal(kept, now)
    with pytest.raises(InvalidArgumentError, match="samples the best actions"):
        learner.policy(0)


@pytest.mark.long
def test_it_learns_to_bring_a_piece_of_cloth_to_the_middle():
    """A piece is moved by the place; what counts is how far from the middle it ends."""
    settings = WuSettings(
        channels=(8, 4), hidden=(32,), actor_rate=6e-3, critic_rate=6e-3, alpha_rate=3e-3, alpha=0.1
    )
    seeds, size, number = [0, 1], (12, 12), 24
    wu, source = PickAndPlace(settings, seeds, size), generators(seeds, "cpu")

    def scene(number):
        corner = (1 + 10 * drawn(source, number, 2, normal=False)).long()
        middle = (2.0 * corner.flip(-1) + 1.0) / size[0] - 1.0  # Right and down.
        return _blobs(corner, size), middle

    for _ in range(300):
        images, middle = scene(number)
        place = 2.0 * drawn(source, number, 3, normal=False) - 1.0
        reward = -(middle + place[..., :2]).norm(dim=-1)
        action = torch.cat([wu.draw_pick(images), place], -1)
        wu.update(Batch(images, action, reward, images, torch.zeros(2, number)))
    images, middle = scene(40)
    action = wu.act(images, explore=False)
    before, after = middle.norm(dim=-1).mean(1), (middle + action[..., 2:4]).norm(dim=-1).mean(1)
    assert before.min() > 0.6 and after.max() < 0.35


METHOD = find_method(
    "wu", channels=(4, 4), hidden=(8,), random_steps=2, updates=1, batch=4, replay=8
)
SETTINGS = TrainingSettings(
    "spread_cloth", observation="rgb", image_size=(16, 16), actor="pixel_pick_and_place",
    env_steps=6, num_envs=1, part=3, evaluate_every=2, episodes=1, final_episodes=1,
    fidelity="fast", episode_steps=2,
)  # fmt: skip


# ------------------------------------------------------------------ settings


def test_bad_settings_are_refused():
    with pytest.raises(InvalidArgumentError, match="observation"):
        make(SMALL, _problem(observation=(12,)))
    with pytest.raises(InvalidArgumentError, match="pixel_pick_and_place"):
        make(SMALL, _problem(action=8))
