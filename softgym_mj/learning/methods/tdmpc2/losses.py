"""Losses of TD-MPC2 (Hansen et al., 2024, 3.1), for several seeds, as pure functions.

Steps of a sequence after the end of its episode are ignored. The entropy is that of the action
after tanh, times the size of an action; depending on its version, the published code omits tanh or
the factor.
"""

import torch
from torch import Tensor

from softgym_mj.learning.learner import Step
from softgym_mj.learning.methods.tdmpc2.networks import WorldModel, two_of
from softgym_mj.learning.methods.tdmpc2.two_hot import cross_entropy, expected

_PERCENTILES = 0.05, 0.95  # Percentiles whose difference is the spread of values.


def model_losses(
    model: WorldModel,
    step: Step,
    noise: Tensor,
    pair: Tensor,
    kept_mask: Tensor | None = None,
    *,
    discount: float,
    rho: float,
) -> tuple[dict[str, Tensor], Tensor]:
    """Returns the losses of the world model.

    Args:
        model: The networks.
        step: Sequences (seeds, n, horizon, ...).
        noise: Noise of next actions (seeds, n, horizon, action).
        pair: Indices of two critics of each seed (seeds, 2).
        kept_mask: Dropout mask of the critics.
        discount: Discount per env step.
        rho: Argument of `shares`.

    Returns:
        Losses (seeds,) by name, and predicted latent states (seeds, n, horizon + 1, latent).
    """
    with torch.no_grad():
        following = model.encode(step.next_observation)
        action, _ = model.sample(following, noise)
        later = expected(two_of(model.values(following, action, target=True), pair)).amin(1)
        # Truncated episodes bootstrap from the value.
        target = step.reward + discount * (~step.terminated).float() * later
    states = [model.encode(step.observation[:, :, 0])]
    for action in step.action.unbind(2):
        states.append(model.following(states[-1], action))
    latent = torch.stack(states, 2)
    before = latent[:, :, :-1]
    values = cross_entropy(model.values(before, step.action, kept_mask), target[:, None])
    each = {
        "consistency": ((latent[:, :, 1:] - following) ** 2).mean(-1),
        "reward": cross_entropy(model.rewards(before, step.action), step.reward),
        "value": values.mean(1),
    }
    weights = shares(counted(step.ended), rho)
    return {name: (weights * loss).sum((1, 2)) for name, loss in each.items()}, latent.detach()


def policy_values(
    model: WorldModel, latent: Tensor, noise: Tensor, pair: Tensor, kept_mask: Tensor | None = None
) -> tuple[Tensor, Tensor]:
    """Returns values and scaled entropies (seeds, n, length) of the policy's actions.

    Args:
        model: The networks.
        latent: Latent states (seeds, n, length, latent).
        noise: Noise of actions (seeds, n, length, action).
        pair: Indices of two critics of each seed (seeds, 2).
        kept_mask: Dropout mask of the critics.
    """
    action, density = model.sample(latent, noise)
    values = expected(two_of(model.values(latent, action, kept_mask), pair)).mean(1)
    return values, -noise.shape[-1] * density


def counted(ended: Tensor) -> Tensor:
    """Returns 1 up to the end of an episode and 0 after it (..., length)."""
    going = (~ended[..., :-1]).float().cumprod(-1)
    return torch.cat([torch.ones_like(ended[..., :1], dtype=going.dtype), going], dim=-1)


def shares(counts: Tensor, rho: float) -> Tensor:
    """Returns weights of losses (seeds, n, length): rho**t at step t, divided by the counts."""
    length = counts.shape[-1]
    later = rho ** torch.arange(length, device=counts.device)
    return counts / counts.sum(1, keepdim=True).clamp(min=1.0) * later / length


def spread(values: Tensor) -> Tensor:
    """Returns the difference (seeds,) of the 95th and 5th percentile of values (seeds, n)."""
    ordered, last = values.sort(-1).values, values.shape[-1] - 1
    ends = []
    for share in _PERCENTILES:  # `quantile` would synchronize with the GPU.
        low = int(share * last)
        high = min(low + 1, last)
        ends.append(ordered[:, low].lerp(ordered[:, high], share * last - low))
    return ends[1] - ends[0]
