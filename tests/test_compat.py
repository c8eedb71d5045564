"""SoftGym's interface: old scripts, its axes and units, and the table that lists every name."""

import copy
import functools
import pathlib
import pickle
import re

import imageio.v3 as imageio
import numpy as np
import pytest

from softgym_mj import compat
from softgym_mj.compat import SOFTGYM_ENVS, ReplacedError, env_arg_dict, normalize
from softgym_mj.exceptions import InvalidArgumentError, LifecycleError, UnavailableError

# Sizes of SoftGym's key point vectors (docs/softgym.md 3), with two that we add to
# PourWaterAmount.
KEY_POINTS = {
    "PassWater": 7, "PourWater": 13, "PourWaterAmount": 15, "RopeFlatten": 36,
    "RopeConfiguration": 66, "ClothFlatten": 18, "ClothFold": 18, "ClothDrop": 18,
    "ClothFoldCrumpled": 18, "ClothFoldDrop": 18, "ClothFlattenPPP": 18, "ClothFoldPPP": 18,
}  # fmt: skip
PAGE = (pathlib.Path(__file__).parents[1] / "docs" / "migration.md").read_text()
ROWS = [
    (kind, names, here, how.replace("`", ""))
    for kind, cell, here, how in re.findall(
        r"^\| ([\w ]+) \| (`.*?`) \| (same|differs|refused) \| (.*?) ?\|$", PAGE, re.MULTILINE
    )
    for names in [re.findall(r"`(\w+)`", cell)]
]


def make(name, observation_mode="key_point", action_mode=None, **settings):
    usual = {**env_arg_dict[name], "num_variations": 1, "observation_mode": observation_mode}
    usual |= {"action_mode": action_mode} if action_mode else {}
    return SOFTGYM_ENVS[name](**{**usual, **settings})


@pytest.mark.parametrize("name", SOFTGYM_ENVS)
def test_an_old_training_loop_runs(name):
    env_kwargs = {**env_arg_dict[name], "observation_mode": "key_point"}
    assert env_kwargs["num_variations"] == 1000
    env_kwargs |= {"num_variations": 1, "horizon": 2, "headless": 1}
    env = normalize(SOFTGYM_ENVS[name](**env_kwargs))
    env.seed(0)
    assert env.observation_space.shape == (KEY_POINTS[name],)
    np.testing.assert_array_equal(env.action_space.high, 1.0)
    for _ in range(2):
        observation, done, steps = env.reset(), False, 0
        while not done:
            assert observation in env.observation_space
            observation, reward, done, info = env.step(env.action_space.sample())
            steps += 1
        assert steps == env.time_step == 2
        assert reward == env.compute_reward() and np.isfinite(info["normalized_performance"])
    *_, done, _ = env.step(env.action_space.sample())  # SoftGym goes on.
    assert done and env.time_step == 3


def test_axes_are_softgyms():
    env = normalize(make("RopeFlatten", num_variations=1000))
    start = env.reset(config_id=803).reshape(-1, 3)
    ours = env.dm_env.observation()["reduced"].reshape(-1, 3)
    np.testing.assert_allclose(start[:, 0], ours[:, 0], atol=1e-7)
    np.testing.assert_allclose(start[:, 1], ours[:, 2], atol=1e-7)  # Up.
    np.testing.assert_allclose(start[:, 2], -ours[:, 1], atol=1e-7)
    # Picker 0 starts at +z (docs/softgym.md 2.3).
    assert start[-2, 2] - start[-1, 2] == pytest.approx(0.08, abs=1e-6)
    action = np.array([0.5, 1.0, -0.5, -1, 0, 0, 0, -1])
    raw = [0.005, 0.01, -0.005, 0, 0, 0, 0, 0]
    np.testing.assert_allclose(env.denormalize(action), raw, atol=1e-9)
    state = env.get_state()
    for wrapped, step in ((env, action), (env._wrapped_env, raw)):
        wrapped.set_state(state)
        observation, *_ = wrapped.step(step)
        moved = observation.reshape(-1, 3) - start
        np.testing.assert_allclose(moved[-2], [0.04, 0.08, -0.04], atol=1e-6)
        np.testing.assert_allclose(moved[-1], 0.0, atol=1e-6)


@pytest.mark.parametrize("name", ["PourWater", "ClothFold"])
def test_point_clouds_have_y_up(name):
    env = make(name, "point_cloud")
    observation = env.reset()
    points = env.dm_env.task.points()
    listed = observation[: points.size].reshape(-1, 3)
    np.testing.assert_allclose(listed[:, 1], points[:, 2], atol=1e-6)
    np.testing.assert_allclose(listed[:, 2], -points[:, 1], atol=1e-6)


