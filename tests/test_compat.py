"""The shim for old SoftGym scripts."""

import numpy as np
import pytest

from softgym_mj import compat
from softgym_mj.exceptions import InvalidArgumentError

# Sizes of SoftGym's key point vectors (facts 1.5), with the two of PourWaterAmount that we add.
KEY_POINTS = {
    "PassWater": 7, "PourWater": 13, "PourWaterAmount": 15, "RopeFlatten": 36,
    "RopeConfiguration": 66, "ClothFlatten": 18, "ClothFold": 18, "ClothDrop": 18,
    "ClothFoldCrumpled": 18, "ClothFoldDrop": 18,
}  # fmt: skip


@pytest.mark.parametrize("name", compat.names())
def test_an_old_training_loop_runs(name):
    env = compat.make(
        name, observation_mode="key_point", num_variations=1, horizon=2, render=True,
        headless=True, camera_name="default_camera",
    )  # fmt: skip
    env.seed(0)
    assert env.observation_space.shape == (KEY_POINTS[name],)
    for _ in range(2):
        observation, done, steps = env.reset(), False, 0
        while not done:
            assert observation in env.observation_space
            observation, reward, done, info = env.step(env.action_space.sample())
            steps += 1
        assert steps == 2
        assert reward == env.compute_reward() and np.isfinite(info["normalized_performance"])


def test_axes_are_softgyms():
    env = compat.make("RopeFlatten", observation_mode="key_point", action_mode="picker")
    start = env.reset(config_id=803).reshape(-1, 3)
    ours = env.dm_env.observation()["reduced"].reshape(-1, 3)
    np.testing.assert_allclose(start[:, 0], ours[:, 0], atol=1e-7)
    np.testing.assert_allclose(start[:, 1], ours[:, 2], atol=1e-7)  # Up.
    np.testing.assert_allclose(start[:, 2], -ours[:, 1], atol=1e-7)
    # Picker 0 starts at +z (facts 2.3).
    assert start[-2, 2] - start[-1, 2] == pytest.approx(0.08, abs=1e-6)
    observation, *_ = env.step(np.array([0.5, 1.0, -0.5, -1, 0, 0, 0, -1]))
    moved = observation.reshape(-1, 3) - start
    np.testing.assert_allclose(moved[-2], [0.04, 0.08, -0.04], atol=1e-6)
    np.testing.assert_allclose(moved[-1], 0.0, atol=1e-6)


@pytest.mark.parametrize("name", ["PourWater", "ClothFold"])
def test_point_clouds_have_y_up(name):
    env = compat.make(name, observation_mode="point_cloud", num_variations=1)
    observation = env.reset()
    points = env.dm_env.task.points()
    listed = observation[: points.size].reshape(-1, 3)
    np.testing.assert_allclose(listed[:, 1], points[:, 2], atol=1e-6)
    np.testing.assert_allclose(listed[:, 2], -points[:, 1], atol=1e-6)


def test_the_last_fifth_of_the_variations_is_for_evaluation():
    env = compat.make("RopeFlatten", "key_point", num_variations=10)
    env.seed(1)
    drawn: dict[bool, set[int]] = {False: set(), True: set()}
    for env.eval_flag, seen in drawn.items():
        for _ in range(40):
            env.reset()
            seen.add(env.current_config_id)
    assert drawn == {False: set(range(8)), True: {8, 9}}
    first = compat.make("RopeFlatten", "key_point", num_variations=10, deterministic=True)
    assert (first.reset(), first.current_config_id)[1] == 0
    first.eval_flag = True
    assert (first.reset(), first.current_config_id)[1] == 8


@pytest.mark.parametrize("name", ["RopeFlatten", "PourWater"])
def test_actions_are_clipped_as_softgym_does(name):
    env = compat.make(name, "key_point", num_variations=1)
    env.reset()
    start = env.get_state()
    size = env.action_space.shape[0]
    for action in (np.full(size, 1.5), np.linspace(-7.0, 7.0, size), np.full(size, -np.inf)):
        # Its NormalizedEnv: on a raw box [low, high], then clipped to it (facts 1.7).
        low, high = -0.01, 0.01
        raw = np.clip(low + (action + 1) * 0.5 * (high - low), low, high)
        within = np.clip(2 * (raw - low) / (high - low) - 1, -1, 1)
        env.set_state(start)
        found = env.step(action)
        env.set_state(start)
        expected = env.step(within)
        np.testing.assert_allclose(found[0], expected[0], atol=1e-6)
        assert found[1] == pytest.approx(expected[1], abs=1e-6)
    for action in (np.full(size, np.nan), np.zeros(size + 1)):
        with pytest.raises(InvalidArgumentError):
            env.step(action)


def test_a_snapshot_and_an_image():
    env = compat.make("RopeFlatten", "cam_rgb", num_variations=1, camera_height=32, camera_width=48)
    assert env.reset().shape == (32, 48, 3)
    assert env.get_image(64, 40).shape == (40, 64, 3)
    state = env.get_state()
    first = env.step(np.full(8, 0.3))
    env.set_state(state)
    second = env.step(np.full(8, 0.3))
    np.testing.assert_array_equal(first[0], second[0])
    assert first[1:] == second[1:]


def test_pick_and_place_has_its_twenty_actions():
    env = compat.make("ClothFlatten", "key_point", "pickerpickplace", num_variations=1)
    assert env.horizon == 20 and env.action_space.shape == (8,)


@pytest.mark.parametrize(
    ("kwargs", "message"),
    [
        ({"name": "ClothSpread"}, r"name='ClothSpread'.*'ClothFlatten'"),
        ({"observation_mode": "state"}, r"'key_point', 'point_cloud', 'cam_rgb'"),
        ({"action_mode": "sawyer"}, "action_mode='sawyer'"),
        ({"num_variations": 0}, "num_variations=0"),
        ({"fps": 3}, "argument='fps'.*'horizon', .*'num_picker', .*'headless'"),
    ],
)
def test_bad_arguments_name_the_choices(kwargs, message):
    with pytest.raises(InvalidArgumentError, match=message):
        compat.make(**{"name": "RopeFlatten", **kwargs})


def test_a_variation_that_is_not_in_use_is_refused():
    env = compat.make("RopeFlatten", "key_point", num_variations=5)
    with pytest.raises(InvalidArgumentError, match=r"config_id=5.*0\.\.4"):
        env.reset(config_id=5)
