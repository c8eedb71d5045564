"""`OldEnv`: an environment with SoftGym's interface."""

import math
import pathlib
from collections.abc import Callable, Mapping
from typing import Any, NoReturn

import gymnasium
import numpy as np

from softgym_mj import registry
from softgym_mj.compat import names
from softgym_mj.compat.actions import ACTION_MODES, MODES_OF, checked, to_flex
from softgym_mj.compat.cameras import CAMERAS
from softgym_mj.compat.names import ReplacedError, Table, check_settings
from softgym_mj.envs.clipping import Clipping
from softgym_mj.envs.load import load
from softgym_mj.envs.snapshots import Snapshot
from softgym_mj.exceptions import InvalidArgumentError, LifecycleError, check_count, check_name
from softgym_mj.rendering.offscreen import CameraView, Video
from softgym_mj.tasks.rope_configuration import goal_name
from softgym_mj.variations.indices import NUM_VARIATIONS

TRAIN_SHARE = 0.8  # Share of the variations for training; the others are for evaluation.
UNLIMITED = 10**9  # Horizon in env steps: SoftGym continues after an episode is done.
RECORDS = registry.by_softgym_name()


def _of_cloth(task: Any) -> dict[str, Any]:
    return {"ClothSize": list(task.cloth.dims), "flatten_area": math.prod(task.cloth.size)}


def _of_rope(task: Any) -> dict[str, Any]:
    result: dict[str, Any] = {"segment": task.rope.num_points - 1}
    for points in task.episode.goal.values():
        result["goal_character"] = goal_name(task.variation)
        result["goal_character_pos"] = to_flex(points)
    return result


def _of_water(task: Any) -> dict[str, Any]:
    cups, goal = task.start.variation(task.variation), task.episode.goal
    glass = {"glass_distance": cups.distance}
    for prefix, size in zip(("", "poured_"), cups.cups, strict=False):
        glass |= {f"{prefix}border": size.wall, f"{prefix}height": size.height}
        glass |= {f"{prefix}glass_dis_x": size.length, f"{prefix}glass_dis_z": size.width}
    fluid = {f"dim_{axis}": getattr(cups.sample, f"d{axis}") for axis in "xyz"}
    amount = {"target_amount": float(goal["share"])} if goal else {}
    return {"fluid": Table(fluid), "glass": Table(glass), **amount}


CONFIGS: dict[str, Callable[[Any], dict[str, Any]]] = {
    "cloth": _of_cloth, "rope": _of_rope, "water": _of_water
}  # fmt: skip


