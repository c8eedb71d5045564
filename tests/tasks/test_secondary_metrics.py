"""Secondary metrics are what closed forms say."""

import math

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import softgym_mj
from softgym_mj.entities.cloth import Cloth
from softgym_mj.tasks import Episode, State
from softgym_mj.tasks.shared import secondary_metrics

TURN = 0.4  # [rad] No edge is along an axis.


def laid(points: np.ndarray, cloth: Cloth, folded: bool, away=(0.0, 0.0), turn=TURN) -> dict:
    """Secondary metrics of a cloth whose place is at the origin."""
    goal = secondary_metrics.outline(cloth.particles(cloth.flat(angle=turn)), folded)
    points = points + [*away, 0.0]
    none = np.zeros(0)
    state = State({"cloth": points}, {"cloth": np.ones(len(points), bool)}, {}, none, none)
    episode = Episode(0, {}, {"cloth": cloth.arrays}, {"outline": goal}, 0.0)
    return {name: float(v) for name, v in secondary_metrics.laying(state, episode, folded).items()}


def folded(cloth: Cloth, thickness: float = 0.01) -> np.ndarray:
    """Columns of the first half on their mirror columns."""
    points = cloth.flat()
    points[:, 2] += thickness * (points[:, 0] < -1e-9)
    points[:, 0] = np.abs(points[:, 0])
    return Rotation.from_rotvec([0.0, 0.0, TURN]).apply(points)


@pytest.mark.parametrize("dims", [(80, 61), (81, 60)])
def test_what_lies_in_its_place_is_perfect(dims):
    cloth = Cloth(dims=dims)
    perfect = {"mean_corner_distance": 0.0, "outline_iou": 1.0, "wrinkle_height": 0.0}
    assert laid(cloth.flat(angle=TURN), cloth, False) == pytest.approx(perfect, abs=1e-3)
    assert laid(folded(cloth), cloth, True) == pytest.approx(perfect, abs=1e-3)


def test_what_lies_beside_its_place():
    cloth = Cloth(dims=(81, 61))
    width, depth = cloth.size
    for away in (0.05, 0.2, 2.0):
        found = laid(cloth.flat(), cloth, False, (away, 0.0), turn=0.0)
        common = max(width - away, 0.0) * depth
        assert found["mean_corner_distance"] == pytest.approx(away)
        expected = common / (2 * width * depth - common)
        assert found["outline_iou"] == pytest.approx(expected, abs=2e-3)


def test_an_unfolded_cloth_where_half_of_it_ought_to_be():
    cloth = Cloth(dims=(81, 61))
    found = laid(cloth.flat(angle=TURN), cloth, True)
    assert found["outline_iou"] == pytest.approx(0.5, abs=2e-3)
    assert found["mean_corner_distance"] == pytest.approx(cloth.size[0] / 2)  # 2 of 4 corners.


def test_a_wrinkle_is_as_high_as_its_highest_point():
    cloth = Cloth(dims=(81, 61))
    points = cloth.flat(angle=TURN)
    points[len(points) // 2, 2] += 0.07
    assert laid(points, cloth, False)["wrinkle_height"] == pytest.approx(0.07)


def test_flattening_is_a_share_of_the_area():
    found = secondary_metrics.flattening(np.array([0.2, 0.3, 0.5]), 0.2, 0.5)
    np.testing.assert_allclose(found["normalized_coverage"], [0.4, 0.6, 1.0])
    np.testing.assert_allclose(found["normalized_improvement"], [0.0, 1 / 3, 1.0])


def test_a_rope_is_compared_from_either_end():
    goal = np.column_stack([np.linspace(0.0, 0.5, 41), np.zeros(41), np.zeros(41)])
    for points in (goal, goal[::-1]):
        assert secondary_metrics.point_error(points, goal)["mean_point_error"] == 0.0
        moved = secondary_metrics.point_error(points + [0.0, 0.03, 0.04], goal)
        assert moved["mean_point_error"] == pytest.approx(0.05)


def test_the_straight_rope_between_two_ends():
    """A half circle whose ends are 0.5 m apart: its points lie on the circle of that diameter."""
    angles = np.linspace(0.0, math.pi, 1001)
    arc = 0.25 * np.column_stack([np.cos(angles), np.sin(angles), np.zeros(1001)])
    line = secondary_metrics.straight(arc, 0.5)
    np.testing.assert_allclose(
        line[[0, 500, -1]], [[0.25, 0, 0], [0, 0, 0], [-0.25, 0, 0]], atol=1e-9
    )
    # |arc - line|^2 / r^2 at the angle a and place 1 - 2 a / pi, integrated by hand in a.
    a = (np.arange(20000) + 0.5) / 20000 * math.pi
    expected = 0.25 * np.mean(np.hypot(np.cos(a) - 1 + 2 * a / math.pi, np.sin(a)))
    found = secondary_metrics.point_error(arc, line)["mean_point_error"]
    assert found == pytest.approx(expected, rel=2e-3)


NAMES = {
    "spread_cloth": {"normalized_coverage", "normalized_improvement"},
    "straighten_rope": {"mean_point_error"},
    "rope_configuration": {"mean_point_error"},
    "fold_cloth": {"mean_corner_distance", "outline_iou", "wrinkle_height"},
}


@pytest.mark.parametrize("task", NAMES)
def test_info_has_it(task):
    env = softgym_mj.load(task, fidelity="fast", split="all")
    env.reset(800)
    env.step(np.zeros(8))
    assert set(env.task.last_secondary_metrics) == NAMES[task]
    assert env.info().items() >= env.task.last_secondary_metrics.items()


def test_improvement_is_the_normalized_performance_of_spreading():
    env = softgym_mj.load("spread_cloth", fidelity="fast", split="all")
    env.reset(800)
    assert env.info()["normalized_improvement"] == 0.0
    env.step(np.ones(8))
    info = env.info()
    assert info["normalized_improvement"] == pytest.approx(info["normalized_performance"])


def test_a_pile_in_the_right_place_is_told_from_a_fold():
    """The score of `drop_fold_cloth` counts distances alone: a pile gets .7 (docs/tasks)."""
    cloth = Cloth(dims=(81, 61))
    goal = secondary_metrics.outline(cloth.particles(cloth.flat()), True)
    middle = goal[:, :2].mean(axis=0)
    pile = cloth.flat()
    pile[:, :2] = middle + 0.3 * (pile[:, :2] - pile[:, :2].mean(axis=0))
    pile[:, 2] += np.random.default_rng(0).uniform(0.0, 0.06, len(pile))
    found = laid(pile, cloth, True, turn=0.0)
    assert found["outline_iou"] < 0.3
    assert found["wrinkle_height"] > 0.04
