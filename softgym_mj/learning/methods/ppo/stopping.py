"""`StoppingAdam`: Adam for several seeds, each of which may stop while others go on.

PyTorch's counts one number of steps for all of a weight, and moves what has no gradient.
"""

from collections.abc import Iterable, Mapping
from typing import Any

import torch
from torch import Tensor

_BETAS = 0.9, 0.999  # Kingma and Ba, 2015.
_EPSILON = 1e-5  # As PPO's have it; Huang et al., "The 37 implementation details of PPO", 2022.


class StoppingAdam:
    """Steps of weights (seeds, ...), whose gradients are scaled down to a largest norm."""

    def __init__(self, weights: Iterable[Tensor], rate: float, largest: float):
        """Takes weights.

        Args:
            weights: (seeds, ...) each.
            rate: of learning.
            largest: norm of all gradients of a seed.
        """
        self._weights, self._rate, self._largest = [*weights], rate, largest
        self._means = [torch.zeros_like(weight) for weight in self._weights]
        self._squares = [torch.zeros_like(weight) for weight in self._weights]
        first = self._weights[0]
        self._count = torch.zeros(len(first), device=first.device)

    def step(self, losses: Tensor, going: Tensor) -> None:
        """Each seed's weights follow its own loss.

        Args:
            losses: (seeds,).
            going: whether a seed takes the step (seeds,); nothing of the others changes.
        """
        gradients = torch.autograd.grad(losses.sum(), self._weights)
        with torch.no_grad():
            norm = sum(gradient.flatten(1).square().sum(1) for gradient in gradients).sqrt()
            share = (self._largest / (norm + 1e-6)).clamp(max=1.0)
            self._count += going
            # Of seeds that have never gone, whose step is not taken.
            count = self._count.clamp(min=1.0)
            first, second = (1.0 - beta**count for beta in _BETAS)
            for weight, mean, square, gradient in zip(
                self._weights, self._means, self._squares, gradients, strict=True
            ):
                lead = -1, *[1] * (weight.ndim - 1)
                scaled = gradient * share.view(lead)
                goes = going.view(lead)
                for average, new, beta in ((mean, scaled, 0), (square, scaled**2, 1)):
                    average.copy_(
                        torch.where(goes, torch.lerp(new, average, _BETAS[beta]), average)
                    )
                size = (square / second.view(lead)).sqrt() + _EPSILON
                following = weight - self._rate * mean / first.view(lead) / size
                weight.copy_(torch.where(goes, following, weight))

    def get_state(self) -> dict[str, Any]:
        """Returns all that `set_state` needs to go on with the same numbers."""
        return {
            "means": [mean.clone() for mean in self._means],
            "squares": [square.clone() for square in self._squares],
            "count": self._count.clone(),
        }

    def set_state(self, state: Mapping[str, Any]) -> None:
        """Goes on from what `get_state` returned."""
        for own, saved in zip(
            [*self._means, *self._squares, self._count],
            [*state["means"], *state["squares"], state["count"]],
            strict=True,
        ):
            own.copy_(saved)
