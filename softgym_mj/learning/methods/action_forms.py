"""Forms of a student's actions: what its network outputs, which action it takes, and its loss."""

import dataclasses
from typing import Protocol

import torch
from torch import Tensor, nn

_WINDOW = 0.5  # Standard deviation of the window in which bins are averaged, of values in -1..1.


class ActionForm(Protocol):
    """Protocol of the forms."""

    def size(self, action: int) -> int:
        """Returns the number of outputs for an action of a size."""

    def chosen(self, outputs: Tensor) -> Tensor:
        """Returns actions (n, action) in -1..1 of outputs (n, size)."""

    def loss(self, outputs: Tensor, labels: Tensor) -> Tensor:
        """Returns the mean loss () of outputs (n, size) for labels (n, action)."""


@dataclasses.dataclass(frozen=True)
class Values:
    """One number for each entry of an action, fitted by the smooth L1 loss.

    Attributes:
        beta: Error at which the loss changes from quadratic to linear.
    """

    beta: float

    def size(self, action: int) -> int:
        """Returns the size of the action."""
        return action

    def chosen(self, outputs: Tensor) -> Tensor:
        """Returns the hyperbolic tangents of the outputs."""
        return torch.tanh(outputs)

    def loss(self, outputs: Tensor, labels: Tensor) -> Tensor:
        """Returns the mean smooth L1 distance from the labels."""
        return nn.functional.smooth_l1_loss(self.chosen(outputs), labels, beta=self.beta)


@dataclasses.dataclass(frozen=True)
class Bins:
    """Probabilities of several values for each entry of an action, fitted by the cross entropy.

    Attributes:
        number: Number of values, evenly spaced in -1..1.
    """

    number: int

    def size(self, action: int) -> int:
        """Returns the number of values of all entries."""
        return action * self.number

    def chosen(self, outputs: Tensor) -> Tensor:
        """Returns the actions of the highest peaks.

        A Gaussian window stands where it holds the most; the action is the mean in it. The single
        best value jumps from one env step to the next where two are nearly as good.
        """
        values = self._values(outputs)
        windows = torch.exp(-0.5 * ((values[:, None] - values) / _WINDOW) ** 2)
        shares = self._scores(outputs).float().softmax(-1)
        inside = shares * windows[(shares @ windows).argmax(-1)]
        return (inside * values).sum(-1) / inside.sum(-1)

    def loss(self, outputs: Tensor, labels: Tensor) -> Tensor:
        """Returns the mean cross entropy.

        Labels between two values belong to both, in proportion to their nearness.
        """
        width = 2.0 / (self.number - 1)
        shares = (1.0 - (labels[..., None] - self._values(labels)).abs() / width).clamp(min=0.0)
        return -(shares * self._scores(outputs).log_softmax(-1)).sum(-1).mean()

    def _values(self, like: Tensor) -> Tensor:
        return torch.linspace(-1.0, 1.0, self.number, device=like.device)

    def _scores(self, outputs: Tensor) -> Tensor:
        return outputs.unflatten(-1, (-1, self.number))
