"""SoftGym's interface: old training scripts run when their import lines are changed.

    from softgym_mj.compat import SOFTGYM_ENVS, env_arg_dict, normalize

    env = normalize(SOFTGYM_ENVS["ClothFlatten"](**env_arg_dict["ClothFlatten"]))
    observation = env.reset(config_id=3)
    observation, reward, done, info = env.step(env.action_space.sample())

Positions and actions are in SoftGym's axes (x, y up, z). Tasks, rewards and bounds are this
package's. docs/migration.md lists where they differ, and every name of SoftGym with what it does
here; what is missing raises an error that says what to use instead.
"""

import functools
from typing import Any

from softgym_mj.compat.actions import MODES_OF
from softgym_mj.compat.environment import RECORDS, OldEnv
from softgym_mj.compat.gif import save_numpy_as_gif
from softgym_mj.compat.names import FIXED, REPLACED, ReplacedError, Table
from softgym_mj.compat.normalized import NormalizedEnv
from softgym_mj.exceptions import UnavailableError
from softgym_mj.variations.indices import NUM_VARIATIONS

__all__ = [
    "SOFTGYM_ENVS", "NormalizedEnv", "OldEnv", "ReplacedError", "Table", "env_arg_dict",
    "normalize", "save_numpy_as_gif",
]  # fmt: skip

normalize = NormalizedEnv
_PPP = ("ClothFlatten", "ClothFold")  # Environments that also have a "pickerpickplace" name.


def _usual(name: str, action_mode: str) -> dict[str, Any]:
    """Returns the default keyword arguments of an environment."""
    record, once = RECORDS[name], action_mode == "pickerpickplace"
    render_mode = "fluid" if record.resolve().material == "water" else "cloth"
    return {
        "observation_mode": "cam_rgb", "action_mode": action_mode, "num_picker": 2,
        "horizon": 20 if once else record.horizon,
        "action_repeat": 1 if once else record.action_repeat,
        "num_variations": NUM_VARIATIONS, "deterministic": False, "render": True,
        "headless": True, "render_mode": render_mode, "use_cached_states": True,
        "camera_name": FIXED["camera_name"],
    }  # fmt: skip


# Constructors, and their default keyword arguments, by SoftGym's names.
SOFTGYM_ENVS = Table({
    **{name: functools.partial(OldEnv, name) for name in MODES_OF},
    **{f"{name}PPP": functools.partial(OldEnv, name) for name in _PPP},
})  # fmt: skip
env_arg_dict = Table({
    **{name: _usual(name, modes[0]) for name, modes in MODES_OF.items()},
    **{f"{name}PPP": _usual(name, "pickerpickplace") for name in _PPP},
})  # fmt: skip


def __getattr__(name: str) -> Any:
    use = f"SOFTGYM_ENVS[{name!r}]" if name in SOFTGYM_ENVS else REPLACED.get(name)
    if use is not None:  # `from ... import` would hide an AttributeError.
        raise UnavailableError(str(ReplacedError(name, use)))
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
