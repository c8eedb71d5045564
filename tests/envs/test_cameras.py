"""Calibration in info: the cameras of an observation, there and in vectors and datasets."""

import gymnasium
import numpy as np
import pytest

import softgym_mj
from softgym_mj.entities.views import VIEWS
from softgym_mj.envs.gymnasium_env import SoftGymEnv
from softgym_mj.recording.episodes import nested, play
from softgym_mj.rendering.calibration import Calibration
from softgym_mj.rendering.offscreen import CameraView

SIZE = (40, 56)
EXTERNAL = ("external_rgb", "external_depth")


def make(observation, **settings):
    return SoftGymEnv(
        "straighten_rope", observation=observation, image_size=SIZE, split="all", **settings
    )


def test_observations_are_what_the_cameras_render():
    env = make(EXTERNAL)
    observation, info = env.reset(options={"variation": 803})
    assert env.observation_space["external_rgb"].shape == (2, *SIZE, 3)
    assert env.observation_space["external_depth"].shape == (2, *SIZE)
    assert list(info["cameras"]) == ["left", "right"]
    for i, (name, camera) in enumerate(info["cameras"].items()):
        view, physics = CameraView(name, *SIZE), env.dm_env.physics
        np.testing.assert_array_equal(observation["external_rgb"][i], view.rgb(physics))
        np.testing.assert_array_equal(observation["external_depth"][i], view.depth(physics))
        own = view.calibration(physics)
        np.testing.assert_array_equal(camera["intrinsics"], own.intrinsics)
        np.testing.assert_array_equal(camera["extrinsics"], own.extrinsics)
        assert observation["external_depth"][i].dtype == np.float32


@pytest.mark.parametrize(
    ("observation", "cameras"),
    [
        ("reduced", None),
        ("rgb", ["task"]),
        (("depth", "reduced", "point_cloud"), ["left", "right", "task"]),
    ],
)
def test_info_has_the_cameras_of_the_observation(observation, cameras):
    env = make(observation)
    for info in (env.reset()[1], env.step(env.action_space.sample())[-1]):
        assert (sorted(info["cameras"]) if "cameras" in info else None) == cameras
        assert "cameras" not in env.dm_env.info()


def test_the_task_camera_goes_with_its_domain_parameters():
    env = make("rgb", domain={"camera_x": "out_of_distribution"})
    seen = [env.reset(options={"variation": v})[1] for v in (800, 801)]
    for info in seen:
        calibration = Calibration(**info["cameras"]["task"])
        place = calibration.unproject(np.zeros((1, 2)), np.zeros(1))[0]
        nominal = VIEWS["straighten_rope"].camera.position[0]
        assert place[0] - nominal == pytest.approx(info["domain_camera_x"], abs=1e-9)
    assert seen[0]["domain_camera_x"] != seen[1]["domain_camera_x"]


def test_wrists_carry_their_calibration():
    """What a wrist sees at the middle of its image stays there in the world's frame."""
    env = make("wrist_rgb", actor="franka")
    seen = [Calibration(**env.reset(options={"variation": 803})[1]["cameras"]["wrist_0"])]
    action = np.zeros(env.action_space.shape, np.float32)
    action[0] = 1.0
    for _ in range(3):
        seen.append(Calibration(**env.step(action)[-1]["cameras"]["wrist_0"]))
    assert np.linalg.norm(seen[-1].extrinsics[:3, 3] - seen[0].extrinsics[:3, 3]) > 0.05
    np.testing.assert_array_equal(seen[-1].intrinsics, seen[0].intrinsics)
    (hand,) = env.dm_env.task.actor.positions()[:1]
    (pixel,), (depth,) = seen[-1].project(hand[None])
    assert 0.0 < depth < 0.4 and abs(pixel[0] - (SIZE[1] - 1) / 2) < 1.0  # Between the fingers.


@pytest.mark.parametrize("own", [True, False])
def test_vectors_stack_them(own):
    settings = {"observation": "external_depth", "image_size": SIZE}
    if own:
        envs = softgym_mj.make_vec("straighten_rope", num_envs=2, **settings)
    else:
        envs = gymnasium.make_vec(
            "softgym_mj/StraightenRope-v0", 2, vectorization_mode="sync",
            vector_kwargs={}, **settings,
        )  # fmt: skip
    _, infos = envs.reset(seed=0)
    single = make("external_depth").reset()[1]["cameras"]
    for found in (infos, envs.step(envs.action_space.sample())[-1]):
        for name, camera in single.items():
            for key, matrix in camera.items():
                np.testing.assert_array_equal(found["cameras"][name][key], [matrix, matrix])
    envs.close()


def test_datasets_keep_them():
    env = make("external_depth", horizon=3)
    arrays = play(env, lambda timestep: np.zeros(env.action_space.shape), 803)
    assert arrays["infos/cameras/left/extrinsics"].shape == (4, 4, 4)
    found = nested(arrays)["infos"]["cameras"]["right"]["intrinsics"]
    np.testing.assert_array_equal(found[0], env.reset()[1]["cameras"]["right"]["intrinsics"])
