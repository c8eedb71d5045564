"""LeRobot datasets, version 3.0: numbers as Parquet, images as videos or PNG.

LeRobot itself writes them. A row has the observation before an env step, the action and its
outcome; the last observation of an episode is omitted.
"""

import contextlib
import fractions
import pathlib
import warnings
from collections.abc import Iterator, Mapping, Sequence
from typing import Any, NamedTuple

import gymnasium
import numpy as np

from softgym_mj.envs.environment import Environment
from softgym_mj.envs.gymnasium_env import SoftGymEnv
from softgym_mj.exceptions import InvalidArgumentError, check_name, import_extra
from softgym_mj.recording.datasets import Format
from softgym_mj.recording.episodes import LABEL
from softgym_mj.rendering.observables import EXTERNAL, EXTERNAL_RGB, WRIST_RGB
from softgym_mj.robots.base import Actor
from softgym_mj.robots.gripper import HELD
from softgym_mj.tasks.shared.observations import GOAL_RGB

PNG = "png"  # Images as such in the Parquet files, without loss.
CODECS = ("libsvtav1", "h264", "hevc", "auto", PNG)  # LeRobot's default first.
# Observations that are states, and LeRobot's features for them, in order.
_STATES = ("proprioception", "reduced", "markov", "full")
_PLACES = ("observation.state", "observation.environment_state")
_PICTURE = 3  # Dimensions of what one camera sees in colors.
_LARGEST = 1000  # Largest denominator; rates of env steps are 100 divided by integers, or 2.5.


class FrameRate(float):
    """Frame rate as a float for JSON and as a ratio for PyAV; typical is 12.5."""

    @property
    def _ratio(self) -> fractions.Fraction:
        return fractions.Fraction(self).limit_denominator(_LARGEST)

    @property
    def numerator(self) -> int:
        """Numerator of the ratio."""
        return self._ratio.numerator

    @property
    def denominator(self) -> int:
        """Denominator of the ratio."""
        return self._ratio.denominator


@contextlib.contextmanager
def _quietly() -> Iterator[None]:
    """Suppresses progress bars and warnings of LeRobot's libraries, one for each episode."""
    bars = import_extra("datasets", "LeRobot", "lerobot")
    shown = not bars.are_progress_bars_disabled()
    bars.disable_progress_bars()
    try:
        with warnings.catch_warnings(action="ignore"):
            yield
    finally:
        if shown:
            bars.enable_progress_bars()


class Column(NamedTuple):
    """Feature of a dataset.

    Attributes:
        values: Values over the env steps (n, ...).
        names: Names of its numbers, or of the axes of an image; None if they have none.
        is_image: Whether it is a color image, which is encoded as a video or as PNG.
    """

    values: np.ndarray
    names: list[str] | None = None
    is_image: bool = False


class LeRobot(Format):
    """LeRobotDataset of Hugging Face."""

    default_id, is_signed = "softgym_mj/{task}-{words}", False
    observation = "proprioception", "reduced"

    def __init__(self, codec: str = CODECS[0]):
        """Sets the codec of images, one of `CODECS`; "auto" selects a hardware encoder.

        Raises:
            InvalidArgumentError: for another codec.
        """
        check_name("codec", codec, CODECS)
        self._codec = codec

    def check_id(self, dataset: str) -> None:
        hub = import_extra("huggingface_hub.utils", "LeRobot", "lerobot")
        import_extra("lerobot", "LeRobot", "lerobot")
        try:
            hub.validate_repo_id(dataset)
        except ValueError as error:
            valid = f"a Hugging Face dataset id such as 'me/rope' ({error})"
            raise InvalidArgumentError("dataset", dataset, valid) from None

    def root(self) -> pathlib.Path:
        constants = import_extra("lerobot.utils.constants", "LeRobot", "lerobot")
        return pathlib.Path(constants.HF_LEROBOT_HOME)

    def check_observed(self, env: gymnasium.Env) -> None:
        observed = _played(env).observation_spec()
        if len(states := [name for name in _STATES if name in observed]) > len(_PLACES):
            valid = f"{len(_PLACES)} of {', '.join(states)}: LeRobot stores no more states"
            raise InvalidArgumentError("observation", tuple(observed), valid)
        for spec in observed.values():
            height, width = spec.shape[-3:-1] if _is_seen(spec.dtype, len(spec.shape)) else (0, 0)
            if self._codec not in (CODECS[0], PNG) and (height % 2 or width % 2):
                valid = f"even numbers with codec={self._codec!r}"
                raise InvalidArgumentError("image_size", (height, width), valid)

    def described(self) -> dict[str, Any]:
        return {"format": "lerobot", "codec": self._codec}

    def load(self, dataset: str) -> Any:
        datasets = import_extra("lerobot.datasets.lerobot_dataset", "LeRobot", "lerobot")
        return datasets.LeRobotDataset(dataset, root=self.place(dataset))

    def summary(self, dataset: Any) -> tuple[int, int, str]:
        return dataset.num_episodes, dataset.num_frames, f"LeRobotDataset({dataset.repo_id!r})"

    def build(self, folder, dataset, env, episodes, about):
        datasets = import_extra("lerobot.datasets.lerobot_dataset", "LeRobot", "lerobot")
        video = import_extra("lerobot.configs.video", "LeRobot", "lerobot")
        played, writer = _played(env), None
        names, actor, made = tuple(played.observation_spec()), played.task.actor, folder / "made"
        words = about.task.summary or about.task.name
        with _quietly():
            for episode in episodes:
                result = columns(episode, names, actor)
                writer = writer or datasets.LeRobotDataset.create(
                    dataset,
                    FrameRate(played.frame_rate),
                    {key: self._feature(column) for key, column in result.items()},
                    root=made,  # LeRobot requires a folder that does not exist.
                    robot_type=actor.name,
                    use_videos=self._codec != PNG,
                    rgb_encoder=None if self._codec == PNG else video.RGBEncoderConfig(self._codec),
                )
                for k in range(len(episode["actions"])):
                    step = {key: column.values[k] for key, column in result.items()}
                    writer.add_frame({**step, "task": words})
                writer.save_episode(parallel_encoding=False)
            assert writer is not None  # Datasets have at least one episode.
            writer.finalize()
        for path in made.iterdir():
            path.rename(folder / path.name)
        made.rmdir()

    def _feature(self, column: Column) -> dict[str, Any]:
        """Returns LeRobot's description of a feature."""
        image = "image" if self._codec == PNG else "video"
        kind = image if column.is_image else column.values.dtype.name
        return {"dtype": kind, "shape": column.values.shape[1:], "names": column.names}


