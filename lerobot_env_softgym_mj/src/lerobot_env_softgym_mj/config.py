"""`SoftGymMjEnv`: LeRobot's configuration of the environment type "softgym_mj"."""

import dataclasses
from typing import Any

import gymnasium
from lerobot.configs import FeatureType, PolicyFeature
from lerobot.envs import EnvConfig
from lerobot.utils.constants import ACTION, OBS_ENV_STATE, OBS_IMAGES, OBS_STR

from lerobot_env_softgym_mj.env import NAMES, make

PACKAGE = "lerobot_env_softgym_mj"
GYM_ID = f"{PACKAGE}/Task-v0"
_FEATURES = {name: feature for feature, name in NAMES.items()}

gymnasium.register(GYM_ID, f"{PACKAGE}.env:make")


@EnvConfig.register_subclass("softgym_mj")
@dataclasses.dataclass
class SoftGymMjEnv(EnvConfig):
    """Task of softgym_mj, an environment of `lerobot-eval` and `lerobot-train`.

    Attributes:
        task: Task name, such as "fold_cloth".
        fps: Env steps per second; computed.
        actor: Actor, such as "picker", "franka", "sawyer", "ur5e" or "cup"; None for the task's.
        observation: Names of observations; the policy's dataset has the same.
        image_size: (height, width) of observed images [pixels].
        split: "train", "evaluate" or "all".
        episode_length: Env steps in an episode; None for the task's own.
        settings: Further keyword arguments of `SoftGymEnv`, such as {"grasp": "friction"}.
        features: Actions and observations of the environment; computed.
        features_map: Their names in datasets; computed.
    """

    task: str = "straighten_rope"
    fps: float = 12.5
    actor: str | None = None
    observation: list[str] = dataclasses.field(default_factory=lambda: ["proprioception", "rgb"])
    image_size: tuple[int, int] = (128, 128)
    split: str = "evaluate"
    episode_length: int | None = None
    settings: dict[str, Any] = dataclasses.field(default_factory=dict)

    def __post_init__(self) -> None:
        """Computes features and frame rate from an environment.

        Raises:
            SoftGymError: for settings that the task rejects.
        """
        with make(**self.gym_kwargs) as env:
            self.fps = float(env.metadata["render_fps"])
            space, actions = env.observation_space, env.action_space
        assert isinstance(space, gymnasium.spaces.Dict)
        entries = [(ACTION, ACTION, FeatureType.ACTION, actions)]
        for name, part in space.items():
            if isinstance(part, gymnasium.spaces.Dict):  # Recordings of `lerobot-eval` need `key`.
                for camera, image in part.items():
                    key = f"{OBS_IMAGES}.{camera}"
                    entries.append((key, key, FeatureType.VISUAL, image))
            else:
                key = _FEATURES.get(name, f"{OBS_STR}.{name}")
                kind = FeatureType.ENV if key == OBS_ENV_STATE else FeatureType.STATE
                entries.append((name, key, kind, part))
        self.features = {name: PolicyFeature(kind, part.shape) for name, _, kind, part in entries}
        self.features_map = {name: key for name, key, *_ in entries}

    @property
    def package_name(self) -> str:
        return PACKAGE

    @property
    def gym_id(self) -> str:
        return GYM_ID

    @property
    def gym_kwargs(self) -> dict[str, Any]:
        return {
            "task": self.task,
            "render_mode": "rgb_array",
            "split": self.split,
            "horizon": self.episode_length,
            "observation": list(self.observation),
            "image_size": tuple(self.image_size),
            "actor": self.actor,
            **self.settings,
        }
