"""The cup against slow oracles: walls, in-cup test, outlines, lift that a tilt needs."""

import itertools
import math

import mujoco
import numpy as np
import pytest
import shapely
from dm_control import composer, mjcf

from softgym_mj.entities.cup import Cup, CupSize
from softgym_mj.entities.cup_poses import corners, outline, overlap
from softgym_mj.exceptions import InvalidArgumentError
from softgym_mj.robots.cup_mover import KeepClear

SIZE = CupSize(length=0.24, width=0.18, height=0.3, wall=0.045)
QUARTERS = (0.0, 45.0, 90.0, 180.0, -30.0, 359.0)  # [deg]


def placed(pose, size=SIZE):
    """A compiled cup at a pose and its physics."""
    cup, arena = Cup(size), composer.Arena()
    cup.join(arena)
    physics = mjcf.Physics.from_mjcf_model(arena.mjcf_model)
    cup.after_compile(physics, None)
    cup.pose = np.array(pose)
    mujoco.mj_kinematics(physics.model.ptr, physics.data.ptr)
    return cup, physics


def in_box(point, pose):
    """Tests one point: undoes shift and rotation, then compares as docs/softgym.md 3.0 does."""
    x, z, theta = pose
    dx, dz = point[0] - x, point[2] - z
    # The cup's axes in the world: e1 = (cos, -sin), e3 = (sin, cos) in (x, z).
    along = dx * math.cos(theta) - dz * math.sin(theta)
    up = dx * math.sin(theta) + dz * math.cos(theta)
    return (
        abs(along) <= SIZE.length / 2 + SIZE.wall
        and abs(point[1]) <= SIZE.width / 2 + SIZE.wall
        and -SIZE.wall / 2 <= up <= SIZE.height + SIZE.wall / 2
    )


@pytest.mark.parametrize("degrees", QUARTERS)
def test_inside_agrees_with_the_slow_test(degrees):
    pose = (0.3, 0.2, math.radians(degrees))
    cup, _ = placed(pose)
    center = [0.3 + 0.15 * math.sin(pose[2]), 0.0, 0.2 + 0.15 * math.cos(pose[2])]
    points = center + np.random.default_rng(0).uniform(-0.25, 0.25, (5000, 3))
    expected = [in_box(point, pose) for point in points]
    assert 1000 < sum(expected) < 1400
    np.testing.assert_array_equal(cup.inside(points), expected)


def test_inside_of_hand_placed_points():
    cup, _ = placed((0.0, 0.0, math.pi / 2))  # Lying: the rim looks along +X.
    # Inner length up and down, height along X: 0.12 + 0.045 and 0.3 + 0.0225.
    points = [[0.322, 0, 0], [0.323, 0, 0], [-0.022, 0, 0], [-0.023, 0, 0], [0.1, 0, 0.164],
              [0.1, 0, 0.166], [0.1, 0.134, 0], [0.1, 0.136, 0]]  # fmt: skip
    assert cup.inside(np.array(points)).tolist() == [True, False] * 4


@pytest.mark.parametrize("degrees", QUARTERS)
def test_walls_and_outline_are_those_of_the_compiled_geoms(degrees):
    pose = (0.4, 0.1, math.radians(degrees))
    cup, physics = placed(pose)
    model, data = physics.model.ptr, physics.data.ptr
    assert not model.geom_contype.any() and not model.geom_conaffinity.any()
    (walls,) = np.nonzero(model.geom_type == mujoco.mjtGeom.mjGEOM_BOX)
    assert len(walls) == 5
    corners = []
    for geom in walls:
        for signs in itertools.product((-1, 1), repeat=3):
            local = model.geom_size[geom] * signs
            corners.append(data.geom_xpos[geom] + data.geom_xmat[geom].reshape(3, 3) @ local)
    # The outline has no floor slab below the middle; with it, the hulls agree.
    hull = shapely.MultiPoint(np.array(corners)[:, [0, 2]]).convex_hull
    around = shapely.Polygon(outline(cup.arrays["size"], cup.pose))
    half = SIZE.length / 2 + SIZE.wall
    sunk = half * 2 * SIZE.wall / 2
    assert around.area == pytest.approx(2 * half * SIZE.height)
    assert hull.area == pytest.approx(around.area + sunk)
    assert around.difference(hull).area == pytest.approx(0.0, abs=1e-12)