def _played(env: gymnasium.Env) -> Environment:
    """Returns the `Environment` within a Gymnasium environment."""
    assert isinstance(env.unwrapped, SoftGymEnv)
    return env.unwrapped.dm_env


def columns(episode: Mapping[str, Any], names: Sequence[str], actor: Actor) -> dict[str, Column]:
    """Returns the features of an episode of n env steps.

    "action" is the action to imitate; with noise it is the policy's own action, and
    "executed_action" the applied one. "observation.state" is proprioception, then `held` if
    observed, and "observation.environment_state" a state of the task, which is "observation.state"
    without proprioception. Images are "observation.images.CAMERA"; other observations keep their
    names, such as "observation.depth".

    Args:
        episode: Value of `episodes.nested`.
        names: Names of its observations; a single one is no dict there.
        actor: Actor of the environment.
    """
    count, infos, seen = len(episode["actions"]), episode["infos"], episode["observations"]
    entries = [f"{name} [{unit}]" if unit else name for name, unit, _ in actor.actions.entries]
    result = observed(seen if isinstance(seen, Mapping) else {names[0]: seen}, actor)
    result["action"] = Column(infos.get(LABEL, episode["actions"]), entries)
    if LABEL in infos:
        result["executed_action"] = Column(episode["actions"], entries)
    after = {
        "next.reward": episode["rewards"].astype(np.float32),
        "next.done": episode["terminations"] | episode["truncations"],
        "next.success": np.asarray(infos["success"][1:], bool),
        "variation": np.asarray(infos["variation"][1:], np.int64),
    }
    result |= {key: Column(values[:, None]) for key, values in after.items()}
    return {key: column._replace(values=column.values[:count]) for key, column in result.items()}


def observed(observations: Mapping[str, np.ndarray], actor: Actor) -> dict[str, Column]:
    """Returns observations over time (n, ...) as features, named as `columns` describes."""
    states = [name for name in _STATES if name in observations]
    result = {
        place: Column(observations[name], _sensed(actor) if name == _STATES[0] else None)
        for place, name in zip(_PLACES, states, strict=False)
    }
    if _STATES[0] in states and HELD in observations:
        values, held = observations[_STATES[0]], observations[HELD]
        names = [*_sensed(actor), *(f"gripper {i} holds" for i in range(held.shape[1]))]
        states.append(HELD)
        result[_PLACES[0]] = Column(np.hstack([values, held.astype(values.dtype)]), names)
    cameras = {"rgb": ("task",), GOAL_RGB: ("goal",), EXTERNAL_RGB: EXTERNAL}
    cameras[WRIST_RGB] = actor.wrists
    for name in observations.keys() - set(states):
        values = observations[name]
        if not _is_seen(values.dtype, values.ndim - 1):
            result[f"observation.{name}"] = Column(values)
            continue
        views = values[:, None] if values.ndim == 1 + _PICTURE else values
        for k, camera in enumerate(cameras.get(name, (name,))):
            key = f"observation.images.{camera}"
            result[key] = Column(views[:, k], ["height", "width", "channels"], is_image=True)
    return dict(sorted(result.items()))


def _is_seen(kind: np.dtype, dimensions: int) -> bool:
    """Returns whether an observation is a color image."""
    return kind == np.uint8 and dimensions >= _PICTURE


def _sensed(actor: Actor) -> list[str]:
    """Returns the names of the entries of `proprioception`."""
    return [
        what if size == 1 else f"{what}, {k}"
        for what, size in actor.senses.items()
        for k in range(size)
    ]
