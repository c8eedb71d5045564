"""Camera observations compared with the state."""

import numpy as np
import pytest

import softgym_mj
from softgym_mj.exceptions import InvalidArgumentError
from softgym_mj.rendering.observables import LABELS
from softgym_mj.rendering.point_clouds import NUM_CLOUD_POINTS
from softgym_mj.tasks.shared.observations import OBSERVATIONS

SIZE = (160, 200)


def look(task, variation=803, **kwargs):
    if "rope" not in task:
        kwargs["fidelity"] = "fast"
    env = softgym_mj.load(
        task, split="evaluate", observation=list(OBSERVATIONS), image_size=SIZE, **kwargs
    )
    return env, env.reset(variation).observation


@pytest.mark.parametrize(
    "task", ["rope_configuration", "spread_cloth", "transport_water", "pour_water_amount"]
)
def test_labels_show_what_the_task_has(task):
    _, observation = look(task)
    expected = {"background", "object"}
    expected |= {"container"} if "water" in task else {"actor"}
    assert {LABELS[i] for i in np.unique(observation["segmentation"])} == expected


def test_labels_follow_the_colors():
    """The rope is the only blue, the pickers the only dark things; edges are blended."""
    _, observation = look("straighten_rope")
    image, labels = observation["rgb"].astype(int), observation["segmentation"]
    blue = image[..., 2] > image[..., 0] + 60
    rope = labels == LABELS.index("object")
    assert np.mean(rope[blue]) > 0.8 and np.mean(blue[rope]) > 0.8
    assert np.mean(image[labels == LABELS.index("actor")]) < np.mean(image) / 1.5


@pytest.mark.parametrize(
    ("task", "spacing"), [("fold_cloth", 0.04), ("straighten_rope", 0.0125), ("pour_water", 0.03)]
)
def test_cloud_points_lie_on_the_object(task, spacing):
    env, observation = look(task, 805)  # No picker stands before the object.
    cloud = observation["point_cloud"]
    points = cloud[cloud[:, 3] == 1.0, :3]
    assert cloud.shape == (NUM_CLOUD_POINTS, 4) and len(points) > 100
    assert not cloud[len(points) :].any()
    distance = np.linalg.norm(points[:, None] - env.task.points(), axis=2)
    # From a surface point to the nearest vertex: half a diagonal of the mesh, and its thickness.
    assert distance.min(axis=1).max() < 0.75 * spacing + 0.007
    # The cameras see all of a flat object that no picker hides.
    if task == "fold_cloth":
        assert np.percentile(distance.min(axis=0), 95) < 0.025


def test_clouds_have_no_point_of_the_sky():
    env = softgym_mj.load(
        "drop_cloth", observation="point_cloud", split="evaluate", fidelity="fast"
    )
    cloud = env.reset(806).observation["point_cloud"]  # Two pixels of the sky at the cloth's edge.
    distance = np.linalg.norm(cloud[:, None, :3] - env.task.points(), axis=2)
    assert distance.min(axis=1)[cloud[:, 3] == 1.0].max() < 0.04


def test_depth_is_metric_and_square_to_the_camera():
    """The floor is where the rays of the camera of the model meet it, and nothing is below it."""
    env, observation = look("straighten_rope")
    depth, labels = observation["depth"], observation["segmentation"]
    model, data = env.physics.model.ptr, env.physics.data.ptr
    camera = model.camera("task").id
    pitch = 2 * np.tan(np.deg2rad(model.cam_fovy[camera]) / 2) / SIZE[0]
    down, right = ((np.arange(n) + 0.5 - n / 2) * pitch for n in SIZE)
    axes = data.cam_xmat[camera].reshape(3, 3)
    sinks = axes[2, 2] - right * axes[2, 0] + down[:, None] * axes[2, 1]
    floor = data.cam_xpos[camera, 2] / sinks
    assert np.mean(np.abs(depth - floor)[labels == 0] < 2e-3) > 0.99
    assert (depth < floor + 5e-3).all() and (depth < floor - 0.05).any()