def test_boxes_are_those_of_the_cups():
    for name in ("PassWater", "PourWater", "PourWaterAmount"):
        env = make(name)
        steps = env.dm_env.task.actor.max_step
        np.testing.assert_allclose(env.action_space.high, steps[steps > 0.0])
        np.testing.assert_allclose(env.action_space.low, -steps[steps > 0.0])


def test_pick_and_place_goes_to_points_in_meters():
    env = make("ClothFlatten", action_mode="pickerpickplace", horizon=20, action_repeat=1)
    center = env.reset()[-6:].reshape(2, 3).mean(axis=0)
    np.testing.assert_allclose(env.action_space.high, [0.5, 0.3, 0.5, 1.0] * 2)
    observation, *_, info = env.step([0.1, 0.2, -0.2, 0.0, -0.3, 0.15, 0.25, 0.0])
    reached = [[0.1, 0.2, -0.2], [-0.3, 0.15, 0.25]]
    np.testing.assert_allclose(observation[-6:].reshape(2, 3), reached, atol=1e-6)
    assert info["total_steps"] > 20
    # A sphere of 5 cm in a box of 1 x 0.3 x 1 m around the cloth (docs/softgym.md 2.2).
    observation, *_ = env.step([0.5, 0.3, 0.5, 0.0, -0.5, 0.0, -0.5, 0.0])
    ends = np.array([[0.45, 0.25, 0.45], [-0.45, 0.05, -0.45]]) + center * [1, 0, 1]
    ends = np.clip(ends, [-0.5, 0, -0.5], [0.5, 0.3, 0.5])
    np.testing.assert_allclose(observation[-6:].reshape(2, 3), ends, atol=1e-6)


@pytest.mark.parametrize("copied", [copy.deepcopy, pickle.dumps])
def test_snapshots_replace_copies(copied):
    env, other = make("RopeFlatten"), make("RopeFlatten")
    for each in (env, normalize(env)):
        with pytest.raises(LifecycleError, match=r"cannot be copied.*set_state\(env.get_state"):
            copied(each)
    env.reset(), other.reset()
    env.step(env.action_space.high)
    other.set_state(env.get_state())
    steps = [each.step(each.action_space.low) for each in (env, other)]
    np.testing.assert_array_equal(steps[0][0], steps[1][0])
    assert steps[0][1:] == steps[1][1:]


def test_pixels_and_offsets_are_softgyms():
    env = make("ClothFlatten", action_mode="picker_qpg", num_picker=1, action_repeat=1)
    env.reset()
    state = env.get_state()
    position, (yaw, pitch, _) = env.get_camera_params()
    for u, v, offset in ((0.1, -0.05, [0.06, 0.1, 0.04]), (-0.1, 0.1, [0.0, 0.02, -0.05])):
        # docs/softgym.md 1.4 and 2.5: the pixel's ray meets the plane at 0.00625 m.
        look = np.array([-np.sin(yaw) * np.cos(pitch), np.sin(pitch), -np.cos(yaw) * np.cos(pitch)])
        right = np.array([np.cos(yaw), 0.0, -np.sin(yaw)])
        half = np.tan(np.radians(22.5))
        ray = look + u * half * right - v * half * np.cross(right, look)
        pick = position + (0.00625 - position[1]) / ray[1] * ray
        env.set_state(state)
        observation, *_ = env.step([u, v, *offset])
        # Within the floor's limit of 5 cm and 25 cm about the start.
        place = [pick[0] + offset[0], 0.05 + offset[1], pick[2] + offset[2]]
        np.testing.assert_allclose(observation[-3:], place, atol=2e-3)
    env.set_state(state)
    start = observation[-3:] * 0 + env._get_obs()[-3:]
    far, *_ = env.step([0.0, 0.0, 0.3, 0.3, 0.3])
    np.testing.assert_allclose(far[-3:], start * [1, 0, 1] + [0.25, 0.25, 0.25], atol=2e-2)


def test_the_last_fifth_of_the_variations_is_for_evaluation():
    env = normalize(make("RopeFlatten", num_variations=10))
    env.seed(1)
    drawn: dict[bool, set[int]] = {False: set(), True: set()}
    for env.eval_flag, seen in drawn.items():
        for _ in range(40):
            env.reset()
            seen.add(env.current_config_id)
    assert drawn == {False: set(range(8)), True: {8, 9}}
    first = make("RopeFlatten", num_variations=10, deterministic=True)
    assert (first.reset(), first.current_config_id)[1] == 0
    first.eval_flag = True
    assert (first.reset(), first.current_config_id)[1] == 8


