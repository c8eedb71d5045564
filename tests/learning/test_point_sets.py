"""Networks of point sets: their oracles are a loop over points, and one seed alone."""

import numpy as np
import pytest
import torch

import softgym_mj
from softgym_mj.exceptions import InvalidArgumentError
from softgym_mj.learning.methods.point_sets import (
    Layout,
    PointSAC,
    PointSets,
    PointSetSettings,
    full_symmetries,
    layout,
)
from softgym_mj.learning.networks import drawn, generators
from softgym_mj.learning.registry import find_method, find_preset
from softgym_mj.learning.replay import Batch
from softgym_mj.learning.settings import TrainingSettings
from softgym_mj.learning.symmetries import symmetries
from softgym_mj.learning.training import Training
from softgym_mj.tasks.shared.goals import goals

# Five points of which some may lack, a number, two more points, and two numbers.
WHERE, SIZE, ACTION, NUMBER = Layout(((0, 5), (16, 2)), (15, 22, 23)), 24, 2, 6
SMALL = PointSetSettings(hidden=(16,), points=(8, 4), norm=True)


def _full(seeds, number=NUMBER, missing=2, seed=0):
    source = torch.Generator().manual_seed(seed)
    full = torch.randn(len(seeds), number, SIZE, generator=source)
    full[..., 15 - 3 * missing : 15] = 0.0
    return full


def _batch(seeds, seed=0):
    source, lead = torch.Generator().manual_seed(seed), (len(seeds), NUMBER)
    return Batch(
        _full(seeds, seed=seed), torch.rand(*lead, ACTION, generator=source) * 2 - 1,
        torch.randn(*lead, generator=source), _full(seeds, seed=seed + 100), torch.full(lead, 0.9),
    )  # fmt: skip


def test_features_are_those_of_a_loop_over_points():
    seeds = [3, 4]
    sets, full = PointSets(generators(seeds, "cpu"), WHERE, (8, 4), norm=False), _full(seeds)
    result = sets(full)
    assert result.shape == (2, NUMBER, sets.size) == (2, NUMBER, 3 + 2 * 2 * 4)
    for k, i in np.ndindex(2, NUMBER):
        row = full[k, i]
        rest = torch.stack([row[15], row[22], row[23]])
        expected = [rest]
        for network, points in zip(
            sets.each, (row[:9].view(3, 3), row[16:22].view(2, 3)), strict=True
        ):
            (first, _, last), each = network, []
            for point in points:
                seen = torch.cat([point, rest]) @ first.weight[k] + first.bias[k, 0]
                each.append(seen.relu() @ last.weight[k] + last.bias[k, 0])
            each = torch.stack(each)
            expected += [each.max(0).values, each.mean(0)]
        torch.testing.assert_close(result[k, i], torch.cat(expected), atol=1e-5, rtol=1e-5)


def test_neither_order_nor_padding_matters():
    sets, full = PointSets(generators([0], "cpu"), WHERE, (8, 4), norm=True), _full([0])
    other = full.clone()
    other[..., :15] = full[..., :15].unflatten(-1, (5, 3))[..., [4, 2, 0, 3, 1], :].flatten(-2)
    torch.testing.assert_close(sets(other), sets(full))
    other[..., 3:6] = 1.0
    assert (sets(other) - sets(full)).abs().max() > 0.01


@pytest.mark.parametrize(
    ("task", "number", "rest"),
    [("rope_configuration", 2, 6), ("spread_cloth", 1, 6), ("pour_water_amount", 1, 14)],
)
def test_layouts_are_those_of_tasks(task, number, rest):
    env = softgym_mj.load(task, split="all", fidelity="fast", random_state=0)
    env.reset(812)
    where, full = layout(env), env.task.observe("full")
    assert (len(where.sets), len(where.rest)) == (number, rest)
    points = np.concatenate([*env.task.state().points.values()])
    result = [full[start : start + 3 * count].reshape(-1, 3) for start, count in where.sets]
    np.testing.assert_array_equal(result[0][: len(points)], points)
    assert not result[0][len(points) :].any()
    if number == 2:
        np.testing.assert_array_equal(result[1], env.task.episode.goal["rope"])
        np.testing.assert_array_equal(full[[*where.rest]], env.task.observe("proprioception"))
    env.close()


def test_symmetries_turn_full_states_as_reduced_ones():
    env = softgym_mj.load("rope_configuration", split="all", fidelity="fast", random_state=0)
    env.reset(5)
    of, full = goals("rope_configuration", env.task), env.task.observe("full")
    own = [symmetry for symmetry in symmetries(env) if symmetry.order == "same"]
    result = full_symmetries(env)
    assert len(result) == len(own) == 16
    for symmetry, expected in zip(result, own, strict=True):
        state, episode = of.read(symmetry.observation @ full)
        entries = env.task.reduced(state, episode).values()
        reduced = [*(entry.values for entry in entries), state.sensed]
        flat = np.concatenate([np.ravel(values) for values in reduced])
        np.testing.assert_allclose(flat, expected.observation @ env.task.observe("reduced"))
        np.testing.assert_array_equal(symmetry.action, expected.action)
    env.close()


def test_it_learns_to_reach_the_highest_point():
    """The action is to be the largest x of the points that are there: none is in its place."""
    settings = PointSetSettings(
        hidden=(32,), points=(16, 16), actor_rate=5e-3, critic_rate=5e-3, actor_every=1,
        target_every=1, alpha=0.02,
    )  # fmt: skip
    seeds, where = [0, 1], Layout(((0, 4),), ())
    sac, source = PointSAC(settings, seeds, where, 1), generators(seeds, "cpu")

    def drawn_points(number):
        points = 1.6 * drawn(source, number, 4, 3, normal=False) - 0.8
        there = drawn(source, number, 4, 1, normal=False) > 0.3
        there[..., 0, :] = True
        largest = points[..., 0].masked_fill(~there[..., 0], -1.0).amax(-1)
        return (points * there).flatten(-2), largest

    for _ in range(250):
        full, largest = drawn_points(64)
        action = 2.0 * drawn(source, 64, 1, normal=False) - 1.0
        reward = -(action[..., 0] - largest).abs()
        sac.update(Batch(full, action, reward, full, torch.zeros(2, 64)))
    full, largest = drawn_points(200)
    away = (sac.act(full, explore=False)[..., 0] - largest).abs().mean(-1)
    assert (away < 0.15).all()  # The best constant is 0.26 away.


METHOD = find_method(
    "sac_points", hidden=(16,), points=(8, 8), random_steps=8, updates=2, batch=8, replay=24,
    symmetric=True,
)  # fmt: skip
SETTINGS = TrainingSettings(
    "rope_configuration", observation="full", env_steps=24, num_envs=2, part=8, episodes=1,
    final_episodes=1, fidelity="fast", episode_steps=6,
)  # fmt: skip


def test_presets_suit_every_task():
    for task in softgym_mj.TASKS:
        training, method = find_preset("sac_points", "fast", task)
        assert training.observation == "full" and method.settings.points == (64, 128)
        assert method.settings.symmetric == ("water" not in task)


def test_what_cannot_be_is_refused(tmp_path):
    settings = TrainingSettings(**{**vars(SETTINGS), "observation": "reduced"})
    with pytest.raises(InvalidArgumentError, match="observation"):
        Training(settings, METHOD, [0], tmp_path, "host")
