"""Optimization of several seeds that are trained together."""

from collections.abc import Iterable, Sequence
from typing import Any

import torch
from torch import Tensor, nn

_TINY = 1e-6  # Added to a norm in a denominator (PyTorch's value).


def adam(
    parameters: Iterable[Tensor], rate: float | Tensor, beta: float = 0.9, **settings: Any
) -> torch.optim.Adam:
    """Returns an Adam optimizer whose steps can be part of a CUDA graph.

    Args:
        parameters: Parameters of networks of several seeds, all on one device.
        rate: Learning rate; a tensor on the device may change.
        beta: Adam's beta_1.
        **settings: Further arguments of `torch.optim.Adam`.
    """
    weights = [*parameters]
    on_gpu = weights[0].device.type == "cuda"
    # `capturable` keeps Adam's step count on the device.
    return torch.optim.Adam(
        weights, rate, (beta, 0.999), capturable=on_gpu, fused=on_gpu, **settings
    )


def step(optimizer: torch.optim.Adam, losses: Tensor) -> None:
    """Takes a step on losses (seeds,); the weights of a seed depend on its own loss alone."""
    optimizer.zero_grad(set_to_none=True)
    losses.sum().backward()
    optimizer.step()


def polyak_update(targets: nn.Module, own: nn.Module, share: float) -> None:
    """Moves target weights towards the online weights by this share (Polyak averaging)."""
    with torch.no_grad():
        torch._foreach_lerp_([*targets.parameters()], [*own.parameters()], share)


def clip_grad_norm(parameters: Sequence[Tensor], seeds: int, largest: float) -> None:
    """Clips the gradient norm of each seed, of parameters (seeds, ...), to `largest`."""
    gradients = [p.grad for p in parameters if p.grad is not None]
    squares = [gradient.reshape(seeds, -1).square().sum(-1) for gradient in gradients]
    factor = (largest / (torch.stack(squares).sum(0).sqrt() + _TINY)).clamp(max=1.0)
    for gradient in gradients:
        of_each = factor[:, None].expand(-1, len(gradient) // seeds)
        gradient.mul_(of_each.reshape(-1, *[1] * (gradient.ndim - 1)))