def test_numpys_global_generator_draws_variations():
    env = make("RopeFlatten", num_variations=1000)
    drawn = []
    for _ in range(2):
        np.random.seed(3)  # noqa: NPY002 - as old scripts do.
        drawn.append([(env.reset(), env.current_config_id)[1] for _ in range(4)])
    assert drawn[0] == drawn[1] and len(set(drawn[0])) > 1


@pytest.mark.parametrize("name", ["RopeFlatten", "PourWater"])
def test_actions_are_clipped_as_softgym_does(name):
    raw = make(name)
    env = normalize(raw)
    env.reset()
    start = env.get_state()
    size = env.action_space.shape[0]
    low, high = raw.action_space.low.astype(float), raw.action_space.high.astype(float)
    for action in (np.full(size, 1.5), np.linspace(-7.0, 7.0, size)):
        env.set_state(start)
        result = env.step(action)
        # Its NormalizedEnv: on the raw box, then clipped to it (docs/softgym.md 1.7).
        raw.set_state(start)
        expected = raw.step(np.clip(low + (action + 1) * 0.5 * (high - low), low, high))
        np.testing.assert_allclose(result[0], expected[0], atol=1e-6)
        assert result[1] == pytest.approx(expected[1], abs=1e-6)
    for action in (
        np.full(size, np.nan),
        np.full(size, np.inf),
        np.zeros(size + 1),
        0.5,
        "up",
        [[1], [1, 2]],
        None,
    ):
        for one in (env, raw):
            with pytest.raises(InvalidArgumentError, match="numbers"):
                one.step(action)
    for one in (env, raw):
        with pytest.raises(
            InvalidArgumentError, match=rf"action.shape=\({size + 1},\) .*\({size},\)"
        ):
            one.step(np.zeros(size + 1))
    raw.set_state(start)
    expected = raw.step(raw.action_space.high)
    raw.set_state(start)
    np.testing.assert_array_equal(raw.step(2.0 * raw.action_space.high)[0], expected[0])
    with pytest.raises(InvalidArgumentError, match="numbers from"):
        normalize(raw, clip=False).step(np.full(size, 2.0))


def test_normalize_scales_rewards_and_clips_observations():
    plain, scaled = (make("RopeFlatten") for _ in range(2))
    scaled = normalize(scaled, scale_reward=50.0, clip_obs=(-0.05, 0.05))
    assert plain.reset().max() > 0.05 and scaled.reset().max() == pytest.approx(0.05)
    reward = plain.step(np.zeros(8))[1]
    observation, result, *_ = scaled.step([0, 0, 0, -1] * 2)
    assert result == pytest.approx(50.0 * reward) and observation.max() == pytest.approx(0.05)


def test_a_snapshot_and_an_image():
    env = make("RopeFlatten", "cam_rgb", camera_height=32, camera_width=48)
    with pytest.raises(LifecycleError, match="reset"):
        env.step(np.zeros(8))
    assert env.reset().shape == (32, 48, 3) == env.render().shape
    assert env.get_image(64, 40).shape == (40, 64, 3)
    state = env.get_state()
    first = env.step(np.full(8, 0.003))
    env.set_state(state)
    second = env.step(np.full(8, 0.003), record_continuous_video=True, img_size=16)
    np.testing.assert_array_equal(first[0], second[0])
    frames = second[3].pop("flex_env_recorded_frames")
    assert first[1:] == second[1:]  # Pictures change nothing.
    assert np.shape(frames) == (4, 16, 16, 3)
    assert np.abs(frames[0].astype(int) - frames[-1]).max() > 10


def test_the_goal_image_is_three_channels_more():
    env = make("RopeConfiguration", "cam_rgb", camera_height=48, camera_width=48)
    observation = env.reset()
    assert observation.shape == (48, 48, 6) and observation in env.observation_space
    np.testing.assert_array_equal(observation[..., :3], env.get_image(48, 48))
    goal = env.dm_env.task.goal_image(env.dm_env.physics, 48, 48)
    np.testing.assert_array_equal(observation[..., 3:], goal)
    assert np.abs(observation[..., :3].astype(int) - goal).max() > 50


@pytest.mark.parametrize(("name", "steps"), [("RopeFlatten", 3), ("ClothFlattenPPP", 1)])
def test_a_video_is_recorded(name, steps, tmp_path):
    env = normalize(make(name, "cam_rgb", camera_height=64, camera_width=64))
    with pytest.raises(LifecycleError, match="start_record"):
        env.end_record()
    env.start_record()
    env.reset()
    for _ in range(steps):
        info = env.step(0.5 * np.ones(8))[3]
    env.end_record(video_path=str(tmp_path / "video.gif"), fps=10)
    frames = imageio.imread(tmp_path / "video.mp4")
    assert frames.shape == (1 + steps + info.get("total_steps", 0), 64, 64, 3)
    assert not env.recording


