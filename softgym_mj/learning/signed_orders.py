"""Symmetries as signed permutations of observations and actions."""

from collections.abc import Callable, Sequence

import numpy as np
import torch
from torch import Tensor, nn

from softgym_mj.learning.symmetries import Symmetry


def signed_orders(
    symmetries: Sequence[Symmetry], device: torch.device | str
) -> tuple[Tensor, Tensor, Tensor, Tensor]:
    """Returns orders and signs (symmetries, n) of observations, then of actions."""
    result: list[Tensor] = []
    for name in ("observation", "action"):
        matrices = np.stack([getattr(symmetry, name) for symmetry in symmetries])
        # Rotations by right angles and reflections have one entry of 1 or -1 in a row.
        assert (np.count_nonzero(matrices, axis=-1) == 1).all() and (abs(matrices) <= 1.0).all()
        orders = np.abs(matrices).argmax(-1)
        signs = np.take_along_axis(matrices, orders[..., None], -1)[..., 0]
        result += [torch.tensor(orders, device=device), torch.tensor(signs, device=device).float()]
    return result[0], result[1], result[2], result[3]


def turned(values: Tensor, which: Tensor, orders: Tensor, signs: Tensor) -> Tensor:
    """Returns values (..., n) under symmetries of indices (...), given their orders and signs."""
    return values.gather(-1, orders[which]) * signs[which]


class SymmetrizedPolicy(nn.Module):
    """Policy averaged over the symmetries of its task, which makes it equivariant.

    Each symmetry transforms the observation, and its inverse the action. Symmetries that exchange
    pickers are omitted: averaging over the choice of the picker that moves first is meaningless.
    """

    def __init__(
        self,
        policy: Callable[[Tensor], Tensor],
        symmetries: Sequence[Symmetry],
        device: torch.device | str,
    ):
        """Sets the policy.

        Args:
            policy: Maps observations (..., n, observation) to actions (..., n, action).
            symmetries: Symmetries of the task.
            device: PyTorch device.
        """
        super().__init__()
        own = [each for each in symmetries if each.pickers == tuple(sorted(each.pickers))]
        orders, signs, of_actions, turns = signed_orders(own, device)
        back = of_actions.argsort(-1)
        self.policy = policy
        self.register_buffer("orders", orders)
        self.register_buffer("signs", signs)
        self.register_buffer("back", back)
        self.register_buffer("turns", turns.gather(-1, back))

    def forward(self, observation: Tensor) -> Tensor:
        """Maps observations (..., n, observation) to actions (..., n, action)."""
        result = [
            self.policy(observation[..., order] * sign)[..., back] * turn
            for order, sign, back, turn in zip(
                self.orders, self.signs, self.back, self.turns, strict=True
            )
        ]
        return torch.stack(result).mean(0)
