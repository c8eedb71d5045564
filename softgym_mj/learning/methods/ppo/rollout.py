"""`Rollout`: steps of one policy, with advantages."""

import dataclasses

import torch
from torch import Tensor


def advantages(
    reward: Tensor,
    value: Tensor,
    next_value: Tensor,
    terminated: Tensor,
    ended: Tensor,
    *,
    discount: float,
    trace: float,
) -> Tensor:
    """Returns generalized advantage estimates (Schulman et al., 2016) of vector steps (steps, ...).

    Args:
        reward, value, next_value: Reward, value, and value of the next observation of the episode.
        terminated: Whether the return ends.
        ended: Whether the next step belongs to another episode.
        discount, trace: Settings of `PPOSettings`.
    """
    # A factor of 0 would not suffice: values after a divergence may be NaN.
    error = reward + discount * torch.where(terminated, 0.0, next_value) - value
    result, last = torch.empty_like(error), torch.zeros_like(error[0])
    for k in reversed(range(len(error))):
        last = error[k] + discount * trace * torch.where(ended[k], 0.0, last)
        result[k] = last
    return result


@dataclasses.dataclass(frozen=True)
class Rollout:
    """Training data of PPO, with arrays (seeds, n, ...).

    Attributes:
        observation, action: Observations and unclipped actions.
        log_density: Log density of the action under the policy of the rollout (seeds, n).
        advantage: Advantage (seeds, n).
        value_target: Target of the value (seeds, n).
    """

    observation: Tensor
    action: Tensor
    log_density: Tensor
    advantage: Tensor
    value_target: Tensor
