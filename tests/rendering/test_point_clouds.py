"""Clouds of the object from two cameras."""

import numpy as np
import pytest
from scipy.spatial import cKDTree

import softgym_mj
from softgym_mj.rendering.observables import EXTERNAL, LABELS, LabeledView
from softgym_mj.rendering.point_clouds import NUM_CLOUD_POINTS, cloud, thinned


def tent():
    """A cloth over a ridge along the task camera's view, whose slopes fall by 60 degrees."""
    env = softgym_mj.load(
        "fold_cloth", observation="point_cloud", split="all", fidelity="fast", image_size=(192, 192)
    )
    env.reset(805)
    flat = env.task.flexes.points()
    across = flat[:, 0] - flat[:, 0].mean()
    points = np.column_stack([across / 2, flat[:, 1], 0.3 - np.abs(across) * np.sqrt(0.75)])
    env.task.objects[0].set_points(points)
    seen = env.task.task_observables["point_cloud"].observation_callable(env.physics, None)()
    return env, points, seen[seen[:, 3] == 1.0, :3]


def covered(points, seen):
    """The share of points that the cloud comes near."""
    return np.mean(cKDTree(seen).query(points)[0] < 0.02)


def test_two_cameras_see_both_slopes_and_one_does_not():
    env, points, seen = tent()
    assert len(seen) == NUM_CLOUD_POINTS and covered(points, seen) > 0.95
    for name in EXTERNAL:
        view = LabeledView(name, 128, 128, lambda: env.task.scene.segmentation_models)
        assert covered(points, view.points(env.physics)) < 0.7
    distance = cKDTree(points).query(seen)[0]  # Half a diagonal of the mesh, and the thickness.
    assert distance.max() < 0.75 * 0.04 + 0.007


@pytest.mark.parametrize("task", ["straighten_rope", "fold_cloth", "drop_cloth"])
def test_arms_do_not_stand_before_both_cameras(task):
    env = softgym_mj.load(task, actor="franka", observation="point_cloud", split="all")
    seen = env.reset(806).observation["point_cloud"]
    assert covered(env.task.points(), seen[seen[:, 3] == 1.0, :3]) > 0.95


def test_clouds_are_spread_evenly():
    _, _, seen = tent()
    gaps = cKDTree(seen).query(seen, k=2)[0][:, 1]
    even = np.sqrt(0.78**2 / NUM_CLOUD_POINTS)  # Spacing in a 0.78 m square; pixels are 8 mm apart.
    assert np.median(gaps) > 0.6 * even
    assert np.percentile(gaps, 95) < 1.2 * even


@pytest.mark.parametrize("number", [10, 500, 4000])
def test_dense_places_get_no_more_points(number):
    random = np.random.default_rng(0)
    sparse, dense = random.uniform(size=(8000, 3)), random.uniform(size=(72000, 3))
    points = np.concatenate([sparse * [1, 1, 0], dense * [1, 1, 0] + [1, 0, 0]])
    chosen = thinned(points, number)
    assert len(np.unique(chosen, axis=0)) == number
    assert np.mean(chosen[:, 0] < 1.0) == pytest.approx(0.5, abs=0.1)
    np.testing.assert_array_equal(chosen, thinned(points, number))


@pytest.mark.parametrize("number", [0, 1, 7, NUM_CLOUD_POINTS])
def test_few_points_are_all_there(number):
    points = np.random.default_rng(0).uniform(size=(number, 3))
    found = cloud(points)
    np.testing.assert_array_equal(found[:number, :3], points.astype(np.float32))
    assert found[:, 3].sum() == number and not found[number:].any()


def test_points_that_coincide_do_no_harm():
    assert cloud(np.ones((2000, 3)))[:, :3].min() == 1.0


@pytest.mark.parametrize("task", ["fold_cloth", "drop_cloth"])
def test_labels_and_depths_agree_at_edges(task):
    """A pixel of the object has the object's depth, not that of what is behind it."""
    env = softgym_mj.load(task, observation="reduced", split="all", fidelity="fast")
    env.reset(806)
    points = env.task.points()
    for name in ("task", *EXTERNAL):
        view = LabeledView(name, 128, 128, lambda: env.task.scene.segmentation_models)
        seen = view.points(env.physics)
        assert len(seen) == np.sum(view.labels(env.physics) == LABELS.index("object")) > 300
        assert cKDTree(points).query(seen)[0].max() < 0.04
