"""How arms lay out piles: by what both hands can take at once, and how hands come to rest."""

import math

import numpy as np
import pytest

import softgym_mj
from softgym_mj.policies.experts import make_policy
from tests.policies.test_scripted import play


def expert(task):
    """The expert with two Frankas at a pile."""
    env = softgym_mj.load(task, split="evaluate", actor="franka", fidelity="fast")
    env.reset(800)
    return env, make_policy(env)


def test_a_hold_by_a_side_is_worth_its_length():
    env, act = expert("spread_cloth")
    p1, p2, p3, p4 = env.task.cloth.corners.tolist()
    width, depth = env.task.cloth.size
    assert act._hold_worth(p1, p2) == pytest.approx(depth, abs=1e-6)
    assert act._hold_worth(p1, p3) == pytest.approx(width, abs=1e-6)
    # By a diagonal, a corner hangs in front of the other one: the height of the triangle.
    diagonal = math.hypot(width, depth)
    assert act._hold_worth(p1, p4) == pytest.approx(diagonal - width * depth / diagonal, abs=1e-6)


def test_a_hold_beside_the_middle_column_is_worth_less():
    env, act = expert("fold_crumpled_cloth")
    cloth = env.task.cloth
    rows, columns = cloth.shape
    column = columns // 2
    column_pitch, row_pitch = (
        size / (n - 1) for size, n in zip(cloth.size, (columns, rows), strict=True)
    )
    ends = cloth.index(0, column), cloth.index(rows - 1, column)
    assert act._hold_worth(*ends) == pytest.approx((rows - 1) * row_pitch, abs=1e-6)
    beside = cloth.index(0, column + 1), cloth.index(rows - 1, column + 1)
    expected = (rows - 1) * row_pitch - 2 * column_pitch
    assert act._hold_worth(*beside) == pytest.approx(expected, abs=1e-6)


def test_holds_leave_room_and_differ():
    env, act = expert("spread_cloth")
    holds = act._holds()
    points, actor = env.task.cloth.points(), env.task.actor
    assert 0 < len(holds) <= act.holds
    for a, b in holds:
        assert points[a, 1] <= points[b, 1]  # Hand 0 stands at -Y.
        assert math.dist(points[a], points[b]) > actor.least_distance
        for i, vertex in enumerate((a, b)):
            place = points[vertex] + [0.0, 0.0, 0.02]
            np.testing.assert_allclose(actor.within_reach(i, place), place, atol=0.03)
    assert len(set(holds)) == len(holds)


@pytest.mark.parametrize(("brakes", "low", "high"), [(True, 0.0, 0.01), (False, 0.02, 0.06)])
def test_hands_that_brake_do_not_go_too_far(brakes, low, high):
    env, act = expert("straighten_rope")
    act.brakes = brakes
    actor = env.task.actor
    ways = np.array([[0.25, -0.02, 0.0], [-0.2, 0.02, 0.0]])
    goals = actor.positions() + ways
    along = ways / np.linalg.norm(ways, axis=1)[:, None]
    furthest = 0.0
    for action in act._move(goals, [False, False]):
        env.step(action)
        beyond = ((actor.positions() - goals) * along).sum(axis=1)
        furthest = max(furthest, float(beyond.max()))
    np.testing.assert_allclose(actor.positions(), goals, atol=0.006)
    assert low <= furthest <= high


@pytest.mark.parametrize(
    ("task", "variation", "actor", "least"),
    [
        pytest.param("spread_cloth", 880, "sawyer", 0.95, marks=pytest.mark.long),
        pytest.param("fold_crumpled_cloth", 800, "franka", 0.7, marks=pytest.mark.slow),
    ],
)
def test_arms_lay_out_piles(task, variation, actor, least):
    # By moving single vertices they score 0.20 and 0.02.
    assert play(task, variation, actor=actor)["normalized_performance"] > least
