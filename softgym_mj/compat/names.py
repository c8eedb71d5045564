"""Names of SoftGym that are replaced here, and settings that have a single value."""

from collections.abc import Iterable, Mapping
from typing import Any

from softgym_mj.exceptions import InvalidArgumentError, SoftGymError

# Replacements by SoftGym's names; for other attributes of an environment it is `dm_env.task`.
_USES = {
    "reset(config_id=i); for other sizes a task of your own": "config config_variations "
    "config_variations initial_state get_default_config get_config set_scene "
    "generate_env_variation",
    "reset(config_id=i), then get_current_config() and get_state()": "cached_configs "
    "cached_init_states get_cached_configs_and_states",
    "get_current_config()": "current_config",
    "get_camera_params(), and the view of a task of your own": "camera_params initialize_camera "
    "update_camera",
    "softgym_mj.rendering.offscreen.CameraView": "camera_name",
    "start_record() and end_record(path)": "record_video video_path video_name "
    "video_height video_width set_video_recording_params",
    "softgym_mj.rendering.offscreen.Video": "make_grid",
    "dm_env.task.goal_image(dm_env.physics)": "goal_character_img goal_characters_image "
    "generate_alphabet_image",
    "dm_env.task.actor, with held, positions() and limits": "action_tool get_picked_particle",
    "dm_env.task.points()": "particle_num",
    "dm_env.task.bounds": "reward_range reward_min reward_max",
    "dm_env.control_timestep()": "dt",
    "numpy.random": "rand_float rand_int",
    "gymnasium.make": "metadata spec unwrapped",
    "an actor of your own": "picker_radius picker_threshold Picker PickerPickPlace PickerQPG "
    "ActionToolBase",
    "fidelity of softgym_mj.load": "particle_radius",
    "matching='vertices' of softgym_mj.load": "reward_type",
    "action_mode='picker'": "sphere",
    "action_mode='picker_qpg'": "MVPWrapper",
    "action_mode='rotation_bottom', which makes the same motions": "rotation_top",
    "actor='sawyer' of softgym_mj.load": "sawyer",
    "actor='franka' of softgym_mj.load": "franka",
    "observation_mode='cam_rgb'": "ImageEnv",
    "observation_mode='point_cloud'": "PassWaterGoal PourWaterGoal ClothManipulate",
    "observation='point_cloud' of softgym_mj.load": "get_world_coords",
    "gymnasium.wrappers.NormalizeObservation": "normalize_obs obs_alpha",
    "gymnasium.wrappers.NormalizeReward": "normalize_reward reward_alpha",
    "SOFTGYM_ENVS": "PassWater1DEnv PourWaterPosControlEnv PourWaterAmountPosControlEnv "
    "RopeFlattenEnv RopeConfigurationEnv ClothFlattenEnv ClothFoldEnv ClothDropEnv "
    "ClothFoldCrumpledEnv ClothFoldDropEnv FlexEnv ClothEnv FluidEnv RopeNewEnv "
    "register_flex_envs",
    "dm_env.task.scene": "ClothPos ClothStiff flip_mesh target_pos init_pos stretchstiffness "
    "bendingstiffness radius mass scale env_idx target_height",
    "render() of an environment, for depth CameraView('task', height, width).depth("
    "dm_env.physics), for states dm_env.task.scene": "pyflex",
    "dm_env.task.scene and dm_env.physics of an environment": "center_object random_pick_and_place",
}
REPLACED = {name: use for use, names in _USES.items() for name in names.split()}
OTHER_ACTION_MODES = ("sphere", "sawyer", "franka", "rotation_top")
DEFAULTS = {  # Keyword arguments; None is the task's default.
    "num_picker": 2, "horizon": None, "action_repeat": None, "num_variations": 1,
    "camera_width": 720, "camera_height": 720, "deterministic": True,
}  # fmt: skip
FIXED = {  # Keyword arguments that have a single value here.
    "camera_name": "default_camera", "config": None, "particle_radius": 0.00625,
    "picker_threshold": 0.005, "reward_type": "bigraph",
}  # fmt: skip
# Keyword arguments without effect: rendering is off-screen, states are generated when needed. The
# last two are SoftAgent's; SoftGym ignores them, too.
IGNORED = (
    "render", "headless", "render_mode", "use_cached_states", "save_cached_states",
    "cached_states_path", "device_id", "delta_reward", "env_name",
)  # fmt: skip
INFO = {  # Info keys by SoftGym's keys, and a factor.
    "out_water": ("spilled", 1.0), "target": ("share", 1.0), "total_steps": ("sim_steps", 1),
    "neg_group_dist": ("pair_distance", -1.0), "neg_fixation_dist": ("displacement", -1.0),
}  # fmt: skip
OBSERVATION_MODES = {"key_point": "reduced", "point_cloud": "full", "cam_rgb": "rgb"}


class ReplacedError(SoftGymError, AttributeError):
    """Name of SoftGym that this package replaces; the message names the replacement."""

    def __str__(self) -> str:
        return "SoftGym's {!r} is not here; use {}.".format(*self.args)


class Table(dict[str, Any]):
    """Dict with SoftGym's names as keys; the error for a missing key names its replacement."""

    def __missing__(self, key: str) -> Any:
        raise ReplacedError(key, REPLACED.get(key, f"one of {', '.join(self)}"))


def check_settings(given: Mapping[str, Any], own: Iterable[str], fixed: Mapping[str, Any]) -> None:
    """Raises `InvalidArgumentError` for names in neither `own` nor `fixed`, or other values."""
    for key, value in given.items():
        if key not in (*own, *fixed):
            raise InvalidArgumentError("argument", key, (*own, *fixed))
        if key in fixed and value != fixed[key]:
            valid = f"{fixed[key]!r}; for others use {REPLACED[key]}"
            raise InvalidArgumentError(key, value, valid)
