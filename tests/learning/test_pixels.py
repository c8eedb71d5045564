"""Learning from images: its oracles are NumPy's padding, PyTorch's convolutions, one seed alone."""

import numpy as np
import pytest
import torch
from torch import nn

from softgym_mj.exceptions import InvalidArgumentError
from softgym_mj.learning.learner import Problem
from softgym_mj.learning.methods.pixels import (
    Convolutions,
    PixelSAC,
    PixelSettings,
    center,
    cropped,
    picture_size,
)
from softgym_mj.learning.networks import drawn, generators
from softgym_mj.learning.replay import Batch

TINY = {"hidden": (8,), "channels": 4, "features": 6}
SIZE, ACTION = (15, 16), 2
FEW = {"random_steps": 4, "updates": 2, "batch": 4, "replay": 16}


# ------------------------------------------------------------------ shared with tests of methods


def pictures(seeds, number, size=SIZE, seed=0):
    source = torch.Generator().manual_seed(seed)
    shape = seeds, number, *size, 3
    return torch.randint(256, shape, generator=source, dtype=torch.uint8)


def batch_of_images(size=SIZE, seed=0):
    """Five steps of two seeds."""
    source = torch.Generator().manual_seed(seed)
    action = torch.randn(2, 5, ACTION, generator=source).tanh()
    return Batch(
        pictures(2, 5, size, seed), action, torch.randn(2, 5, generator=source),
        pictures(2, 5, size, seed + 100), torch.full((2, 5), 0.9),
    )  # fmt: skip


def check_it_learns(sac, size, steps):
    """A bar at 0..1 on a line is moved by the action; what counts is where it ends, at 0.5."""

    def shown(place):
        across = torch.arange(size) / (size - 1) - place[..., None]
        row = 255.0 * torch.exp(-((across / 0.15) ** 2))
        return row.to(torch.uint8)[:, :, None, :, None].expand(*place.shape, size, size, 3)

    def end(place, action):
        return (place + 0.5 * action[..., 0]).clamp(0.0, 1.0)

    def miss():
        place = torch.linspace(0.0, 1.0, 9).expand(2, -1)
        return (end(place, sac.act(shown(place), explore=False)) - 0.5).abs().mean(1)

    source, before = generators([0, 1], "cpu"), miss()
    for _ in range(steps):
        place = drawn(source, 32, normal=False)
        action = 2.0 * drawn(source, 32, 1, normal=False) - 1.0
        after = end(place, action)
        reward = -(after - 0.5).abs()
        sac.update(Batch(shown(place), action, reward, shown(after), torch.full((2, 32), 0.9)))
    assert before.min() > 0.2 and miss().max() < 0.12


# ------------------------------------------------------------------ images


@pytest.mark.parametrize(("size", "pad"), [((6, 4), 0), ((9, 8), 2), ((5, 8), 3)])
def test_crops_are_those_of_padded_pictures(size, pad):
    whole, shares = pictures(2, 40, (9, 8)), drawn(generators([0, 1], "cpu"), 2, 40, normal=False)
    result = cropped(whole, size, shares, pad).numpy()
    places = [whole.shape[2 + k] + 2 * pad - size[k] + 1 for k in range(2)]
    begins = set()
    for seed in range(2):
        for n in range(40):
            wide = np.pad(whole[seed, n].numpy(), ((pad, pad), (pad, pad), (0, 0)), "edge")
            row, column = (int(shares[seed, k, n] * places[k]) for k in range(2))
            part = wide[row : row + size[0], column : column + size[1]]
            np.testing.assert_array_equal(result[seed, n], part)
            begins.add((row, column))
    assert len(begins) > 10  # Each picture has a place of its own.
    assert {row for row, _ in begins} == set(range(places[0]))


def test_the_middle():
    x = torch.arange(7 * 6 * 3).reshape(7, 6, 3)
    assert torch.equal(center(x, (3, 4)), x[2:5, 1:5])
    assert torch.equal(center(x, (7, 6)), x)


def test_convolutions_are_those_of_pytorch():
    net = Convolutions(generators([0, 1], "cpu"), 4, SIZE)
    with torch.no_grad():
        for weight in net.parameters():
            weight.normal_(0.0, 0.3)
    larger = pictures(2, 3, (SIZE[0] + 4, SIZE[1] + 2))
    result = net(larger)
    assert result.shape == (2, 3, net.outputs)
    for seed in range(2):
        own = nn.Sequential()
        for k, (weight, bias) in enumerate(zip(net.weights, net.biases, strict=True)):
            layer = nn.Conv2d(4 if k else 3, 4, 3, stride=1 if k else 2)
            layer.weight.data, layer.bias.data = weight[seed].clone(), bias[seed].clone()
            own.extend([layer, nn.ReLU()])
        middle = larger[seed, :, 2:-2, 1:-1].permute(0, 3, 1, 2) / 255.0
        expected = own(middle).permute(0, 2, 3, 1).flatten(1)
        torch.testing.assert_close(result[seed], expected, rtol=1e-4, atol=1e-5)