def test_the_inner_room_is_free_and_closed():
    _, physics = placed((0.0, 0.0, 0.0))
    model, data = physics.model.ptr, physics.data.ptr

    def in_a_wall(point):
        return any(
            np.all(np.abs(point - data.geom_xpos[geom]) <= model.geom_size[geom] + 1e-12)
            for geom in range(5)
        )

    random = np.random.default_rng(1)
    low, high = [-0.12, -0.09, 0.0225], [0.12, 0.09, 0.3]
    assert not any(in_a_wall(point) for point in random.uniform(low, high, (300, 3)))
    for axis, side in itertools.product(range(3), (0, 1)):
        if (axis, side) == (2, 1):
            continue  # Open at the top.
        points = random.uniform(low, high, (50, 3))
        points[:, axis] = (low, high)[side][axis] + (2 * side - 1) * 0.02
        assert all(in_a_wall(point) for point in points)


def test_pose_is_read_from_the_data():
    cup, physics = placed((0.3, 0.2, -1.0))
    np.testing.assert_allclose(cup.pose, [0.3, 0.2, -1.0], atol=1e-15)
    # Positive theta tips the rim towards +X.
    cup.pose = np.array([0.0, 0.0, 0.5])
    mujoco.mj_kinematics(physics.model.ptr, physics.data.ptr)
    rim = physics.data.ptr.geom_xpos[:5].mean(axis=0)
    assert rim[0] > 0.05 and rim[1] == 0.0
    for theta in (0.0, 1.5, 3.5, 6.2, -6.2):
        cup.pose = np.array([0.0, 0.0, theta])
        assert cup.pose[2] == pytest.approx(theta, abs=1e-14)
    cup.pose = np.zeros(3)
    assert cup.pose.tolist() == [0.0, 0.0, 0.0]
    np.testing.assert_array_equal(cup.whole_pose, [0, 0, 0, 1, 0, 0, 0, 0])


@pytest.mark.parametrize(("degrees", "lift"), [(15, 0.031), (45, 0.080), (90, 0.100)])
def test_lift_that_a_tilt_needs(degrees, lift):
    """docs/softgym.md 3.2: (L/2) sin + (b/2) cos - b/2; for L = 0.245, 3.1, 8.0 and 10.0 cm."""
    length, wall, theta = 0.245, 0.045, math.radians(degrees)
    cup = Cup(CupSize(length, 0.2, 0.3, wall))
    formula = length / 2 * math.sin(theta) + wall / 2 * (math.cos(theta) - 1)
    assert formula == pytest.approx(lift, abs=5e-4)
    # The lowest corner then stands where it does when the cup is upright.
    lowest = corners(cup.arrays["size"], np.array([0.7, formula, theta]))[:, 1].min()
    assert lowest == pytest.approx(-wall / 2, abs=1e-12)


def test_overlap_agrees_with_shapely():
    random = np.random.default_rng(2)
    cup, other = Cup(SIZE), Cup(CupSize(0.15, 0.2, 0.4, 0.03))
    hits = 0
    for _ in range(500):
        first = outline(cup.arrays["size"], random.uniform([0, 0, -7], [1, 0.5, 7]))
        second = outline(other.arrays["size"], random.uniform([0, 0, -7], [1, 0.5, 7]))
        expected = shapely.Polygon(first).intersects(shapely.Polygon(second))
        assert overlap(first, second) == overlap(second, first) == expected
        hits += expected
    assert 100 < hits < 400


def test_one_cup_is_as_clear_as_in_a_batch():
    random, number = np.random.default_rng(3), 2000
    sizes = random.uniform([0.1, 0.1, 0.1, 0.01], [0.3, 0.2, 0.4, 0.05], (2, number, 4))
    poses = random.uniform([0, -0.05, -7], [1, 0.5, 7], (2, number, 3))
    poses[1, ::2] = [0.5, 0.0, 0.0]
    rule = KeepClear("cup", "other")
    cups = {name: (sizes[i], poses[i]) for i, name in enumerate(("cup", "other"))}
    _, expected = rule(poses[0], cups)
    for i in range(number):
        one = {name: (size[i], pose[i]) for name, (size, pose) in cups.items()}
        assert rule(poses[0, i], one)[1] == expected[i]
    assert 0.2 * number < expected.sum() < 0.8 * number


@pytest.mark.parametrize("bad", [(0.0, 1, 1, 0.1), (1, 1, -1, 0.1), (1, 1, 0.04, 0.1),
                                 (1, math.nan, 1, 0.1)])  # fmt: skip
def test_impossible_sizes_are_refused(bad):
    with pytest.raises(InvalidArgumentError, match=r"cup size|finite number"):
        CupSize(*bad)
