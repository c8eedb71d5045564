"""Noise on what a policy does: demonstrations then show how errors are made good.

DART (Laskey et al., 2017, https://arxiv.org/abs/1703.09327): what is applied is the policy's action
with Gaussian noise, which leads to where a learner's errors would; what is learned is the policy's
own action there.
"""

from collections.abc import Callable

import numpy as np

from softgym_mj.exceptions import InvalidArgumentError, check_count
from softgym_mj.robots.base import Actor

LARGEST = 1.0  # Half the range of an action: more is mostly clipped.
_KEY = 0x44415254  # Keeps the numbers apart from those of the random policy.


def check_noise(noise: float, seed: int = 0) -> None:
    """Raises `InvalidArgumentError` unless actions can have noise of this deviation and seed."""
    check_count("seed", seed, 0)
    if not 0.0 <= noise <= LARGEST:
        raise InvalidArgumentError("noise", noise, f"0..{LARGEST:g}, of actions in -1..1")


def disturbance(
    actor: Actor, noise: float, seed: int, variation: int
) -> Callable[[np.ndarray], np.ndarray]:
    """What makes of an action (size,) in [-1, 1] one with noise, clipped to these bounds.

    The `switches` of an action stay as they are: noise on these drops what is held.

    Args:
        actor: whose actions they are.
        noise: standard deviation of each other entry.
        seed, variation: what the noise of an episode depends on.
    """
    deviation = np.full(actor.action_size, noise)
    deviation[list(actor.actions.switches)] = 0.0
    random = np.random.default_rng([_KEY, seed, variation])

    def disturb(action: np.ndarray) -> np.ndarray:
        noisy = actor.checked_action(action) + deviation * random.standard_normal(len(deviation))
        return np.clip(noisy, -1.0, 1.0).astype(action.dtype)

    return disturb