class OldEnv:
    """Environment with SoftGym's interface.

    Keyword arguments are attributes, too.

    Attributes:
        dm_env: The wrapped environment of this package.
        action_space, observation_space: Gymnasium boxes; actions are in SoftGym's units.
        eval_flag: Whether resets draw from the evaluation variations; may be set.
        recording, video_frames: Whether a video is being recorded, and its images.
    """

    def __init__(self, /, name: str, observation_mode: str, action_mode: str, **settings: Any):
        """Builds the environment.

        Args:
            name: One of `MODES_OF`.
            observation_mode: One of `OBSERVATION_MODES`.
            action_mode: One of `MODES_OF[name]`.
            **settings: SoftGym's settings; docs/migration.md lists them.

        Raises:
            InvalidArgumentError: for a bad name or value; the message names the replacement.
        """
        check_name("name", name, MODES_OF)
        check_name("observation_mode", observation_mode, names.OBSERVATION_MODES)
        if action_mode in names.OTHER_ACTION_MODES:
            raise InvalidArgumentError("action_mode", action_mode, names.REPLACED[action_mode])
        check_name("action_mode", action_mode, MODES_OF[name])
        radius = {"picker_radius": 0.02 if name.startswith("Rope") else 0.05}
        check_settings(settings, (*names.DEFAULTS, *names.IGNORED), names.FIXED | radius)
        settings = names.DEFAULTS | settings
        check_count("num_variations", settings["num_variations"], 1, NUM_VARIATIONS)
        if settings["deterministic"] not in (False, True):
            raise InvalidArgumentError("deterministic", settings["deterministic"], (False, True))
        record, self._mode = RECORDS[name], ACTION_MODES[action_mode]
        goal = ("goal_rgb",) if (name, observation_mode) == ("RopeConfiguration", "cam_rgb") else ()
        pickers = {"num_pickers": settings["num_picker"]}
        self.dm_env = load(
            record, split=range(settings["num_variations"]), actor=self._mode.actor,
            observation=(names.OBSERVATION_MODES[observation_mode], *goal),
            image_size=(settings["camera_height"], settings["camera_width"]),
            goal_marks=name == "PourWaterAmount",  # SoftGym draws the red line in all images.
            horizon=settings["horizon"], action_repeat=settings["action_repeat"],
            **(pickers if "num_pickers" in record.arguments else {}),
        )  # fmt: skip
        self.dm_env.add_extra_hook("after_substep", self._watch)
        self._task: Any = self.dm_env.task
        arena, pose = self._task.root_entity, CAMERAS[record.name]
        camera = self.dm_env.physics.bind(arena.place("task", pose))  # The model is compiled.
        camera.pos, camera.quat, camera.fovy = pose.position, pose.quaternion, pose.field_of_view
        if self._mode.workspace is not None:
            self._task.workspace = self._mode.workspace
        settings |= {"horizon": self.dm_env.horizon, "action_repeat": self._task.action_repeat}
        self.dm_env.horizon = UNLIMITED
        vars(self).update({key: settings[key] for key in names.DEFAULTS})
        self.observation_mode, self.action_mode = observation_mode, action_mode
        self.camera_name = names.FIXED["camera_name"]
        self.eval_flag = self.recording = False
        self.video_frames: list[np.ndarray] = []
        self._frames: list[np.ndarray] | None = None
        self._views: dict[tuple[int, int], CameraView] = {}
        self._random: Any = np.random  # NumPy's global generator, as in SoftGym, until `seed`.
        times = self._task.actor.action_size // len(self._mode.low)
        low, high = (np.tile(end, times).astype(np.float32) for end in self._mode[1:3])
        self.action_space = gymnasium.spaces.Box(low, high)
        self._clipped = Clipping(self.action_space)
        specs = self.dm_env.observation_spec().items()
        seen = self._convert({key: spec.generate_value() for key, spec in specs})
        dtype, image = seen.dtype, seen.dtype == np.uint8
        ends = (0.0, 255.0) if image else (-np.inf, np.inf)
        self.observation_space = gymnasium.spaces.Box(ends[0], ends[1], seen.shape, dtype=dtype)

    def __getattr__(self, name: str) -> Any:
        raise ReplacedError(name, names.REPLACED.get(name, "dm_env.task; see docs/migration.md"))

    @property
    def current_config_id(self) -> int:
        """Index of the current variation."""
        return self._task.variation

    @property
    def time_step(self) -> int:
        """Env steps since the reset."""
        return self.dm_env.step_count

    def get_camera_params(self) -> tuple[np.ndarray, np.ndarray]:
        """Returns position (3,) [m] and angles (yaw, pitch, 0) [rad] of the camera."""
        model, data = self.dm_env.physics.model.ptr, self.dm_env.physics.data.ptr
        camera = model.camera("task").id
        right, _, back = to_flex(data.cam_xmat[camera].reshape(3, 3).T)
        pitch = math.asin(np.clip(-back[1], -1.0, 1.0))
        angles = np.array([math.atan2(-right[2], right[0]), pitch, 0.0])
        return to_flex(data.cam_xpos[camera]), angles

    def get_current_config(self) -> Table:
        """Returns the parameters of the current variation by SoftGym's keys."""
        pos, angle = self.get_camera_params()
        camera = {"width": self.camera_width, "height": self.camera_height}
        return Table(
            **CONFIGS[self._task.material](self._task),
            camera_name=self.camera_name,
            camera_params={self.camera_name: {"pos": pos, "angle": angle, **camera}},
        )

    def seed(self, seed: int | None = None) -> None:
        """Seeds the draw of variations and of `action_space`.

        Raises:
            InvalidArgumentError: unless the seed is a non-negative integer or None.
        """
        if seed is not None:
            check_count("seed", seed, 0)
        self._random = np.random.default_rng(seed)
        self.action_space.seed(seed)

    def reset(
        self, config: None = None, initial_state: None = None, config_id: int | None = None
    ) -> np.ndarray:
        """Starts an episode with a given or random variation; returns the observation (n,).

        Raises:
            InvalidArgumentError: for an invalid index, or an argument `config` or state.
        """
        for name, value in (("config", config), ("initial_state", initial_state)):
            if value is not None:
                raise InvalidArgumentError(name, value, f"None; use {names.REPLACED[name]}")
        number = self.num_variations
        first = int(TRAIN_SHARE * number)
        low, high = (first, number) if self.eval_flag else (0, max(first, 1))
        if config_id is None:
            config_id = low if self.deterministic else low + int(self._random.choice(high - low))
        index = check_count("config_id", config_id, 0, number - 1)
        observation = self._convert(self.dm_env.reset(index).observation)
        if self.recording:
            self.video_frames.append(self.render())
        return observation

    def step(
        self, action: np.ndarray, record_continuous_video: bool = False, img_size: int | None = None
    ) -> tuple[np.ndarray, float, bool, dict]:
        """Applies an action (n,); returns observation (m,), reward, done and info.

        Args:
            action: Action of `action_space`; others are clipped, with a warning the first time.
            record_continuous_video: Whether info has "flex_env_recorded_frames", an image of every
                second sim step.
            img_size: Side of these images [pixels]; None for the camera's.

        Raises:
            InvalidArgumentError: for a wrong shape, NaN or infinity.
            LifecycleError: before the first reset, and after a step in which the simulation
                diverged; that step returns done.
        """
        if self.dm_env.current_variation is None:
            raise LifecycleError("no episode has started: call reset() first")
        if self.dm_env.diverged:
            raise LifecycleError("the simulation has diverged: call reset() first")
        raw = checked(self._clipped(action), self.action_space)
        low, high = (end.astype(float) for end in (self.action_space.low, self.action_space.high))
        part = np.clip(2.0 * (raw - low) / (high - low) - 1.0, -1.0, 1.0)
        sides = self.camera_width, self.camera_height
        self._frame_size = sides if img_size is None else (img_size, img_size)
        self._frames, self._sim_steps = [] if record_continuous_video else None, 0
        timestep = self.dm_env.step(self._mode.ours(self._task.actor, raw, part))
        info = self._get_info()
        if self._frames is not None:
            info["flex_env_recorded_frames"] = self._frames
        if self.recording:
            self.video_frames.append(self.render())
        done = self.time_step >= self.horizon or self.dm_env.diverged
        return self._convert(timestep.observation), float(timestep.reward), done, info

    def _watch(self, physics: Any, random_state: np.random.RandomState) -> None:
        """Renders images after sim steps, which are one physics step in all tasks."""
        if self.dm_env.is_rehearsing:
            return
        self._sim_steps += 1
        if self._frames is not None and self._sim_steps % 2:
            self._frames.append(self.get_image(*self._frame_size))
        if self.recording and self._task.actor.sim_steps is not None:
            self.video_frames.append(self.render())

    def _get_obs(self) -> np.ndarray:
        return self._convert(self.dm_env.observation())

    def _get_info(self) -> dict[str, Any]:
        info: dict[str, Any] = self.dm_env.info()
        theirs = names.INFO.items()
        return info | {key: k * info[own] for key, (own, k) in theirs if own in info}

    def compute_reward(self, *args: object, **kwargs: object) -> float:
        """Returns the reward of the current state; arguments are ignored, as in SoftGym."""
        return self._task.last_evaluation.reward

    def get_image(self, width: int = 720, height: int = 720) -> np.ndarray:
        """Returns the camera's image (height, width, 3) uint8, as in observations."""
        new = CameraView("task", height, width, marks=self._task.goal_marks)
        view = self._views.setdefault((width, height), new)
        return view.rgb(self.dm_env.physics)

    def render(self, mode: str = "rgb_array") -> np.ndarray:
        """Returns the camera's image (camera_height, camera_width, 3) uint8."""
        check_name("mode", mode, ("rgb_array",))
        return self.get_image(self.camera_width, self.camera_height)

    def start_record(self) -> None:
        """Starts a video of resets and env steps, or of sim steps for pick and place."""
        self.video_frames, self.recording = [], True

    def end_record(self, video_path: str | pathlib.Path | None = None, fps: float = 20) -> None:
        """Ends the video and writes it as mp4; the suffix of the path is replaced.

        Raises:
            LifecycleError: if no video has been started.
        """
        if not self.recording:
            raise LifecycleError("no video has been started: call start_record() first")
        self.recording = False
        if video_path is not None:
            file = pathlib.Path(video_path).with_suffix(".mp4")
            Video(np.array(self.video_frames), fps).write(file)

    def get_state(self) -> Snapshot:
        """Returns an exact snapshot; SoftGym's omits held particles."""
        return self.dm_env.get_state()

    def set_state(self, state: Snapshot) -> None:
        """Restores a snapshot."""
        self.dm_env.set_state(state)

    def __reduce__(self) -> NoReturn:
        raise LifecycleError(
            "an environment of SoftGym's interface cannot be copied or pickled: "
            "make another one and use other.set_state(env.get_state())"
        )

    def close(self) -> None:
        """Frees the simulation."""
        self.dm_env.close()

    def _convert(self, observation: Mapping[str, np.ndarray]) -> np.ndarray:
        """Converts an observation to axes with y up; several images become channels of one."""
        value = np.concatenate([*observation.values()], axis=-1)
        if value.dtype == np.uint8:
            return value
        count = len(value)  # Number of entries that are positions.
        if self._task.material == "water":
            count = 3 * self._task.max_points if "full" in observation else 0
        turned = to_flex(value[:count].reshape(-1, 3)).ravel()
        return np.concatenate([turned, value[count:]]).astype(np.float32)
