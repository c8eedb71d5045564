"""The tasks' cameras show the object: on variations that `tools/cameras.py` has not seen."""

import math

import numpy as np
import pytest

import softgym_mj
from softgym_mj.entities.arena import Arena
from softgym_mj.rendering.offscreen import CameraView, refresh_poses
from softgym_mj.robots.arm.models import ARMS
from softgym_mj.robots.gripper import Gripper
from softgym_mj.variations.indices import SPLITS
from tools import cameras, framing

# Least share of the picture that shows the object, cups included, at a reset with pickers.
USUAL = 0.045
SHARES = {
    "straighten_rope": 0.012,
    "rope_configuration": 0.016,
    "route_cable": 0.016,
    "spread_cloth": 0.035,
    "fold_crumpled_cloth": 0.035,
    "drop_fold_cloth": 0.036,
}
MOVED = tuple(parameter.name for parameter in Arena.parameters)
FEW = framing.RESETS[::40]
WHOLE_FRAMES = 0.95


def check_starts(starts, least):
    assert min(one.inside for one in starts) >= framing.WHOLE
    assert min(one.share for one in starts) >= least


@pytest.mark.parametrize("task", softgym_mj.TASKS)
def test_the_object_is_in_the_picture(task):
    env = framing.loaded(task, "default")
    check_starts(framing.at_resets(env, FEW), SHARES.get(task, USUAL))


@pytest.mark.slow
@pytest.mark.parametrize("task", softgym_mj.TASKS)
def test_the_object_is_in_the_picture_of_all_variations(task):
    env = framing.loaded(task, "default")
    check_starts(framing.at_resets(env, framing.RESETS), SHARES.get(task, USUAL))


@pytest.mark.slow
@pytest.mark.parametrize("task", softgym_mj.TASKS)
def test_the_object_stays_in_the_picture(task):
    frames = framing.along(framing.loaded(task, "default"), framing.EPISODES)
    assert np.mean([one.inside >= framing.WHOLE for one in frames]) >= WHOLE_FRAMES


@pytest.mark.slow
@pytest.mark.parametrize("actor", ARMS)
@pytest.mark.parametrize("task", softgym_mj.TASKS)
def test_arms_leave_the_object_in_the_picture(task, actor):
    starts = framing.at_resets(framing.loaded(task, actor), framing.RESETS)
    check_starts(starts, SHARES.get(task, USUAL) / 3)


def outside(env, camera):
    """Number of points on what happens in a task, goals included, that a camera's image lacks."""
    refresh_poses(env.physics)
    hangs = isinstance(env.task.actor, Gripper) and max(env.task.actor.held) >= 0
    points = np.concatenate([points for points, _, few in cameras.contents(env, hangs) if not few])
    seen, _ = CameraView(camera, 100, 100).calibration(env.physics).project(points)
    return int(np.any((seen < -0.5) | (seen > 99.5), axis=1).sum())


def check_externals(task, actor, variations):
    env = framing.loaded(task, actor)
    for variation in variations:
        for step in framing.played(env, variation):
            if step % framing.EVERY == 0:
                assert outside(env, "left") == outside(env, "right") == 0, (variation, step)


@pytest.mark.parametrize(
    ("task", "variation"),
    [
        ("fold_cloth", 960),
        pytest.param("drop_fold_cloth", 840, marks=pytest.mark.long),
        pytest.param("spread_cloth", 860, marks=pytest.mark.long),
    ],
)
def test_external_cameras_show_all_that_happens(task, variation):
    check_externals(task, "default", [variation])


@pytest.mark.slow
@pytest.mark.parametrize("actor", framing.ACTORS)
@pytest.mark.parametrize("task", softgym_mj.TASKS)
def test_external_cameras_show_all_episodes(task, actor):
    check_externals(task, actor, framing.EPISODES[::2])


# At some starts of fold_cloth with pickers the tape around the goal is at the rim of the image.
@pytest.mark.parametrize(
    ("task", "actor"),
    [("drop_cloth", "default"), ("drop_cloth", "franka"), ("drop_fold_cloth", "default"),
     ("drop_fold_cloth", "franka"), ("fold_crumpled_cloth", "default"),
     ("rope_configuration", "default"), ("transport_water", "default")],
)  # fmt: skip
def test_the_goal_is_in_the_picture(task, actor):
    env = framing.loaded(task, actor)
    for variation in (832, 896, 976):
        env.reset(variation)
        assert outside(env, "task") == 0


@pytest.mark.slow
@pytest.mark.parametrize(
    ("domain", "least", "whole"),
    [("in_distribution", 0.976, 0.996), ("out_of_distribution", 0.256, 0.806)],
)
def test_how_much_moved_cameras_cut_off(domain, least, whole):
    """The shares in docs/domain.md."""
    found = []
    for task in softgym_mj.TASKS:
        moved = {name: domain for name in MOVED}
        env = softgym_mj.load(task, split="all", domain=moved)
        view = CameraView("task", 128, 128)
        for variation in SPLITS["evaluate"][::4]:
            env.reset(variation)
            seen, _ = view.calibration(env.physics).project(env.task.points())
            found.append(np.all((seen >= -0.5) & (seen <= 127.5), axis=1).mean())
    assert min(found) == pytest.approx(least, abs=0.01)
    assert np.mean(np.array(found) >= framing.WHOLE) == pytest.approx(whole, abs=0.01)


def test_what_is_cut_off_is_noticed():
    """A camera that looks beside the rope: half of it is in the picture."""
    env = framing.loaded("straighten_rope", "default")
    env.reset(800)
    camera = env.physics.model.ptr.camera("task")
    whole = framing.Eye(env).look()
    middle = env.task.points().mean(axis=0)
    camera.pos, camera.quat, camera.fovy = [*middle[:2], 0.7], [1.0, 0.0, 0.0, 0.0], 45.0
    centered = framing.Eye(env).look()
    assert centered.inside == whole.inside == 1.0
    camera.pos = camera.pos + [0.7 * math.tan(math.radians(22.5)), 0.0, 0.0]
    half = framing.Eye(env).look()
    assert 0.2 < half.inside < 0.8
    assert half.share == pytest.approx(half.inside * centered.share, rel=0.3)


def test_a_pyramid_touches_what_it_is_around():
    """All points are in the free part of the image, and one is at an end of it."""
    points = np.random.default_rng(0).uniform(-0.3, 0.3, (200, 3)) + [0.1, 0.2, 0.3]
    for direction in cameras.directions(steep=True)[::37]:
        place, middle, angle = direction.pose((points @ direction.normals.T).max(axis=0))
        seen = (points - place) @ direction.axes.T
        ends = np.abs(seen[:, :2] / -seen[:, 2:]).max(axis=0) / math.tan(math.radians(angle) / 2)
        assert ends.max() == pytest.approx(1.0 - cameras.MARGIN, abs=0.01)
        back = np.subtract(place, middle)
        np.testing.assert_allclose(back / np.linalg.norm(back), direction.axes[2], atol=5e-3)
