"""Steps of optimizers, of several seeds that are trained together."""

from collections.abc import Iterable, Sequence
from typing import Any

import torch
from torch import Tensor, nn

_TINY = 1e-6  # Added to a norm that divides (PyTorch's).


def adam(
    parameters: Iterable[Tensor], rate: float | Tensor, beta: float = 0.9, **settings: Any
) -> torch.optim.Adam:
    """An optimizer whose steps can be part of one of CUDA's graphs.

    Args:
        parameters: of networks of several seeds, all on one device.
        rate: of learning; a number of the device may change.
        beta: Adam's first one.
        **settings: of `torch.optim.Adam`.
    """
    weights = [*parameters]
    on_gpu = weights[0].device.type == "cuda"
    # Capturable: what Adam counts lies beside the weights.
    return torch.optim.Adam(
        weights, rate, (beta, 0.999), capturable=on_gpu, fused=on_gpu, **settings
    )


def step(optimizer: torch.optim.Adam, losses: Tensor) -> None:
    """Each seed's weights follow its own loss (seeds,): nothing mixes them."""
    optimizer.zero_grad(set_to_none=True)
    losses.sum().backward()
    optimizer.step()


def polyak_update(targets: nn.Module, own: nn.Module, share: float) -> None:
    """Moves each weight of targets by this share of the way to those that they follow."""
    with torch.no_grad():
        torch._foreach_lerp_([*targets.parameters()], [*own.parameters()], share)


def clip_grad_norm(parameters: Sequence[Tensor], seeds: int, largest: float) -> None:
    """Scales gradients of arrays (a number for each seed, ...) to a norm in each seed, at most."""
    gradients = [p.grad for p in parameters if p.grad is not None]
    squares = [gradient.reshape(seeds, -1).square().sum(-1) for gradient in gradients]
    factor = (largest / (torch.stack(squares).sum(0).sqrt() + _TINY)).clamp(max=1.0)
    for gradient in gradients:
        of_each = factor[:, None].expand(-1, len(gradient) // seeds)
        gradient.mul_(of_each.reshape(-1, *[1] * (gradient.ndim - 1)))
