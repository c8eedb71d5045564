"""Kept frames: the oracle is a list of what was added, and NumPy's padding."""

import numpy as np
import pytest
import torch

from softgym_mj.learning.frames import Frames

SHAPES = {"rgb": (6, 5, 3), "external_rgb": (2, 6, 5, 3), "depth": (6, 5), "held": (2,)}
SEEDS, NUM_ENVS = [3, 7], 4


def _values(source):
    lead = len(SEEDS), NUM_ENVS
    return {
        name: torch.randint(0, 200, (*lead, *shape), generator=source)
        for name, shape in SHAPES.items()
    }


def _played(frames, steps, ends=0.2):
    """Adds vector steps; returns each, and whether it was the first of an episode."""
    source = torch.Generator().manual_seed(0)
    history = []
    for step in range(steps):
        values = _values(source)
        values["held"][..., 0] = step  # Tells where an entry is from.
        values["held"][..., 1] = torch.arange(NUM_ENVS)
        first = torch.rand(len(SEEDS), NUM_ENVS, generator=source) < (1.0 if step == 0 else ends)
        frames.add(values, first)
        history.append((values, first))
    return history


def _stack(history, k, step, env_index, name, count):
    """A stack by going back in the history until the episode starts."""
    result = [step]
    while len(result) < count:
        earlier = result[0] if history[result[0]][1][k, env_index] else result[0] - 1
        result.insert(0, earlier)
    return np.stack([history[i][0][name][k, env_index].numpy() for i in result])


@pytest.mark.parametrize("count", [1, 2, 4])
@pytest.mark.parametrize("steps", [5, 9, 40])  # With room for nine: short, full, wrapped.
def test_stacks_are_those_of_the_history(count, steps):
    frames = Frames(9, SEEDS, NUM_ENVS, SHAPES, frames=count)
    history = _played(frames, steps)
    met = set()
    for k in range(len(SEEDS)):
        batch = frames.sample(k, 200)
        for i in range(200):
            step, env_index = map(int, batch["held"][i])
            met.add(step)
            for name in ("rgb", "external_rgb", "depth"):
                expected = _stack(history, k, step, env_index, name, count)
                np.testing.assert_array_equal(batch[name][i].numpy(), expected)
    # All that are kept with all earlier frames, and no others.
    oldest = max(steps - 9, 0) + (count - 1 if steps >= 9 else 0)
    assert met == set(range(oldest, steps))


def test_a_stack_is_shifted_as_a_whole_and_edges_are_repeated():
    frames = Frames(9, SEEDS, NUM_ENVS, SHAPES, frames=2, shift=2)
    history = _played(frames, 7)
    batch, moves = frames.sample(1, 100), set()
    for i in range(100):
        step, env_index = map(int, batch["held"][i])
        fits = []
        for row in range(5):
            for column in range(5):
                part = np.s_[..., row : row + 6, column : column + 5]
                if all(
                    np.array_equal(
                        batch[name][i].numpy(), _padded(history, step, env_index, name, part)
                    )
                    for name in ("rgb", "external_rgb", "depth")
                ):
                    fits.append((row, column))
        assert len(fits) == 1
        moves.add(fits[0])
    assert len(moves) > 15


def _padded(history, step, env_index, name, part):
    stack = _stack(history, 1, step, env_index, name, 2)
    if name != "depth":
        stack = np.moveaxis(stack, -1, 1)  # Rows and columns last.
    wide = np.pad(stack, [(0, 0)] * (stack.ndim - 2) + [(2, 2), (2, 2)], "edge")[part]
    return wide if name == "depth" else np.moveaxis(wide, 1, -1)


def test_a_state_that_is_cut_has_no_stacks_across_the_cut(monkeypatch):
    monkeypatch.setattr("softgym_mj.learning.frames.NEWEST_IMAGES", 4 * NUM_ENVS * len(SEEDS))
    first, second = (Frames(9, SEEDS, NUM_ENVS, SHAPES, frames=3) for _ in range(2))
    history = _played(first, 12, ends=0.0)
    second.set_state(first.get_state())
    batch = second.sample(0, 100)
    assert set(batch["held"][:, 0].tolist()) == {
        10.0,
        11.0,
    }  # Frames of 8..11 with two before them.
    for i in range(100):
        step, env_index = map(int, batch["held"][i])
        expected = _stack(history, 0, step, env_index, "rgb", 3)
        np.testing.assert_array_equal(batch["rgb"][i].numpy(), expected)