def test_cameras_and_configs_are_softgyms():
    """docs/softgym.md 1.4, 3.0 and 3.3."""
    water, cloth = make("PourWaterAmount"), make("ClothFlatten", num_variations=5)
    water.reset()
    cloth.reset(config_id=3)
    position, angles = water.get_camera_params()
    np.testing.assert_allclose(position, [1.4, 1.5, 0.1], atol=1e-6)
    np.testing.assert_allclose(angles, [0.45 * np.pi, -np.pi / 3, 0.0], atol=1e-3)
    np.testing.assert_allclose(cloth.get_camera_params()[1], [0.0, -np.pi / 4, 0.0], atol=1e-3)
    config, task = cloth.get_current_config(), cloth.dm_env.task
    assert (
        config["ClothSize"] == list(task.cloth.dims)
        and config["camera_name"] in config["camera_params"]
    )
    assert config["flatten_area"] == pytest.approx(task.bounds(task.episode)[1])
    config, task = water.get_current_config(), water.dm_env.task
    r, fluid, glass = 0.033 * 0.55, config["fluid"], config["glass"]
    assert glass["glass_dis_x"] == pytest.approx(fluid["dim_x"] * r + 0.1)
    assert glass["poured_glass_dis_z"] == pytest.approx(fluid["dim_z"] * r + 0.07)
    assert glass["glass_distance"] == task.target.pose[0]
    assert config["target_amount"] == water._get_info()["target"]
    with pytest.raises(ReplacedError, match="dim_x"):
        _ = fluid["viscosity"]


@pytest.mark.parametrize(
    ("kwargs", "message"),
    [
        ({"observation_mode": "state"}, r"'key_point', 'point_cloud', 'cam_rgb'"),
        ({"action_mode": "sawyer"}, "action_mode='sawyer'.*softgym_mj.load"),
        ({"action_mode": ["picker"]}, "action_mode=.*'picker'"),
        ({"action_mode": "direct"}, "action_mode='direct'.*'picker'"),
        ({"num_variations": 0}, "num_variations=0"),
        ({"deterministic": "no"}, "deterministic='no'.*False, True"),
        ({"fps": 3}, "argument='fps'.*'num_picker', 'horizon', .*'headless'"),
        ({"picker_radius": 0.05}, "picker_radius=0.05.*0.02"),
    ],
)
def test_bad_arguments_name_the_choices(kwargs, message):
    with pytest.raises(InvalidArgumentError, match=message):
        make("RopeFlatten", **kwargs)


def test_drop_tasks_have_no_pick_and_place():
    for name in ("ClothDrop", "ClothFoldDrop"):
        with pytest.raises(InvalidArgumentError, match=r"action_mode='pickerpickplace'.*'picker'"):
            make(name, action_mode="pickerpickplace")


def test_a_variation_that_is_not_in_use_is_refused():
    env = make("RopeFlatten", num_variations=5)
    for index in (5, -1, 1.5):
        with pytest.raises(InvalidArgumentError, match=rf"config_id={index}.*0\.\.4"):
            env.reset(config_id=index)


# ---------------------------------------------------------------------- every row of the table


@functools.cache
def environments():
    """Of every kind, after an env step with pictures."""
    made = [
        make("PassWater"), make("PourWaterAmount"), make("RopeConfiguration"),
        make("RopeFlatten"), make("ClothFold"),
        make("ClothFlatten", action_mode="picker_qpg", num_picker=1, action_repeat=1),
    ]  # fmt: skip
    envs = [normalize(env) for env in made]
    for env in envs:
        env.reset()
    action = [np.zeros(env.action_space.shape) for env in envs]
    return [
        (e, e.step(a, record_continuous_video=True, img_size=16)[3])
        for e, a in zip(envs, action, strict=True)
    ]


@pytest.mark.parametrize(
    ("scale", "gray", "size"),
    [(1.0, False, (20, 30)), (0.5, False, (10, 15)), (1.0, True, (20, 30))],
)
def test_images_become_a_gif(tmp_path, scale, gray, size):
    levels = np.array([0, 100, 200], np.uint8)
    shape = (20, 30) if gray else (20, 30, 3)
    images = np.broadcast_to(levels.reshape(3, *len(shape) * [1]), (3, *shape))
    compat.save_numpy_as_gif(images, str(tmp_path / "film.mp4"), fps=25, scale=scale)
    film = imageio.imread(tmp_path / "film.gif", index=None)
    assert film.shape == (3, *size, 3)
    np.testing.assert_array_equal(film, np.broadcast_to(levels[:, None, None, None], film.shape))
    about = imageio.immeta(tmp_path / "film.gif")
    assert about["duration"] == 40 and about["loop"] == 0


