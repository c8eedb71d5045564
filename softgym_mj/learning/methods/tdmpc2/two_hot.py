"""Discrete regression: a number as shares of the two bins beside it, after a symmetric logarithm.

As in DreamerV3 (Hafner et al., 2023) and TD-MPC2 (Hansen et al., 2024): numbers of any size are
learned alike, by cross entropies.
"""

import torch
from torch import Tensor

LOW, HIGH = -10.0, 10.0  # Centers of the outer bins (TD-MPC2): numbers up to 22,025.


def symlog(x: Tensor) -> Tensor:
    """sign(x) log(1 + |x|)."""
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
    """Returns numbers (...) of which logits (..., bins) tell the shares."""
    centres = torch.linspace(LOW, HIGH, logits.shape[-1], device=logits.device)
    return symexp((logits.softmax(-1) * centres).sum(-1))


def cross_entropy(logits: Tensor, target: Tensor) -> Tensor:
    """Of logits (..., bins) and the numbers that are wanted: (...)."""
    return -(two_hot(target, logits.shape[-1]) * logits.log_softmax(-1)).sum(-1)
