"""Plays an episode and returns its images, rewards and scores."""

import dataclasses
from collections.abc import Callable, Collection

import numpy as np

from softgym_mj.envs.environment import Environment
from softgym_mj.exceptions import check_count, check_name
from softgym_mj.policies.factory import Policy, make_policy
from softgym_mj.rendering.look import look_of
from softgym_mj.rendering.offscreen import LARGEST_IMAGE, CameraView, Video, camera_ids
from softgym_mj.validation import typed

# [m] Motion up to which a frame of a video repeats the last one: a hundredth of a pixel at most.
# Half of the frames of tasks on cloth and rope show what has come to rest.
STILL = 1e-5


@dataclasses.dataclass(frozen=True)
class Episode:
    """Episode of n env steps; a notebook shows it as a video.

    Attributes:
        frames: Images (m, size, size, 3) uint8 of the start and after each env step, or of the
            requested ones; empty without a camera.
        rewards: Rewards (n,).
        info: Entries of `Environment.info` over time, (n + 1,) each, including the start.
        fps: Env steps per second of simulated time.
    """

    frames: np.ndarray = dataclasses.field(repr=False)
    rewards: np.ndarray = dataclasses.field(repr=False)
    info: dict[str, np.ndarray] = dataclasses.field(repr=False)
    fps: float

    @property
    def video(self) -> Video:
        """The pictures at the speed at which they were taken.

        Raises:
            InvalidArgumentError: if there are none.
        """
        return Video(self.frames, self.fps)

    def _repr_html_(self) -> str | None:
        return self.video._repr_html_() if len(self.frames) else None


@typed
def play(
    env: Environment,
    policy: str | Policy = "scripted",
    variation: int | None = None,
    *,
    seed: int = 0,
    trust: bool = False,
    camera: str | None = "task",
    size: int = 240,
    pictures: Collection[int] | None = None,
    passes: int | None = None,
    on_step: Callable[[], object] = lambda: None,
) -> Episode:
    """Plays an episode.

    Args:
        env: The environment.
        policy: Function from a time step to an action, or a name for `make_policy`: "scripted",
            "reactive", "random", "zero", a file or "module:function".
        variation: Index 0..999; None draws one from the environment's split.
        seed, trust: Arguments of `make_policy`.
        camera: "task", "overview" or another camera of the model; None renders no images, which is
            much faster.
        size: Side of the images [pixels].
        pictures: Env steps after which an image is rendered (0: the start); None for all, rendered
            at the quality of videos, where frames repeat while nothing moves.
        passes: Number of passes averaged in an image; None for the look's.
        on_step: Called after each env step.

    Raises:
        InvalidArgumentError: for a bad policy or camera; for a variation or a size that does not
            exist.
        SimulationError: if the episode diverges.
        UnavailableError: if there is a camera but no OpenGL.
    """
    act = make_policy(policy, env, seed, trust=trust) if isinstance(policy, str) else policy
    check_count("size", size, 1, LARGEST_IMAGE)
    check_name("camera", camera, (None, *camera_ids(env.physics.model.ptr)))
    if passes is None and pictures is None:
        passes = look_of(env.physics.model.ptr).video_passes
    still = STILL if pictures is None else None
    view = None if camera is None else CameraView(camera, size, size, passes, still=still)
    frames: list[np.ndarray] = []
    rewards, infos = [], []
    for timestep in env.play(act, variation):
        infos.append(env.info())
        if view is not None and (pictures is None or env.step_count in pictures):
            frames.append(view.rgb(env.physics))
        if not timestep.first():
            rewards.append(timestep.reward)
            on_step()
    return Episode(
        frames=np.array(frames, np.uint8).reshape(-1, size, size, 3),
        rewards=np.array(rewards),
        info={name: np.array([info[name] for info in infos]) for name in infos[0]},
        fps=env.frame_rate,
    )
