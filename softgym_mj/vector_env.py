"""`make_vector_env`: many environments at once, which `gymnasium.make_vec` returns."""

import functools
import multiprocessing
from typing import Any

from gymnasium.vector import AsyncVectorEnv, AutoresetMode

from softgym_mj.exceptions import check_count, check_name
from softgym_mj.gymnasium_env import SoftGymEnv
from softgym_mj.registry import TASKS
from softgym_mj.rendering import has_rendered


def make_vector_env(
    num_envs: int = 1,
    *,
    autoreset_mode: str | AutoresetMode = AutoresetMode.NEXT_STEP,
    context: str | None = None,
    max_concurrency: int | None = None,
    **kwargs: Any,
) -> AsyncVectorEnv:
    """Environments of one task, each in a process of its own.

    `gymnasium.make_vec("softgym_mj/SpreadCloth-v0", num_envs=8)` calls it. Observations, images
    among them, come through shared memory; `render()` returns a tuple of images.

    Args:
        num_envs: number of environments, 1 or more.
        autoreset_mode: what follows the last step of an episode. "NextStep": the next step resets,
            ignores its action and has reward 0. "SameStep": the last step returns the first
            observation of the next episode, and its own in info["final_obs"] and
            info["final_info"]. "Disabled": you reset, with options={"reset_mask": ended}.
        context: how processes start: "fork", "forkserver" or "spawn". By default Python's own way,
            but "forkserver" rather than "fork" once this process has rendered, as OpenGL does not
            survive a fork. The latter two need a script to have `if __name__ == "__main__":`.
        max_concurrency: how many may compute at the same time; None for all.
        **kwargs: of `SoftGymEnv`: task, render_mode, split, observation, actor, ...

    Raises:
        OutOfRangeError, UnknownNameError: for a bad argument.
    """
    check_count("num_envs", num_envs, 1)
    modes = {mode.value: mode for mode in AutoresetMode}
    if not isinstance(autoreset_mode, AutoresetMode):
        check_name("autoreset_mode", autoreset_mode, modes)
        autoreset_mode = modes[autoreset_mode]
    if context is None:
        if multiprocessing.get_start_method() == "fork" and has_rendered():
            context = "forkserver"
    else:
        check_name("context", context, multiprocessing.get_all_start_methods())
    if max_concurrency is not None:
        check_count("max_concurrency", max_concurrency, 1)
    if "task" in kwargs:  # Its record: other processes may not know a task of yours by name.
        kwargs["task"] = TASKS.get(kwargs["task"], kwargs["task"])
    return AsyncVectorEnv(
        [functools.partial(SoftGymEnv, **kwargs)] * num_envs,
        context=context,
        autoreset_mode=autoreset_mode,
        max_concurrency=max_concurrency,
    )
