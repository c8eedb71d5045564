"""The encoder of points: layouts of tasks, features computed with plain loops."""

import numpy as np
import pytest
import torch

import softgym_mj
from softgym_mj.exceptions import InvalidArgumentError
from softgym_mj.learning.point_encoder import SCALE, PointEncoder, layout_of


def layout(task, name="reduced", **settings):
    env = softgym_mj.load(task, observation=name, **settings)
    timestep = env.reset(0)
    return layout_of(env, name), env, timestep.observation[name]


@pytest.mark.parametrize("task, points", [("rope_configuration", 10), ("fold_cloth", 4)])
def test_a_layout_finds_points_goals_and_pickers(task, points):
    found, env, seen = layout(task)
    assert found.points.shape == (points, 3)
    np.testing.assert_array_equal(found.points.ravel(), np.arange(3 * points))
    np.testing.assert_allclose(seen[found.grippers], env.task.actor.positions())
    if task == "rope_configuration":
        goal = env.task.episode.goal["rope"][env.task.rope.key_points]
        np.testing.assert_allclose(seen[found.goals], goal)
    else:
        assert len(found.goals) == 0


def test_a_layout_finds_the_tool_points_of_arms():
    found, env, seen = layout("fold_cloth", actor="franka")
    np.testing.assert_array_equal(found.points.ravel(), np.arange(12))
    np.testing.assert_allclose(seen[found.grippers], env.task.actor.positions())


def test_a_layout_of_a_shirt_finds_what_markov_begins_with():
    found, env, seen = layout("fold_shirt", "markov")
    np.testing.assert_array_equal(found.points.ravel(), np.arange(33))
    np.testing.assert_allclose(seen[found.grippers], env.task.actor.positions())
    assert len(found.goals) == 0 and len(seen) == 47


def test_key_points_of_a_cloth_are_spread_evenly():
    found, env, seen = layout("fold_crumpled_cloth", "key_points")
    assert found.points.shape == (64, 3) and len(found.goals) == 0
    np.testing.assert_allclose(seen[found.grippers], env.task.actor.positions())
    rows, columns = env.task.cloth.shape
    vertices = seen[found.points].reshape(8, 8, 3)
    for i, row in enumerate(np.linspace(0, rows - 1, 8).round().astype(int)):
        for k, column in enumerate(np.linspace(0, columns - 1, 8).round().astype(int)):
            assert vertices[i, k].tolist() == env.task.cloth.grid()[row, column].tolist()


def test_observations_without_points_are_refused():
    for task, settings in (("pour_water", {}), ("fold_cloth", {"actor": "pick_and_place"})):
        with pytest.raises(InvalidArgumentError, match="points=True"):
            layout(task, **settings)


def test_features_are_shared_evenly_among_heads():
    found, *_ = layout("fold_cloth")
    with pytest.raises(InvalidArgumentError, match="multiple of 8"):
        PointEncoder(found, 18, 20)


def test_features_are_those_of_plain_loops():
    found, _, seen = layout("rope_configuration")
    torch.manual_seed(0)
    encoder = PointEncoder(found, 68, 16).double()
    numbers = torch.tensor(np.concatenate([seen, [1.0, 0.0]]))
    scaled = SCALE * numbers
    points, goals = scaled[:30].reshape(10, 3), scaled[30:60].reshape(10, 3)
    grippers = scaled[60:66].reshape(2, 3)
    each = []
    for k in range(10):
        place = torch.zeros(10, dtype=torch.float64)
        place[k] = 1.0
        own, other = goals[k], goals[9 - k]
        parts = [points[k], own, own - points[k], other, other - points[k]]
        parts += [points[k] - grippers[0], points[k] - grippers[1], scaled, place]
        each.append(encoder.each(torch.cat(parts)))
    common = encoder.all(torch.cat([sum(each) / 10, torch.stack(each).max(0).values]))
    again = [encoder.again(torch.cat([one, common])) for one in each]
    weights = torch.stack([encoder.scores(one) for one in again]).exp()
    weights /= weights.sum(0)
    attended = [
        sum(weights[k, head] * encoder.values(again[k])[2 * head : 2 * head + 2] for k in range(10))
        for head in range(8)
    ]
    expected = encoder.result(torch.cat([*attended, common]))
    torch.testing.assert_close(encoder(numbers[None])[0], expected)
