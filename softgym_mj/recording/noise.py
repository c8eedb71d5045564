"""Noise on a policy's actions, so that demonstrations show corrections of errors.

DART (Laskey et al., 2017, https://arxiv.org/abs/1703.09327): the applied action has Gaussian noise,
which leads to states that a learner's errors would reach; the policy's own action is the label.
"""

from collections.abc import Callable

import numpy as np

from softgym_mj.exceptions import InvalidArgumentError, check_count
from softgym_mj.robots.base import Actor

LARGEST = 1.0  # Half the range of an action; larger noise is mostly clipped.
_KEY = 0x44415254  # Separates the random numbers from those of the random policy.


def check_noise(noise: float, seed: int = 0, policy: str = "scripted") -> None:
    """Raises `InvalidArgumentError` for an invalid standard deviation or seed of noise.

    Actions of the policy "random" have no noise, because they are no labels.
    """
    check_count("seed", seed, 0)
    if not 0.0 <= noise <= LARGEST:
        raise InvalidArgumentError("noise", noise, f"a number in 0..{LARGEST:g}")
    if noise and policy == "random":
        raise InvalidArgumentError("noise", noise, f"0 with policy={policy!r}")


def disturbance(
    actor: Actor, noise: float, seed: int, variation: int
) -> Callable[[np.ndarray], np.ndarray]:
    """Returns a function that adds noise to an action (size,) and clips it to [-1, 1].

    `noise` is its standard deviation. The actor's `switches` get none: it would release objects.
    """
    deviation = np.full(actor.action_size, noise)
    deviation[list(actor.actions.switches)] = 0.0
    random = np.random.default_rng([_KEY, seed, variation])

    def disturb(action: np.ndarray) -> np.ndarray:
        noisy = actor.checked_action(action) + deviation * random.standard_normal(len(deviation))
        return np.clip(noisy, -1.0, 1.0).astype(action.dtype)

    return disturb