@pytest.mark.parametrize("task", ["spread_cloth", "transport_water"])
def test_the_mask_tells_points_from_padding(task):
    env, observation = look(task)
    mask, points = observation["full_mask"], env.task.points()
    assert mask.dtype == np.uint8 and mask.sum() == len(points)
    assert (np.diff(mask.astype(int)) <= 0).all()
    listed = observation["full"][: 3 * len(mask)].reshape(-1, 3)
    np.testing.assert_array_equal(listed[mask == 1], points)
    assert not listed[mask == 0].any()


@pytest.mark.parametrize("actor", ["picker", "pick_and_place", "pixel_pick_and_place", "franka"])
def test_what_actors_sense_ends_the_states_and_can_be_had_apart(actor):
    names = ["full", "reduced", "proprioception"]
    env = softgym_mj.load("rope_configuration", actor=actor, observation=names, split="evaluate")
    env.reset(803)
    observation = env.step(np.full(env.action_spec().shape, 0.1)).observation
    sensed = observation["proprioception"]
    numbers = {"picker": 6, "pick_and_place": 6, "pixel_pick_and_place": 3, "franka": 44}
    assert sensed.shape == (numbers[actor],)
    for name in ("full", "reduced"):
        np.testing.assert_array_equal(observation[name][-len(sensed) :], sensed)
    places = env.task.actor.positions().ravel()
    np.testing.assert_array_equal(sensed[: places.size], places)


@pytest.mark.parametrize("task", ["transport_water", "pour_water"])
def test_cups_sense_their_pose(task):
    env = softgym_mj.load(task, observation="proprioception", split="evaluate", fidelity="fast")
    env.reset(803)
    observation = env.step(np.full(env.action_spec().shape, 0.5)).observation
    sensed = observation["proprioception"]
    assert sensed.shape == (3,)
    np.testing.assert_array_equal(sensed, env.task.cup.pose)
    assert sensed[0] == pytest.approx(8 * 0.5 * env.task.actor.max_step[0])


@pytest.mark.parametrize("actor", ["picker", pytest.param("sawyer", marks=pytest.mark.slow)])
def test_images_with_what_is_sensed_do_not_tell_where_the_object_is(actor):
    seen = []
    for shift in (0.0, 0.1):
        env = softgym_mj.load(
            "straighten_rope", actor=actor, observation=["rgb", "proprioception"], split="evaluate",
            image_size=(32, 32),
        )  # fmt: skip
        env.reset(803)
        rope = env.task.objects[0]
        rope.set_points(rope.points() + [0.0, shift, 0.0])
        seen.append(env.step(np.zeros(env.action_spec().shape)).observation)
    assert set(seen[0]) == {"rgb", "proprioception"}
    assert not np.array_equal(seen[0]["rgb"], seen[1]["rgb"])
    np.testing.assert_allclose(seen[0]["proprioception"], seen[1]["proprioception"], atol=1e-6)


@pytest.mark.parametrize("actor", ["picker", "franka"])
def test_grippers_know_what_they_hold(actor):
    env = softgym_mj.load("straighten_rope", actor=actor, observation=["reduced", "held"])
    np.testing.assert_array_equal(env.reset(800).observation["held"], [0, 0])
    env.task.actor.take([0, 40])
    action = np.array([0.0, 0.0, 0.1, 1.0, 0.0, 0.0, 0.1, 1.0])
    np.testing.assert_array_equal(env.step(action).observation["held"], [1, 1])
    action[7] = -1.0  # The second one opens.
    np.testing.assert_array_equal(env.step(action).observation["held"], [1, 0])
    assert env.info()["picks_held"] == 1
    with pytest.raises(InvalidArgumentError, match="observation='held'"):
        softgym_mj.load("pour_water", observation="held")
