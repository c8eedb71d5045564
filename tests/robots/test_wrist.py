"""The cameras on the hands of arms: what they see, as images of `render` and as an observation."""

import gymnasium
import mujoco
import numpy as np
import pytest
from dm_control import mjcf

from softgym_mj.exceptions import InvalidArgumentError
from softgym_mj.rendering.observables import WRIST_RGB
from softgym_mj.rendering.offscreen import CameraView, camera_ids
from tests.contract.test_contract import actions, make
from tests.robots.arms import arms_of, cases_of

SIZE = 64
AHEAD = 0.075  # [m] From the tool point on along the tool, in the middle of the image.


def seen_at(physics, camera, point):
    """Column and row of a point (3,) [m] in an image from -1 (left, top) to 1 (right, bottom)."""
    model, data = physics.model.ptr, physics.data.ptr
    camera = camera_ids(model)[camera]
    local = (point - data.cam_xpos[camera]) @ data.cam_xmat[camera].reshape(3, 3)
    assert local[2] < 0.0  # Before the camera.
    right, up = local[:2] / -local[2] / np.tan(np.deg2rad(model.cam_fovy[camera]) / 2)
    return np.array([right, -up])


@cases_of(("fold_cloth", "pour_water"), "fold_cloth/franka", "pour_water/sawyer")
def test_fingers_are_at_the_lower_edge_and_what_they_reach_for_in_the_middle(case):
    env, arm = make(case), case.split("/")[1]
    env.reset(800)
    env.step(actions(env, 1)[0])
    physics, model = env.physics, env.task.actor.arm
    mujoco.mj_forward(physics.model.ptr, physics.data.ptr)
    sites = physics.named.data.site_xpos
    axes = physics.named.data.site_xmat
    for i, camera in enumerate(env.task.actor.wrists):
        prefix = f"arms/{arm}_{i}/"
        left, right = (seen_at(physics, camera, sites[f"{prefix}{pad}"]) for pad in model.pad_geoms)
        assert -0.8 < left[0] < 0.0 < right[0] < 0.8 or -0.8 < right[0] < 0.0 < left[0] < 0.8
        np.testing.assert_allclose(left, right * [-1.0, 1.0], atol=0.02)
        assert 1 / 3 < left[1] < 0.9
        tool = f"{prefix}{model.tcp_site}"
        ahead = sites[tool] + AHEAD * axes[tool].reshape(3, 3)[:, 2]
        np.testing.assert_allclose(seen_at(physics, camera, ahead), 0.0, atol=0.05)


@arms_of("franka", "sawyer")
def test_the_image_shows_the_pads_in_its_lower_part(arm):
    env = make(f"straighten_rope/{arm}", arms=1)
    env.reset(800)
    seen = CameraView("wrist_0", 120, 120).segmentation(env.physics)
    model = env.physics.model.ptr
    # The rubber of the drawn pads.
    rubber = model.material(f"arms/{arm}_0/rubber").id
    pads = np.flatnonzero(model.geom_matid == rubber)
    rows, columns = np.nonzero(
        (seen[..., 1] == mujoco.mjtObj.mjOBJ_GEOM) & np.isin(seen[..., 0], pads)
    )
    assert len(rows) > 100 and rows.min() > 60 and rows.mean() < 110
    assert abs(columns.mean() - 59.5) < 2.0


@pytest.mark.parametrize("task", ["fold_cloth", "transport_water"])
def test_the_observation_is_what_the_cameras_render(task):
    env = make(f"{task}/franka", observation=[WRIST_RGB, "proprioception"], image_size=(48, SIZE))
    number = 1 if "water" in task else 2
    assert env.observation_spec()[WRIST_RGB].shape == (number, 48, SIZE, 3)
    assert set(env.observation_spec()) == {WRIST_RGB, "proprioception"}
    first = env.reset(800).observation[WRIST_RGB]
    images = env.step(actions(env, 1)[0]).observation[WRIST_RGB]
    env.observation_spec()[WRIST_RGB].validate(images)
    assert not np.shares_memory(first, images) and not np.array_equal(first, images)
    for i, image in enumerate(images):
        np.testing.assert_array_equal(image, CameraView(f"wrist_{i}", 48, SIZE).rgb(env.physics))
        assert image.std() > 10.0
    if number == 2:
        assert not np.array_equal(*images)


def test_gymnasium_renders_and_observes_wrists():
    env = gymnasium.make(
        "softgym_mj/StraightenRope-v0", actor="sawyer", split=[800], observation=WRIST_RGB,
        image_size=(SIZE, SIZE), render_mode="rgb_array", camera="wrist_1",
        render_size=(SIZE, SIZE),
    )  # fmt: skip
    assert env.observation_space == gymnasium.spaces.Box(0, 255, (2, SIZE, SIZE, 3), np.uint8)
    images, _ = env.reset()
    np.testing.assert_array_equal(env.render(), images[1])


@pytest.mark.parametrize(("task", "actor"), [("pour_water", "cup"), ("fold_cloth", "picker")])
def test_actors_without_hands_have_no_wrists(task, actor):
    with pytest.raises(InvalidArgumentError, match=r"'wrist_rgb' needs an arm: .*'ur5e'"):
        make(f"{task}/{actor}", observation=WRIST_RGB)
    (env := make(f"{task}/{actor}")).reset(800)
    with pytest.raises(InvalidArgumentError, match=r"camera='wrist_0'.*'task', 'overview'"):
        CameraView("wrist_0", SIZE, SIZE).rgb(env.physics)


def test_one_arm_has_one_wrist():
    with pytest.raises(InvalidArgumentError, match=r"camera='wrist_1'.*'wrist_0'"):
        gymnasium.make("softgym_mj/StraightenRope-v0", actor="franka", arms=1, camera="wrist_1")


def test_the_last_part_of_a_name_is_enough_where_it_is_the_only_one():
    root = mjcf.RootElement(model="root")
    root.worldbody.add("camera", name="eye")
    for name in ("left", "right"):
        part = mjcf.RootElement(model=name)
        part.worldbody.add("camera", name="hand")
        part.worldbody.add("camera", name=f"{name}_eye")
        root.attach(part)
    model = mujoco.MjModel.from_xml_string(root.to_xml_string())
    ids = camera_ids(model)
    assert set(ids) == {
        "eye", "left_eye", "right_eye",
        "left/hand", "left/left_eye", "right/hand", "right/right_eye",
    }  # fmt: skip
    assert all(model.camera(i).name.endswith(name) for name, i in ids.items())
