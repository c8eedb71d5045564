"""`Rollout`: what was done by one policy, and how much better than expected that was."""

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
    """Generalized advantage estimates (Schulman et al., 2016) of vector steps (steps, ...).

    Args:
        reward, value, next_value: of each; the last one of the same episode, at its end too.
        terminated: whether nothing follows.
        ended: whether the next step is of another episode.
        discount, trace: as of `PPOSettings`.
    """
    # Not by a factor of 0: what follows divergence may be no number.
    error = reward + discount * torch.where(terminated, 0.0, next_value) - value
    result, last = torch.empty_like(error), torch.zeros_like(error[0])
    for k in reversed(range(len(error))):
        last = error[k] + discount * trace * torch.where(ended[k], 0.0, last)
        result[k] = last
    return result


@dataclasses.dataclass(frozen=True)
class Rollout:
    """What is learned from, (seeds, n, ...) each.

    Attributes:
        observation, action: what was seen, and drawn.
        log_density: of the action, by the policy that drew it (seeds, n).
        advantage: (seeds, n).
        value_target: value (seeds, n).
    """

    observation: Tensor
    action: Tensor
    log_density: Tensor
    advantage: Tensor
    value_target: Tensor
