"""`StoppingAdam`: Adam for several seeds that can stop separately.

PyTorch's Adam has one step count per tensor and moves weights with zero gradient.
"""

from collections.abc import Iterable, Mapping
from typing import Any

import torch
from torch import Tensor

_BETAS = 0.9, 0.999  # Kingma and Ba, 2015.
_EPSILON = 1e-5  # Huang et al., "The 37 implementation details of PPO", 2022.


class StoppingAdam:
    """Adam on weights (seeds, ...) with gradient clipping and separate step counts of seeds."""

    def __init__(self, weights: Iterable[Tensor], rate: float, largest: float):
        """Sets the weights.

        Args:
            weights: Weights (seeds, ...).
            rate: Learning rate.
            largest: Maximum norm of a seed's gradient.
        """
        self._weights, self._rate, self._largest = [*weights], rate, largest
        self._means = [torch.zeros_like(weight) for weight in self._weights]
        self._squares = [torch.zeros_like(weight) for weight in self._weights]
        first = self._weights[0]
        self._count = torch.zeros(len(first), device=first.device)

    def step(self, losses: Tensor, going: Tensor) -> None:
        """Takes a step on the loss of each seed.

        Args:
            losses: Losses (seeds,).
            going: Whether a seed takes the step (seeds,); others do not change.
        """
        gradients = torch.autograd.grad(losses.sum(), self._weights)
        with torch.no_grad():
            norm = sum(gradient.flatten(1).square().sum(1) for gradient in gradients).sqrt()
            share = (self._largest / (norm + 1e-6)).clamp(max=1.0)
            self._count += going
            # The clamp concerns seeds without any step so far.
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
        """Returns the state from which `set_state` continues exactly."""
        return {
            "means": [mean.clone() for mean in self._means],
            "squares": [square.clone() for square in self._squares],
            "count": self._count.clone(),
        }

    def set_state(self, state: Mapping[str, Any]) -> None:
        """Restores a state of `get_state`."""
        for own, saved in zip(
            [*self._means, *self._squares, self._count],
            [*state["means"], *state["squares"], state["count"]],
            strict=True,
        ):
            own.copy_(saved)
