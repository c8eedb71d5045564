"""`SoftGymEnv`: a Gymnasium environment over `Environment`."""

import copy
from collections.abc import Callable, Mapping, Sequence
from typing import Any

import gymnasium
import numpy as np
from dm_env import specs
from gymnasium import logger
from gymnasium.envs.registration import EnvSpec
from gymnasium.utils import EzPickle

from softgym_mj import registry
from softgym_mj.envs.clipping import Clipping
from softgym_mj.envs.load import load
from softgym_mj.envs.resets import check_known, checked_options, checked_state, draw_variation
from softgym_mj.envs.snapshots import Snapshot
from softgym_mj.exceptions import (
    LifecycleError,
    UnexpectedArgumentError,
    check_count,
    check_image_size,
    check_name,
)
from softgym_mj.rendering.offscreen import LARGEST_IMAGE, CameraView, camera_ids
from softgym_mj.validation import check_type

# Attributes copied in addition to the arguments and the state of the episode.
_COPIED = ("_np_random", "_np_random_seed", "action_space", "observation_space", "_spec")


def check_arguments(
    task: str | registry.TaskRecord, arguments: Mapping[str, object], *callers: Callable
) -> registry.TaskRecord:
    """Returns the record of a task, after a check of arguments of its `SoftGymEnv`.

    Args:
        task: task name, or a record.
        arguments: keyword arguments.
        *callers: functions whose optional arguments are accepted in addition.

    Raises:
        UnexpectedArgumentError, InvalidArgumentError: as in `TaskRecord.check_arguments`.
    """
    if "random_state" in arguments:
        raise UnexpectedArgumentError(
            "SoftGymEnv got an unexpected keyword argument 'random_state': seed it by "
            "reset(seed=...)."
        )
    record = registry.find(task)
    record.check_arguments(arguments, SoftGymEnv, *callers)
    return record


def space_of(spec: specs.Array) -> gymnasium.spaces.Box:
    """Returns the Gymnasium space of a dm_env observation: uint8 stays, others become float32."""
    if spec.dtype == np.uint8:
        return gymnasium.spaces.Box(0, 255, spec.shape, np.uint8)
    return gymnasium.spaces.Box(-np.inf, np.inf, spec.shape, np.float32)


