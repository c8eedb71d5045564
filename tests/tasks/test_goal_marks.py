"""`goal_marks`: colored images that are observed show the goal, and nothing else changes."""

import warnings

import numpy as np
import pytest

import softgym_mj
from softgym_mj.exceptions import InvalidArgumentError
from softgym_mj.rendering.observables import WRIST_RGB
from softgym_mj.rendering.offscreen import CameraView
from softgym_mj.vector.batch.cameras import IMAGES

FIXED = tuple(name for name in IMAGES if name != WRIST_RGB)  # By cameras that do not move.
UNMARKED = ("straighten_rope", "spread_cloth", "pour_water")  # Their goals need no mark.
# One of each kind of mark.
MARKED = ("fold_cloth", "drop_cloth", "rope_configuration", "transport_water", "pour_water_amount")
VARIATION = 811
SETTINGS = {"split": "all", "image_size": (128, 128), "fidelity": "fast"}


def changed(images, others):
    """Pixels (..., height, width) whose color differs clearly."""
    return np.abs(images.astype(int) - others).max(axis=-1) > 20


def load(task, observation=FIXED, **settings):
    env = softgym_mj.load(task, observation=list(observation), **SETTINGS | settings)
    return env, env.reset(VARIATION).observation


def batch(task, **settings):
    settings = SETTINGS | settings
    envs = softgym_mj.make_vec(task, 1, device="host", observation=list(FIXED), **settings)
    seen, _ = envs.reset(options={"variation": [VARIATION]})
    envs.close()
    return {name: array[0] for name, array in seen.items()}


@pytest.mark.filterwarnings("ignore:observation:UserWarning")
@pytest.mark.parametrize("task", MARKED)
def test_colors_show_the_goal_and_nothing_else_changes(task):
    env, seen = load(task, goal_marks=True)
    _, plain = load(task, goal_marks=False)
    drawn = CameraView("task", 128, 128).rgb(env.physics)
    np.testing.assert_array_equal(seen["rgb"], drawn)  # As people see it.
    hidden = CameraView("task", 128, 128, marks=False).rgb(env.physics)
    np.testing.assert_array_equal(plain["rgb"], hidden)
    with_marks, without = batch(task, goal_marks=True), batch(task, goal_marks=False)
    for name in ("depth", "segmentation", "external_depth"):
        np.testing.assert_array_equal(seen[name], plain[name])
        np.testing.assert_array_equal(with_marks[name], without[name])
    for name in ("rgb", "external_rgb"):
        mark = changed(seen[name], plain[name])
        in_batch = changed(with_marks[name], without[name])
        if mark.sum() > 10:  # A cloth may hang before the mark.
            assert (mark & in_batch).sum() > 0.5 * (mark | in_batch).sum(), name
    assert changed(seen["external_rgb"], plain["external_rgb"]).sum() > 10


def test_the_bar_in_the_image_stands_at_the_level_of_the_goal():
    levels = []
    env, _ = load("pour_water_amount", ["rgb"], image_size=(256, 256))
    for variation in (805, 811, 806):
        seen = env.reset(variation).observation["rgb"].astype(int)
        rows, columns = np.nonzero(seen[..., 0] > seen[..., 1] + 30)
        assert len(rows) >= 10
        # Rays through the red pixels, to the plane of the target's near inner wall.
        view = CameraView("task", 256, 256).calibration(env.physics)
        pixels = np.column_stack([columns, rows])
        near, far = (view.unproject(pixels, np.full(len(pixels), depth)) for depth in (0.0, 1.0))
        target = env.task.target
        wall = target.pose[0] - target.size.length / 2
        share = (wall - near[:, 0]) / (far - near)[:, 0]
        heights = near[:, 2] + share * (far - near)[:, 2]
        level = float(env.task.episode.goal["level"])
        assert abs(np.median(heights) - level) < 0.01  # A pixel shows about 1 cm.
        levels.append(level)
    assert np.ptp(levels) > 0.1


@pytest.mark.parametrize("task", softgym_mj.TASKS)
def test_marks_are_the_default_where_the_goal_varies_and_nothing_else_shows_it(task):
    shown = task in ("pour_water_amount", "rope_configuration")
    assert softgym_mj.load(task).task.goal_marks is shown


@pytest.mark.parametrize("task", UNMARKED)
def test_a_task_without_marks_refuses_them(task):
    with pytest.raises(InvalidArgumentError, match=r"goal_marks=True.*False: this task"):
        softgym_mj.load(task, goal_marks=True)


def test_a_warning_says_that_no_image_shows_the_goal():
    task = "rope_configuration"
    with pytest.warns(UserWarning, match=r"does not show the goal.*goal_marks=True"):
        load(task, ["rgb", "depth"], goal_marks=False)
    with pytest.warns(UserWarning, match=r"does not show the goal"):
        load(task, ["depth"], goal_marks=True)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        load(task, ["rgb"])
        load(task, ["rgb", "reduced"], goal_marks=False)


def test_images_of_wrists_show_the_goal():
    seen, plain = (
        load("rope_configuration", ["wrist_rgb", "reduced"], actor="franka", **settings)[1]
        for settings in ({}, {"goal_marks": False})
    )
    assert changed(seen["wrist_rgb"], plain["wrist_rgb"]).sum() > 100
