"""Plugin of LeRobot: softgym_mj's tasks as its environment type "softgym_mj"."""

from lerobot_env_softgym_mj.config import SoftGymMjEnv
from lerobot_env_softgym_mj.policy import load_policy

__all__ = ["SoftGymMjEnv", "load_policy"]
