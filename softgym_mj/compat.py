"""A thin shim with SoftGym's old names and call signatures, so that old training scripts run.

    env = softgym_mj.compat.make("ClothFlatten", observation_mode="key_point", num_variations=1000)
    observation = env.reset(config_id=3)
    observation, reward, done, info = env.step(env.action_space.sample())

Actions and positions are in SoftGym's axes (x, y up, z), actions normalised to [-1, 1], and clipped
to it, as by its `normalize` wrapper. Tasks, rewards and bounds are this package's:
docs/migration.md lists where they differ.
"""

import inspect
from collections.abc import Mapping
from typing import Any

import gymnasium
import numpy as np

from softgym_mj import registry
from softgym_mj.envs.environment import Environment, Snapshot
from softgym_mj.envs.load import load
from softgym_mj.exceptions import InvalidArgumentError, check_count, check_name
from softgym_mj.kinds import typed
from softgym_mj.rendering.offscreen import CameraView
from softgym_mj.variations.indices import NUM_VARIATIONS

OBSERVATION_MODES = {"key_point": "reduced", "point_cloud": "full", "cam_rgb": "rgb"}
ACTION_MODES = {
    None: None, "picker": "picker", "pickerpickplace": "pick_and_place", "direct": "cup",
    "rotation_bottom": "cup",
}  # fmt: skip
# Of SoftGym, without meaning here: rendering is off-screen, states are generated when needed.
IGNORED = (
    "render", "headless", "render_mode", "camera_name", "use_cached_states", "save_cached_states",
    "cached_states_path", "device_id", "delta_reward", "env_name",
)  # fmt: skip
TRAIN_SHARE = 0.8


def names() -> dict[str, str]:
    """SoftGym's names of the tasks: ours by theirs."""
    classes = {name: record.resolve() for name, record in registry.TASKS.items()}
    return {c.softgym_name: name for name, c in classes.items() if c.softgym_name is not None}


@typed
def make(
    name: str,
    observation_mode: str = "cam_rgb",
    action_mode: str | None = None,
    num_variations: int = NUM_VARIATIONS,
    *,
    horizon: int | None = None,
    action_repeat: int | None = None,
    num_picker: int = 2,
    camera_height: int = 128,
    camera_width: int = 128,
    deterministic: bool = False,
    eval_flag: bool = False,
    **ignored: Any,
) -> "OldEnv":
    """Builds an environment by its SoftGym name.

    Args:
        name: one of `names`.
        observation_mode: "key_point", "point_cloud" or "cam_rgb".
        action_mode: "picker" or "pickerpickplace" for cloth and rope, "direct" or
            "rotation_bottom" for water; None for the usual one.
        num_variations: variations in use, 1..1000; the last fifth is for evaluation.
        horizon: env steps in an episode; None for the task's own.
        action_repeat: sim steps per env step; None for the task's own.
        num_picker: number of pickers.
        camera_height, camera_width: of image observations [pixels].
        deterministic: always starts with the first variation of the split.
        eval_flag: whether resets draw from the evaluation variations.
        **ignored: `IGNORED` arguments of SoftGym.

    Raises:
        InvalidArgumentError: for a bad name or value.
    """
    ours = names()
    check_name("name", name, ours)
    check_name("observation_mode", observation_mode, OBSERVATION_MODES)
    check_name("action_mode", action_mode, ACTION_MODES)
    check_count("num_variations", num_variations, 1, NUM_VARIATIONS)
    for argument in ignored:
        if argument not in IGNORED:
            own = [key for key in inspect.signature(make).parameters if key != "ignored"]
            raise InvalidArgumentError("argument", argument, (*own, *IGNORED))
    settings: dict[str, Any] = {
        "actor": ACTION_MODES[action_mode],
        "observation": OBSERVATION_MODES[observation_mode],
        "image_size": (camera_height, camera_width),
        "action_repeat": action_repeat,
    }
    if "num_pickers" in registry.TASKS[ours[name]].arguments:
        settings["num_pickers"] = num_picker
    env = load(ours[name], split=range(num_variations), horizon=horizon, **settings)
    return OldEnv(env, deterministic, eval_flag)


def to_flex(vectors: np.ndarray) -> np.ndarray:
    """Vectors (..., 3) in SoftGym's axes: x, y = up, z."""
    return np.stack([vectors[..., 0], vectors[..., 2], -vectors[..., 1]], axis=-1)