@pytest.mark.parametrize(
    ("images", "settings", "named"),
    [
        (np.zeros((2, 8, 8, 4), np.uint8), {}, "array"),
        (np.zeros((0, 8, 8, 3), np.uint8), {}, "array"),
        ([1, 2], {}, "array"),
        (np.zeros((2, 8, 8), np.uint8), {"fps": 0}, "fps"),
        (np.zeros((2, 8, 8), np.uint8), {"scale": -1.0}, "scale"),
    ],
)
def test_what_is_no_gif_is_refused(tmp_path, images, settings, named):
    with pytest.raises(InvalidArgumentError, match=named):
        compat.save_numpy_as_gif(images, tmp_path / "film.gif", **settings)
    assert not list(tmp_path.iterdir())


def check_import(name):
    namespace: dict = {}
    exec(f"from softgym_mj.compat import {name}", namespace)
    return namespace[name]


def check_argument(name):
    other = {"picker_radius": 0.07, "camera_name": "cam_2d", "reward_type": "index"}
    env = make("RopeFlatten", **{name: other.get(name, env_arg_dict["RopeFlatten"].get(name, 1))})
    env.reset()


def check_action_mode(name):
    names = {"direct": "PassWater", "rotation_bottom": "PourWater"}
    pickers = 1 if name == "picker_qpg" else 2
    env = make(names.get(name, "ClothFold"), "key_point", name, num_picker=pickers,
               action_repeat=1)  # fmt: skip
    env.reset()
    env.step(env.action_space.sample())


def check_in_every(find, name):
    """Whether some environment has it; all that lack it raise alike."""
    errors = []
    for env, info in environments():
        try:
            return find(env, info, name)
        except ReplacedError as error:
            errors.append(error)
    raise errors[0]


def check_normalize(name):
    usual = {"scale_reward": 2.0, "clip": False, "clip_obs": (-1.0, 1.0)}
    normalize(make("RopeFlatten"), **{name: usual.get(name, 1)}).reset()


CHECKS = {
    "import": check_import,
    "environment": lambda name: (SOFTGYM_ENVS[name], env_arg_dict[name]),
    "action mode": check_action_mode,
    "observation mode": lambda name: make("RopeFlatten", name).reset(),
    "argument": check_argument,
    "normalize": check_normalize,
    "reset": lambda name: make("RopeFlatten").reset(**{name: {}}),
    "member": lambda name: check_in_every(lambda env, info, name: getattr(env, name), name),
    "info key": lambda name: check_in_every(lambda env, info, name: compat.Table(info)[name], name),
    "config key": lambda name: check_in_every(
        lambda env, info, name: env.get_current_config()[name], name
    ),
}  # fmt: skip
REFUSALS = (ReplacedError, InvalidArgumentError, UnavailableError)


@pytest.mark.parametrize("row", ROWS, ids=lambda row: f"{row[0]}: {row[1][0]}")
def test_the_row_is_true(row):
    kind, names, here, how = row
    for name in names:
        if here == "refused":
            with pytest.raises(REFUSALS) as refusal:
                CHECKS[kind](name)
            assert how in str(refusal.value), name
            if kind == "member":
                assert not any(hasattr(env, name) for env, _ in environments())
        else:
            CHECKS[kind](name)


def test_the_table_lists_all_that_there_is():
    listed = {(kind, name) for kind, names, *_ in ROWS for name in names}
    assert {kind for kind, _ in listed} == set(CHECKS)
    names = {name for _, name in listed}
    from softgym_mj.compat import names as own

    assert set(own.REPLACED) <= names
    assert {("argument", key) for key in (*own.DEFAULTS, *own.FIXED, *own.IGNORED)} <= listed
    assert {("info key", key) for key in own.INFO} <= listed
    assert {("environment", key) for key in SOFTGYM_ENVS} <= listed
    assert {("observation mode", key) for key in own.OBSERVATION_MODES} <= listed
    public = {name for name in dir(compat.OldEnv) if not name.startswith("_")}
    env = environments()[0][0]._wrapped_env
    public |= {name for name in vars(env) if not name.startswith("_")} - {"dm_env"}
    assert {("member", name) for name in public} <= listed
