"""SoftGym's deformable-object tasks on MuJoCo.

import softgym_mj
env = softgym_mj.load("spread_cloth", observation="reduced", split="train")

from dm_control import suite
env = suite.load("softgym", "spread_cloth")

import gymnasium
env = gymnasium.make("softgym_mj/SpreadCloth-v0", observation="rgb")
"""

from softgym_mj import exceptions, gymnasium_registration, registry, rendering, suite
from softgym_mj.registry import TASKS, load

__version__ = "0.1.0"
__all__ = ["TASKS", "__version__", "exceptions", "load", "registry"]


def __dir__() -> list[str]:
    return __all__  # Completion offers what is public.


rendering.choose_backend()
suite.register()
gymnasium_registration.register()