class SoftGymEnv(gymnasium.Env, EzPickle):
    """A task as a Gymnasium environment.

    Actions: Box(-1, 1, (n,), float32), with n of the actor. Observations: a float32 or uint8 Box
    for one observation, a Dict for several, in alphabetical order as in Gymnasium's spaces. An
    episode is truncated after `horizon` env steps and terminates only if the simulation diverges
    (`info["diverged"]`). `info` is `Environment.info` with bools as arrays of shape (). If images
    or points are observed, its "cameras" maps the names of their cameras to "intrinsics" and
    "extrinsics", as in `Calibration`. A copy or a pickle continues the episode.

    Attributes:
        dm_env: the underlying dm_control environment.
        clip_actions: whether actions outside [-1, 1] are clipped; else they are rejected.
    """

    _spec: EnvSpec | None = None
    metadata = {"render_modes": ["rgb_array", "depth_array"], "render_fps": 12.5}  # noqa: RUF012

    def __init__(
        self,
        /,  # A keyword argument "self" is rejected by name.
        task: str | registry.TaskRecord,
        render_mode: str | None = None,
        *,
        render_size: tuple[int, int] = (480, 480),
        camera: str = "task",
        split: str | Sequence[int] = "train",
        horizon: int | None = None,
        clip_actions: bool = True,
        **task_kwargs: Any,
    ):
        """Builds the environment.

        Args:
            task: task name, or a record.
            render_mode: None, "rgb_array" (uint8) or "depth_array" (float32, meters).
            render_size: (height, width) of `render` [pixels].
            camera: camera of `render`: "task", "overview", "wrist_0" on the hand of an arm or
                another camera of the model (`rendering.camera_ids`).
            split: "train", "evaluate", "all" or a sequence of variation indices.
            horizon: env steps in an episode; None for the task's own.
            clip_actions: whether actions outside [-1, 1] are clipped, with a warning the first
                time; else they are rejected.
            **task_kwargs: keyword arguments of the task, such as `observation` or `actor`.
        """
        check_arguments(task, task_kwargs)
        EzPickle.__init__(
            self, task, render_mode, render_size=render_size, camera=camera, split=split,
            horizon=horizon, clip_actions=clip_actions, **task_kwargs,
        )  # fmt: skip
        check_name("render_mode", render_mode, (None, *self.metadata["render_modes"]))
        self.render_mode = render_mode
        check_image_size("render_size", render_size, LARGEST_IMAGE)
        self.dm_env = load(task, split=split, horizon=horizon, **task_kwargs)
        check_name("camera", camera, camera_ids(self.dm_env.physics.model.ptr))
        self._view = CameraView(camera, *render_size)
        self._closed = False
        self.metadata = {**self.metadata, "render_fps": round(self.dm_env.frame_rate, 3)}
        spaces: dict[str, gymnasium.Space] = {
            name: space_of(spec) for name, spec in self.dm_env.observation_spec().items()
        }
        self.observation_space = (
            gymnasium.spaces.Dict(spaces) if len(spaces) > 1 else next(iter(spaces.values()))
        )
        size = self.dm_env.task.actor.action_size
        self.action_space = gymnasium.spaces.Box(-1.0, 1.0, (size,), np.float32)
        check_type("clip_actions", clip_actions, bool)
        self.clip_actions = clip_actions
        self._clipped = Clipping(self.action_space)

    @property
    def horizon(self) -> int:
        """Env steps after which an episode is truncated."""
        return self.dm_env.horizon

    @property
    def spec(self) -> EnvSpec | None:
        """Gymnasium's specification; `max_episode_steps` is this environment's horizon."""
        return self._spec

    @spec.setter
    def spec(self, spec: EnvSpec | None) -> None:
        self._spec = copy.copy(spec)
        if self._spec is not None:
            self._spec.max_episode_steps = self.horizon

    def reset(self, *, seed: int | None = None, options: dict[str, Any] | None = None):
        """Starts an episode.

        Args:
            seed: seed of the generator that draws variations. The `random_state` that composer
                passes to hooks of a custom task depends on the variation alone.
            options: {"variation": index 0..999} instead of a draw from the split; or {"state":
                state}, which continues an episode as `set_state` does, but counts as a reset for
                wrappers: a new environment of `gymnasium.make` requires one before a step.

        Returns:
            Observation and info.

        Raises:
            InvalidArgumentError: for an unknown option; for a variation that does not exist; for a
                variation or a seed together with a state.
            SnapshotError: for a bad state.
            LifecycleError: after `close()`, as in all methods but `close()`.
        """
        self._check_open()
        options = checked_options(options)
        check_known(seed, options)
        if "state" in options:
            return self.set_state(options["state"])
        super().reset(seed=None if seed is None else check_count("seed", seed, 0))
        variation = options.get("variation")
        if variation is None:
            variation = draw_variation(self.np_random, self.dm_env.variations)
        self.dm_env.seed_hooks(variation)  # As in the workers of `VectorEnv`, which get no seeds.
        timestep = self.dm_env.reset(variation)
        return self._convert(timestep.observation), self._info()

    def step(self, action: np.ndarray):
        """Applies an action (n,) in [-1, 1]; others are clipped, unless `clip_actions` is False.

        Returns:
            Observation, reward, terminated (whether the simulation diverged), truncated, info.

        Raises:
            LifecycleError: if no episode is running.
            InvalidArgumentError: for a bad action.
        """
        self._check_open()
        if self.clip_actions:
            action = self._clipped(action)
        if not self.dm_env.is_running:
            raise LifecycleError("no episode is running: call reset() before step()")
        timestep = self.dm_env.step(action)
        ended = timestep.last()
        terminated = bool(ended and timestep.discount == 0.0)
        observation = self._convert(timestep.observation)
        truncated = ended and not terminated
        return observation, float(timestep.reward), terminated, truncated, self._info()

    def _info(self) -> dict[str, Any]:
        info: dict[str, Any] = self.dm_env.info()
        # Gymnasium's vector environments turn NumPy's bools into objects, but not arrays of bool.
        info |= {k: np.asarray(v) for k, v in info.items() if isinstance(v, np.bool_)}
        if cameras := self.dm_env.cameras():
            info["cameras"] = {name: {**vars(camera)} for name, camera in cameras.items()}
        return info

    def shorten(self, share: float) -> None:
        """Shortens the current episode by a share of the horizon below 1."""
        self.dm_env.step_count += int(share * self.horizon)

    def render(self) -> np.ndarray | None:
        """Returns an image (height, width, 3) uint8, depths (height, width) float32 [m] or None."""
        self._check_open()
        if self.render_mode == "rgb_array":
            return self._view.rgb(self.dm_env.physics)
        if self.render_mode == "depth_array":
            return self._view.depth(self.dm_env.physics)
        logger.warn('render() needs a render_mode: make the environment with "rgb_array"')
        return None

    def close(self) -> None:
        """Frees the simulation."""
        if not self._closed:
            self.dm_env.close()
            self._closed = True

    def get_state(self) -> tuple[Snapshot, Mapping[str, Any]]:
        """Returns a picklable snapshot for `set_state`, with the generator that draws variations.

        Raises:
            LifecycleError: before the first reset.
        """
        self._check_open()
        return self.dm_env.get_state(), self.np_random.bit_generator.state

    def set_state(self, state: tuple[Snapshot, Mapping[str, Any]]):
        """Restores a snapshot; returns observation and info.

        Raises:
            SnapshotError: for a snapshot of another task or other settings, or an invalid one.
        """
        self._check_open()
        snapshot, generator = checked_state(state)
        self.dm_env.set_state(snapshot)
        self.np_random.bit_generator.state = generator
        return self._convert(self.dm_env.observation()), self._info()

    def __getstate__(self) -> dict[str, Any]:
        self._check_open()
        state = self.get_state() if self.dm_env.current_variation is not None else None
        copied = {name: vars(self)[name] for name in _COPIED if name in vars(self)}
        # A deep copy, because `copy.copy` must not share generators.
        return {**super().__getstate__(), "state": state, "copied": copy.deepcopy(copied)}

    def __setstate__(self, kept: dict[str, Any]) -> None:
        super().__setstate__(kept)
        vars(self).update(kept["copied"])
        if kept["state"] is not None:
            self.set_state(kept["state"])

    def _check_open(self):
        if self._closed:
            raise LifecycleError("this environment was closed: make a new one")

    def _convert(self, observation: dict[str, np.ndarray]):
        space = self.observation_space
        if isinstance(space, gymnasium.spaces.Dict):  # The order is that of the space.
            return {name: observation[name].astype(one.dtype) for name, one in space.items()}
        (value,) = observation.values()
        return value.astype(space.dtype)
