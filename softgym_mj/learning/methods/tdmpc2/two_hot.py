"""Discrete regression with two-hot targets after a symmetric logarithm.

As in DreamerV3 (Hafner et al., 2023) and TD-MPC2 (Hansen et al., 2024), a cross entropy makes the
loss independent of the scale of the numbers.
"""

import torch
from torch import Tensor

LOW, HIGH = -10.0, 10.0  # Centers of the outer bins (TD-MPC2): numbers up to 22,025.


def symlog(x: Tensor) -> Tensor:
    """Returns sign(x) log(1 + |x|)."""
    return x.sign() * x.abs().log1p()


def symexp(x: Tensor) -> Tensor:
    """Returns the inverse of `symlog`."""
    return x.sign() * x.abs().expm1()


def two_hot(x: Tensor, bins: int) -> Tensor:
    """Returns two-hot encodings (..., bins) of numbers (...), clamped to the outer bins."""
    place = (symlog(x).clamp(LOW, HIGH) - LOW) * ((bins - 1) / (HIGH - LOW))
    away = (place[..., None] - torch.arange(bins, device=x.device)).abs()
    return (1.0 - away).clamp(min=0.0)


def expected(logits: Tensor) -> Tensor:
    """Returns the expected numbers (...) of logits (..., bins)."""
    centers = torch.linspace(LOW, HIGH, logits.shape[-1], device=logits.device)
    return symexp((logits.softmax(-1) * centers).sum(-1))


def cross_entropy(logits: Tensor, target: Tensor) -> Tensor:
    """Returns the cross entropy (...) of logits (..., bins) and target numbers (...)."""
    return -(two_hot(target, logits.shape[-1]) * logits.log_softmax(-1)).sum(-1)
