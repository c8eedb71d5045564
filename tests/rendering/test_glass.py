"""Water is seen through the walls of cups, and marks of goals by people only."""

import mujoco
import numpy as np
import pytest
from scipy.spatial import cKDTree

import softgym_mj
from softgym_mj.envs.gymnasium_env import SoftGymEnv
from softgym_mj.rendering.observables import LABELS, LabeledView
from softgym_mj.rendering.offscreen import GLASS_GROUP, CameraView

SIZE, GEOM = (160, 160), mujoco.mjtObj.mjOBJ_GEOM
MARKED = (
    "rope_configuration", "transport_water", "pour_water_amount", "fold_cloth",
    "fold_crumpled_cloth", "drop_cloth", "drop_fold_cloth",
)  # fmt: skip
OBSERVED = ("rgb", "depth", "segmentation", "point_cloud")


def look(task, variation=803, **settings):
    own = {} if "rope" in task else {"fidelity": "fast"}
    env = softgym_mj.load(task, split="all", image_size=SIZE, **own, **settings)
    return env, env.reset(variation).observation


def pixels(env):
    """Mask (height, width) bool of water without walls."""
    seen = CameraView("task", *SIZE, marks=False, glass=False).segmentation(env.physics)
    geoms = seen[..., 1] == GEOM
    return (seen[..., 1] >= 0) & ~geoms


@pytest.mark.parametrize("task", ["pour_water", "transport_water"])
def test_water_behind_glass_is_water(task):
    env, observation = look(task, observation="segmentation")
    labels, water = observation["segmentation"], pixels(env)
    assert water.sum() > 100
    np.testing.assert_array_equal(labels == LABELS.index("object"), water)
    walls = CameraView("task", *SIZE).segmentation(env.physics)
    model = env.physics.model.ptr
    glass = (walls[..., 1] == GEOM) & (model.geom_group[walls[..., 0]] == GLASS_GROUP)
    assert (glass & water).sum() > 0.5 * water.sum()  # Which was labeled as the cup.
    np.testing.assert_array_equal(labels == LABELS.index("container"), glass & ~water)


def test_clouds_of_water_have_its_depth_behind_glass():
    env, observation = look("pour_water", observation="point_cloud")
    cloud = observation["point_cloud"]
    points = cloud[cloud[:, 3] == 1.0, :3]
    assert len(points) > 300
    distance, _ = cKDTree(env.task.points()).query(points)
    # The drawn surface is near the particles; a wall is up to 4 cm thick, and air is beside it.
    assert np.percentile(distance, 99) < 1.2 * env.task.water.spacing


def test_without_cups_nothing_is_rendered_twice(monkeypatch):
    views = []
    monkeypatch.setattr(CameraView, "_surfaces", spy(CameraView._surfaces, views))
    look("straighten_rope", observation="segmentation")
    assert len(views) == 1
    look("pour_water", observation="segmentation")
    assert len(views) == 3


def spy(method, calls):
    def wrapped(self, *arguments, **settings):
        calls.append(self)
        return method(self, *arguments, **settings)

    return wrapped


@pytest.mark.parametrize("task", MARKED)
def test_goals_are_drawn_for_people_and_not_observed(task):
    env, observation = look(task, observation=OBSERVED, goal_marks=False)
    shown = CameraView("task", *SIZE).rgb(env.physics)
    assert np.abs(shown.astype(int) - observation["rgb"]).max(axis=-1).max() > 40
    model = env.physics.model.ptr
    marks = [i for i in range(model.nsite) if model.site(i).name.startswith(("goal", "level"))]
    assert marks
    model.site_rgba[marks, 3] = 0.0
    np.testing.assert_array_equal(CameraView("task", *SIZE).rgb(env.physics), observation["rgb"])
    for name, value in env.observation().items():
        np.testing.assert_array_equal(value, observation[name], err_msg=name)


def test_render_shows_the_goal():
    pictures = []
    for name in ("rgb_array", None):
        env = SoftGymEnv(
            "transport_water", render_mode=name, render_size=SIZE, observation="rgb",
            image_size=SIZE, fidelity="fast",
        )  # fmt: skip
        observation, _ = env.reset(options={"variation": 3})
        pictures.append(observation if name is None else env.render())
        env.close()
    marked = np.abs(pictures[0].astype(int) - pictures[1]).max(axis=-1) > 40
    assert 0.0005 < marked.mean() < 0.05


def test_marks_cast_no_shadows():
    env, _ = look("pour_water_amount", variation=938)
    marked, bare = (CameraView("task", *SIZE, marks=m).rgb(env.physics).astype(int) for m in (1, 0))
    darker = bare - marked
    assert (darker[..., 1] - darker[..., 0] > 20).sum() > 20  # The red bar.
    gray = (darker.min(axis=-1) > 10) & (np.ptp(darker, axis=-1) < 15)
    assert not gray.any()


def test_the_outline_is_where_the_goal_is():
    """Corners of the marks, seen from straight above, against those of the goal."""
    env, _ = look("drop_cloth", observation="rgb")
    model = env.physics.model.ptr
    sites = [i for i in range(model.nsite) if model.site(i).name.startswith("goal")]
    corners = env.task.episode.goal["outline"][:, :2]
    middles = model.site_pos[sites, :2]
    sides = sorted(2 * model.site_size[sites, 0])
    expected = [(corners[a] + corners[b]) / 2 for a, b in ((0, 1), (1, 3), (3, 2), (2, 0))]
    np.testing.assert_allclose(middles, expected, atol=1e-9)
    np.testing.assert_allclose(sides, sorted([*env.task.cloth.size] * 2), atol=0.02)


def test_the_camera_of_labels_needs_no_cups():
    env, _ = look("spread_cloth", observation="reduced")
    labels = LabeledView("task", *SIZE, lambda: {}).labels(env.physics)
    assert set(np.unique(labels)) == {0, LABELS.index("object")}
