"""MPPI, model predictive path integral control, as TD-MPC2 plans (Hansen et al., 2024, 3.2).

A Gaussian over action sequences is fitted iteratively to the best of its samples and a policy's
proposals. The caller computes the values of sequences.
"""

import dataclasses
from collections.abc import Callable, Sequence

import torch
from torch import Tensor

from softgym_mj.exceptions import InvalidArgumentError, check_count, check_number
from softgym_mj.learning.networks import drawn
from softgym_mj.validation import typed


@typed
@dataclasses.dataclass(frozen=True)
class MPPISettings:
    """Settings of the planner; the defaults are TD-MPC2's.

    Attributes:
        horizon: Planning horizon in env steps.
        iterations: Number of fits.
        samples: Sequences per iteration, including the policy's.
        proposals: Number of the policy's sequences.
        elites: Number of sequences that the next distribution is fitted to.
        temperature: Factor of values in the elites' weights.
        std: Minimum and initial standard deviation.

    Raises:
        InvalidArgumentError: for a value out of range.
    """

    horizon: int = 3
    iterations: int = 6
    samples: int = 512
    proposals: int = 24
    elites: int = 64
    temperature: float = 0.5
    std: tuple[float, float] = (0.05, 2.0)

    def __post_init__(self):
        for name in ("horizon", "iterations", "samples"):
            check_count(name, getattr(self, name), 1)
        check_count("proposals", self.proposals, 1, self.samples)
        check_count("elites", self.elites, 1, self.samples)
        check_number("temperature", self.temperature, gt=0.0)
        if not 0.0 < self.std[0] <= self.std[1]:
            raise InvalidArgumentError("std", self.std, "(least, largest), above 0")


def mppi(
    value: Callable[[Tensor], Tensor],
    proposals: Tensor,
    mean: Tensor,
    settings: MPPISettings,
    sources: Sequence[torch.Generator],
    *,
    explore: bool,
) -> tuple[Tensor, Tensor]:
    """Plans for n states of each seed.

    Args:
        value: Maps sequences (seeds, n, samples, horizon, action) to values (seeds, n, samples).
        proposals: The policy's sequences (seeds, n, proposals, horizon, action).
        mean: Initial mean (seeds, n, horizon, action).
        settings: Settings of the planner.
        sources: Random generators, one per seed.
        explore: Whether to add noise of the last standard deviation.

    Returns:
        The first actions (seeds, n, action) of an elite that is drawn by its weight, as published,
        and the last mean (seeds, n, horizon, action).
    """
    number, (horizon, size) = mean.shape[1], mean.shape[2:]
    std = torch.full_like(mean, settings.std[1])
    for _ in range(settings.iterations):
        noise = drawn(sources, number, settings.samples - settings.proposals, horizon, size)
        sampled = (mean[:, :, None] + std[:, :, None] * noise).clamp(-1.0, 1.0)
        actions = torch.cat([proposals, sampled], dim=2)
        elites, weights, mean, std = fitted(actions, value(actions), settings)
    # The maximum of log weights with Gumbel noise is a sample by the weights.
    uniform = drawn(sources, *weights.shape[1:], normal=False).clamp(min=1e-20)
    chosen = (weights.log() - (-uniform.log()).log()).argmax(-1)
    action = elites[:, :, :, 0].gather(2, chosen[..., None, None].expand(-1, -1, 1, size))[:, :, 0]
    if explore:
        action = action + std[:, :, 0] * drawn(sources, number, size)
    return action.clamp(-1.0, 1.0), mean


def fitted(
    actions: Tensor, values: Tensor, settings: MPPISettings
) -> tuple[Tensor, Tensor, Tensor, Tensor]:
    """Returns the next distribution.

    Args:
        actions: Sequences (seeds, n, samples, horizon, action).
        values: Values of sequences (seeds, n, samples).
        settings: Settings of the planner.

    Returns:
        The elites (seeds, n, elites, horizon, action), their weights (seeds, n, elites), and mean
        and deviation (seeds, n, horizon, action) of both.
    """
    best = values.topk(settings.elites, dim=-1)
    at = best.indices[..., None, None].expand(-1, -1, -1, *actions.shape[3:])
    elites = actions.gather(2, at)
    weights = (settings.temperature * best.values).softmax(-1)
    shares = weights[..., None, None]
    mean = (shares * elites).sum(2)
    variance = (shares * (elites - mean[:, :, None]) ** 2).sum(2)
    return elites, weights, mean, variance.sqrt().clamp(*settings.std)
