"""TD-MPC2's losses (Hansen et al., 2024, 3.1), of several seeds at once: pure functions.

Stretches come from environments that step together: what lies beyond the end of an episode does
not count. The entropy is that of the action after tanh, times the number of actions: the published
code leaves tanh out of it or does not scale it, by its version.
"""

import torch
from torch import Tensor

from softgym_mj.learning.learner import Step
from softgym_mj.learning.methods.tdmpc2.networks import WorldModel, two_of
from softgym_mj.learning.methods.tdmpc2.two_hot import cross_entropy, expected

_PERCENTILES = 0.05, 0.95  # Between them lies the spread of values.


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
    """Of the model.

    Args:
        model: networks.
        step: stretches (seeds, n, horizon, ...).
        noise: of next actions (seeds, n, horizon, action).
        pair: two critics of each seed (seeds, 2).
        kept_mask: dropout of the critics.
        discount: of rewards.
        rho: as of `shares`.

    Returns:
        Losses (seeds,) by name, and latent states (seeds, n, horizon + 1, latent) on the way.
    """
    with torch.no_grad():
        following = model.encode(step.next_observation)
        action, _ = model.sample(following, noise)
        later = expected(two_of(model.values(following, action, target=True), pair)).amin(1)
        # Of an episode that has come to its horizon the value goes on.
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
    """What the policy's actions are worth, and its entropies times their size (seeds, n, length).

    Args:
        model: networks.
        latent: states (seeds, n, length, latent).
        noise: of actions (seeds, n, length, action).
        pair: two critics of each seed (seeds, 2).
        kept_mask: dropout of the critics.
    """
    action, density = model.sample(latent, noise)
    values = expected(two_of(model.values(latent, action, kept_mask), pair)).mean(1)
    return values, -noise.shape[-1] * density


def counted(ended: Tensor) -> Tensor:
    """1 up to the end of an episode and 0 beyond it, by where it is (..., length)."""
    going = (~ended[..., :-1]).float().cumprod(-1)
    return torch.cat([torch.ones_like(ended[..., :1], dtype=going.dtype), going], dim=-1)


def shares(counts: Tensor, rho: float) -> Tensor:
    """Weights of losses (seeds, n, length): means of those that count, rho**t at step t."""
    length = counts.shape[-1]
    later = rho ** torch.arange(length, device=counts.device)
    return counts / counts.sum(1, keepdim=True).clamp(min=1.0) * later / length


def spread(values: Tensor) -> Tensor:
    """From the 5th to the 95th percentile of (seeds, n): (seeds,)."""
    ordered, last = values.sort(-1).values, values.shape[-1] - 1
    ends = []
    for share in _PERCENTILES:  # Not by `quantile`, whose checks wait for a GPU.
        low = int(share * last)
        high = min(low + 1, last)
        ends.append(ordered[:, low].lerp(ordered[:, high], share * last - low))
    return ends[1] - ends[0]
