"""Creates policies by name or file."""

import dm_env
import numpy as np

from softgym_mj.envs.environment import Environment
from softgym_mj.exceptions import check_count, check_name
from softgym_mj.policies.exported import Policy
from softgym_mj.policies.saved import is_saved, make_saved, takes_seed
from softgym_mj.validation import check_type

SIMPLE = ("scripted", "reactive", "random", "zero")
_SEED_KEY = 0x52414E44  # Separates the random policy's random numbers from others.


def depends_on_seed(name: str) -> bool:
    """Returns whether a policy depends on its seed.

    Raises:
        InvalidArgumentError: for a function that cannot be imported.
    """
    return takes_seed(name) if is_saved(name) else name not in ("scripted", "reactive", "zero")


def make_policy(name: str, env: Environment, seed: int = 0, *, trust: bool = False) -> Policy:
    """Creates a policy without planning: a function from a time step to an action.

    Args:
        name: "scripted", "reactive", "random" or "zero"; a file of `torch.export.save`; or
            "module:function". The exported module maps an observation, (1, n) float32 or
            (1, h, w, 3) uint8, to an action (1, m), which is clipped to [-1, 1]. The function maps
            an environment, and `seed` if it has this argument, to a policy.
        env: Environment of the policy.
        seed: Seed of the random policy and of functions; replaces "{seed}" in a file's name.
        trust: Whether a file may be loaded, which can run any code in it.

    Raises:
        InvalidArgumentError: for an unknown policy, an invalid file or function, a file without
            `trust`, another environment than one of `load`, or "scripted" or "reactive" for a task
            without such an expert.
        StoreError: for a file that cannot be read.
    """
    check_type("policy", name, str)
    if not hasattr(env, "task"):  # A batch passes the part of an environment that policies read.
        check_type("env", env, Environment)
    if is_saved(name):
        return make_saved(name, env, seed, trust)
    check_name("policy", name, (*SIMPLE, "FILE.pt2", "MODULE:FUNCTION"))
    if name == "scripted":
        from softgym_mj.policies import experts

        return experts.make_policy(env)
    if name == "reactive":
        from softgym_mj.policies import reactive

        return reactive.make_policy(env)
    size = env.task.actor.action_size
    if name == "zero":
        return lambda timestep: np.zeros(size)
    check_count("seed", seed, 0)
    random = np.random.default_rng()

    def act(timestep: dm_env.TimeStep) -> np.ndarray:
        """Returns uniform entries, which depend on seed, variation and step alone."""
        nonlocal random
        if timestep.first():
            random = np.random.default_rng([_SEED_KEY, seed, env.task.variation])
        return random.uniform(-1.0, 1.0, size)

    return act
