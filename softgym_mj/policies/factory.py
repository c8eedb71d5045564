"""Policies by name or file: what `evaluate` can score."""

import dm_env
import numpy as np

from softgym_mj.envs.environment import Environment
from softgym_mj.exceptions import check_count, check_name
from softgym_mj.policies.saved import Policy, is_saved, make_saved, takes_seed

SIMPLE = ("scripted", "random", "zero")
_SEED_KEY = 0x52414E44  # Keeps the random policy's numbers apart from others.


def depends_on_seed(name: str) -> bool:
    """Whether two seeds can give two policies.

    Raises:
        InvalidArgumentError: for a function that cannot be imported.
    """
    return takes_seed(name) if is_saved(name) else name not in ("scripted", "zero")


def make_policy(name: str, env: Environment, seed: int = 0, *, trust: bool = False) -> Policy:
    """A policy that does not plan.

    Args:
        name: one of `SIMPLE`; a file that `torch.export.save` wrote, of a module that maps the
            observation, states (1, n) float32 or images (1, h, w, 3) uint8, to an action (1, m),
            which is clipped to [-1, 1]; or "module:function", a function that gives for an
            environment, and a `seed` if it has such an argument, a policy: a function of its time
            steps.
        env: what it acts in.
        seed: of the random policy and of functions; replaces "{seed}" in the name of a file.
        trust: whether a file may be loaded, which runs whatever code is in it; a function is code
            in any case, that of the module that is named.

    Raises:
        InvalidArgumentError: if there is no such policy; for a file or function that is none, or a
            file without `trust`; if the task has no scripted expert.
        StoreError: for a file that cannot be read.
    """
    if is_saved(name):
        return make_saved(name, env, seed, trust)
    check_name("policy", name, SIMPLE)
    if name == "scripted":
        from softgym_mj.policies import experts

        return experts.make_policy(env)
    size = env.task.actor.action_size
    if name == "zero":
        return lambda timestep: np.zeros(size)
    check_count("seed", seed, 0)
    random = np.random.default_rng()

    def act(timestep: dm_env.TimeStep) -> np.ndarray:
        """Uniform entries; those of an episode depend on seed and variation alone."""
        nonlocal random
        if timestep.first():
            random = np.random.default_rng([_SEED_KEY, seed, env.task.variation])
        return random.uniform(-1.0, 1.0, size)

    return act
