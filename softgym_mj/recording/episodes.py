"""Episodes of a dataset: played, as arrays by name, which a store takes."""

from collections.abc import Callable, Mapping
from typing import Any

import dm_env
import gymnasium
import numpy as np

from softgym_mj.exceptions import SimulationError
from softgym_mj.policies.factory import Policy

_BETWEEN = "/"  # Part and name of an array: "infos/success".
LABEL = "expert_action"  # The info of what a policy would have done without noise.
LABELS = f"infos{_BETWEEN}{LABEL}"  # These over time.


def play(
    env: gymnasium.Env,
    act: Policy,
    variation: int,
    until: Callable[[dict], bool] = lambda _: False,
    disturb: Callable[[np.ndarray], np.ndarray] | None = None,
) -> dict[str, np.ndarray]:
    """What happens in an episode of n env steps.

    Minari's own collector does the same, but needs JAX for it.

    Args:
        env: where; its observations are named or not.
        act: the policy.
        variation: index 0..999.
        until: of an info; the episode is truncated there.
        disturb: what is applied instead of an action of the policy; None for that itself.

    Returns:
        Arrays over time by name: "actions" (n, size), those that were applied; "rewards",
        "terminations" and "truncations" (n,), "observations" and "infos" (n + 1, ...); those with
        names of their own as "infos/success", "infos/cameras/left/intrinsics". With `disturb`
        `LABELS` (n, size), too: what the policy itself would have done before each step.

    Raises:
        SimulationError: if the episode diverges.
    """
    observation, info = env.reset(options={"variation": variation})
    timestep = dm_env.restart(_named(observation))
    observations, infos, steps, ended = [observation], [info], [], False
    own = []
    while not ended:
        own.append(act(timestep).astype(env.action_space.dtype))
        action = own[-1] if disturb is None else disturb(own[-1])
        observation, reward, terminated, truncated, info = env.step(action)
        if info["diverged"]:
            raise SimulationError(f"variation {variation} has diverged: it cannot be recorded")
        truncated = truncated or (until(info) and not terminated)
        timestep = dm_env.transition(reward, _named(observation))
        observations.append(observation)
        infos.append(info)
        steps.append((action, reward, terminated, truncated))
        ended = terminated or truncated
    names = "actions", "rewards", "terminations", "truncations"
    played = zip(names, map(np.array, zip(*steps, strict=True)), strict=True)
    seen = _over_time("observations", observations)
    labels = {} if disturb is None else {LABELS: np.array(own)}
    return {**dict(played), **seen, **_over_time("infos", infos), **labels}


def _over_time(part: str, values: list) -> dict[str, np.ndarray]:
    """Arrays with time as a further axis: one, or one for each name."""
    if not isinstance(values[0], dict):
        return {part: np.array(values)}
    over_time: dict[str, np.ndarray] = {}
    for name in values[0]:
        over_time |= _over_time(f"{part}{_BETWEEN}{name}", [value[name] for value in values])
    return over_time


def _named(observation) -> dict:
    """An observation as policies get it."""
    return observation if isinstance(observation, dict) else {"observation": observation}


def nested(arrays: Mapping[str, np.ndarray]) -> dict[str, Any]:
    """The arrays of `play` as keyword arguments of Minari: those of a part in a dict."""
    episode: dict[str, Any] = {}
    for key, value in arrays.items():
        *parts, name = key.split(_BETWEEN)
        inner = episode
        for part in parts:
            inner = inner.setdefault(part, {})
        inner[name] = value
    return episode