def test_convolutions_of_bfloat16_have_its_digits():
    """Eight bits: relative errors of four layers below 2 %, weights and gradients of 32 bits."""
    result = []
    for kind in (torch.float32, torch.bfloat16):
        own = Convolutions(generators([3], "cpu"), 8, SIZE, kind)
        outputs = own(pictures(1, 6))
        outputs.square().sum().backward()
        assert outputs.dtype == own.weights[0].dtype == own.weights[0].grad.dtype == torch.float32
        result.append((outputs.detach(), *(weight.grad for weight in own.weights)))
    for exact, rough in zip(*result, strict=True):
        assert 0 < (exact - rough).norm() < 0.02 * exact.norm()


def test_kernels_are_orthogonal_in_the_middle_and_of_their_seed_alone():
    both, alone = (Convolutions(generators(seeds, "cpu"), 4, SIZE) for seeds in ([1, 2], [2]))
    pairs = zip(both.weights, alone.weights, strict=True)
    assert all(torch.equal(weight[1], own[0]) for weight, own in pairs)
    taps = both.weights[1][0, :, :, 1, 1]
    torch.testing.assert_close(taps @ taps.T, 2.0 * torch.eye(4), atol=1e-5, rtol=1e-5)
    others = both.weights[1].detach().clone()
    others[..., 1, 1] = 0.0
    assert not others.any()


# ------------------------------------------------------------------ actors and critics


def _sac(**settings):
    return PixelSAC(PixelSettings(**TINY, **settings), [0, 1], SIZE, ACTION)


def test_only_critics_teach_the_convolutions():
    sac, batch, noise = _sac(), batch_of_images(), torch.zeros(2, 5, ACTION)
    shared, head = sac.actor.seen[0], sac.actor.seen[2]
    assert sac.critics.seen[0] is shared and sac.critics.seen[1] is not head
    assert sac.targets.seen[0] is not shared
    sac.actor.sample(batch.observation, noise)[0].sum().backward()
    assert all(weight.grad is None for weight in shared.parameters()) and head.weight.grad.any()
    sac.actor.zero_grad()
    sac.critic_loss(batch, noise).sum().backward()
    assert all(weight.grad.any() for weight in shared.weights) and head.weight.grad is None
    # What the actor learns leaves critics as they are, and with them the convolutions.
    other = _sac(actor_every=1)
    start = head.weight.detach().clone()
    for each in (sac, other):
        each.update(batch)
    assert all(map(torch.equal, sac.critics.parameters(), other.critics.parameters()))
    assert torch.equal(head.weight, start)
    assert not torch.equal(other.actor.body[2].weight, start)


def test_rates_are_halved_and_stay_so():
    rates = {"actor_rate": 0.1, "critic_rate": 0.2, "lr_halving_period": 2}
    first, second = _sac(**rates), _sac(**rates)

    def rate(sac):
        return [adam.param_groups[0]["lr"].item() for adam in sac._adams[:2]]

    expected = [[0.1, 0.2], [0.1, 0.2], [0.05, 0.1], [0.05, 0.1], [0.025, 0.05]]
    for step, target in enumerate(expected):
        if step == 3:
            own = [adam.param_groups[0]["lr"] for adam in second._adams[:2]]
            second.set_state(first.get_state())
            # Numbers of a file stay on the processor: these stay on their device.
            assert all(
                adam.param_groups[0]["lr"] is r
                for adam, r in zip(second._adams[:2], own, strict=True)
            )
        for sac in (first, second)[: 1 + (step >= 3)]:
            sac.update(batch_of_images(seed=step))
            assert rate(sac) == pytest.approx(target)
    assert all(map(torch.equal, first.actor.parameters(), second.actor.parameters()))


def test_a_policy_is_a_file_that_takes_images(tmp_path):
    sac, larger = _sac(tanh=True), (20, 19)
    sac.update(batch_of_images(size=larger))
    example = pictures(1, 1, larger)[0]
    program = torch.export.export(sac.policy(1), (example,))
    torch.export.save(program, tmp_path / "policy.pt2")
    seen = pictures(2, 1, larger, seed=3)
    result = torch.export.load(tmp_path / "policy.pt2").module()(seen[1])
    torch.testing.assert_close(result, sac.act(seen, explore=False)[1], rtol=1e-5, atol=1e-6)


def test_bad_settings_are_refused():
    for name, value in (("channels", 0), ("features", 0), ("symmetric", True), ("tanh", 1)):
        with pytest.raises(InvalidArgumentError, match=name):
            PixelSettings(**{name: value})
    with pytest.raises(InvalidArgumentError, match="lr_halving_period"):
        PixelSettings(lr_halving_period=-1)
    problem = Problem("straighten_rope", {}, [0], 1, (17, 16, 3), 8, 1.0, "cpu")
    assert picture_size(problem) == (17, 16)
    for shape in ((14, 16, 3), (30,)):
        bad = Problem("straighten_rope", {}, [0], 1, shape, 8, 1.0, "cpu")
        with pytest.raises(InvalidArgumentError, match="observation"):
            picture_size(bad)