def from_flex(vectors: np.ndarray) -> np.ndarray:
    """Vectors (..., 3) of SoftGym's axes in ours: X, Y, Z = up."""
    return np.stack([vectors[..., 0], -vectors[..., 2], vectors[..., 1]], axis=-1)


class OldEnv:
    """An environment with SoftGym's methods. Attributes:

    dm_env: the environment underneath, in this package's own terms.
    horizon: env steps in an episode.
    action_space, observation_space: Gymnasium boxes.
    eval_flag: whether resets draw from the evaluation variations; may be set.
    """

    def __init__(self, env: Environment, deterministic: bool, eval_flag: bool):
        """Wraps an environment with one observation; see `make`."""
        self.dm_env, self.eval_flag, self._deterministic = env, eval_flag, deterministic
        self._water = env.task.material == "water"
        self._random = np.random.default_rng()
        self.horizon = env.horizon
        size = env.task.actor.action_size
        self.action_space = gymnasium.spaces.Box(-1.0, 1.0, (size,), np.float32)
        ((self._observed, spec),) = env.observation_spec().items()
        image = spec.dtype == np.uint8
        low, high = (0, 255) if image else (-np.inf, np.inf)
        dtype = np.uint8 if image else np.float32
        self.observation_space = gymnasium.spaces.Box(low, high, spec.shape, dtype)

    @property
    def current_config_id(self) -> int:
        """Index of the current variation."""
        return self.dm_env.task.variation

    def seed(self, seed: int | None = None) -> None:
        """Seeds the draw of variations and of `action_space`."""
        self._random = np.random.default_rng(seed)
        self.action_space.seed(seed)

    def reset(self, config_id: int | None = None) -> np.ndarray:
        """Starts an episode with a variation, or a drawn one; returns the observation (n,)."""
        number = len(self.dm_env.variations)
        if config_id is None:
            config_id = self._draw(number)
        elif not 0 <= check_count("config_id", config_id, 0) < number:
            raise InvalidArgumentError("config_id", config_id, f"0..{number - 1}")
        return self._convert(self.dm_env.reset(config_id).observation)

    def _draw(self, number: int) -> int:
        first = int(TRAIN_SHARE * number)
        low, high = (first, number) if self.eval_flag else (0, first)
        return low if self._deterministic else int(self._random.integers(low, max(high, low + 1)))

    def step(self, action: np.ndarray) -> tuple[np.ndarray, float, bool, dict]:
        """Applies a normalised action (n,); returns observation (m,), reward, done and info.

        What is outside [-1, 1] is clipped, as SoftGym's `NormalizedEnv` does by default.

        Raises:
            InvalidArgumentError: for a wrong shape or NaN.
        """
        action = np.clip(np.asarray(action, float), -1.0, 1.0)
        if not self._water and action.shape == self.action_space.shape:
            parts = action.reshape(-1, 4)
            action = np.column_stack([from_flex(parts[:, :3]), parts[:, 3]]).ravel()
        timestep = self.dm_env.step(action)
        observation = self._convert(timestep.observation)
        return observation, float(timestep.reward), bool(timestep.last()), self.dm_env.info()

    def compute_reward(self) -> float:
        """Reward of the current state."""
        return self.dm_env.task.last_evaluation.reward

    def get_image(self, width: int = 720, height: int = 720) -> np.ndarray:
        """The task camera's image (height, width, 3) uint8."""
        return CameraView("task", height, width).rgb(self.dm_env.physics)

    def render(self, mode: str = "rgb_array") -> np.ndarray:
        """The task camera's image (720, 720, 3) uint8."""
        check_name("mode", mode, ("rgb_array",))
        return self.get_image()

    def get_state(self) -> Snapshot:
        """A snapshot, exact: SoftGym's forgets what is held."""
        return self.dm_env.get_state()

    def set_state(self, state: Snapshot) -> None:
        """Restores a snapshot."""
        self.dm_env.set_state(state)

    def close(self) -> None:
        """Frees the simulation."""
        self.dm_env.close()

    def _convert(self, observation: Mapping[str, np.ndarray]) -> np.ndarray:
        value = observation[self._observed]
        if value.dtype == np.uint8:
            return value
        if not self._water:  # All of it is positions.
            value = to_flex(value.reshape(-1, 3)).ravel()
        elif self._observed == "full":
            count = 3 * self.dm_env.task.max_points
            value = np.concatenate([to_flex(value[:count].reshape(-1, 3)).ravel(), value[count:]])
        return value.astype(np.float32)
