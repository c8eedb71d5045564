"""SoftGym's deformable-object manipulation tasks on MuJoCo.

As a dm_control environment:

    import softgym_mj
    env = softgym_mj.load("spread_cloth", observation="reduced", split="train")

    from dm_control import suite
    env = suite.load("softgym", "spread_cloth")

As a Gymnasium environment, or many:

    import gymnasium
    env = gymnasium.make("softgym_mj/SpreadCloth-v0", observation="rgb")
    envs = softgym_mj.make_vec("spread_cloth", num_envs=8)

`softgym_mj.TASKS` lists the tasks by name, `softgym_mj.TASKS["spread_cloth"].arguments` the keyword
arguments of one with their types. `help(softgym_mj.tasks.SpreadCloth)` defines a task, and
`help("softgym_mj.tasks.shared.settings")` explains the arguments that tasks share.
`softgym_mj.register` adds a custom task: a subclass of `softgym_mj.tasks.Task`.
"""

import importlib

from softgym_mj import exceptions, registry
from softgym_mj.envs import suite
from softgym_mj.envs.load import load
from softgym_mj.native import library
from softgym_mj.registry import TASKS, register
from softgym_mj.rendering import offscreen, opengl
from softgym_mj.vector.make import make_vec

__version__ = "0.1.0"
__all__ = ["TASKS", "__version__", "exceptions", "load", "make_vec", "register", "registry"]


def __getattr__(name: str) -> object:
    if name == "tasks":  # Imported on first use, so that importing the package stays cheap.
        return importlib.import_module("softgym_mj.tasks")
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")


def __dir__() -> list[str]:
    return __all__  # Completion offers what is public.


library.check_release()
offscreen.choose_backend()
opengl.defer()
suite.register()
for _record in TASKS.values():
    registry.add_gymnasium_id(_record)
