"""Forms in which symmetries show what is seen and done: orders and signs of its numbers."""

from collections.abc import Callable, Sequence

import numpy as np
import torch
from torch import Tensor, nn

from softgym_mj.learning.symmetries import Symmetry


def signed_orders(
    symmetries: Sequence[Symmetry], device: torch.device | str
) -> tuple[Tensor, Tensor, Tensor, Tensor]:
    """Order and sign (symmetries, n) by which numbers are taken: of observations, of actions."""
    result: list[Tensor] = []
    for name in ("observation", "action"):
        matrices = np.stack([getattr(symmetry, name) for symmetry in symmetries])
        # Turns by right angles and mirrors: one entry of 1 or -1 in a row.
        assert (np.count_nonzero(matrices, axis=-1) == 1).all() and (abs(matrices) <= 1.0).all()
        orders = np.abs(matrices).argmax(-1)
        signs = np.take_along_axis(matrices, orders[..., None], -1)[..., 0]
        result += [torch.tensor(orders, device=device), torch.tensor(signs, device=device).float()]
    return result[0], result[1], result[2], result[3]


class SymmetrizedPolicy(nn.Module):
    """A policy's mean over the forms of what it sees, each action turned back.

    So it does the same in all of them, and errs less. Those that exchange pickers are left out:
    which one goes first is a choice, of which there is no mean.
    """

    def __init__(
        self,
        policy: Callable[[Tensor], Tensor],
        symmetries: Sequence[Symmetry],
        device: torch.device | str,
    ):
        """Takes a policy.

        Args:
            policy: actions (..., action) of observations (..., n, observation).
            symmetries: of the task.
            device: where.
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
        """Actions (..., n, action) of observations (..., n, observation)."""
        result = [
            self.policy(observation[..., order] * sign)[..., back] * turn
            for order, sign, back, turn in zip(
                self.orders, self.signs, self.back, self.turns, strict=True
            )
        ]
        return torch.stack(result).mean(0)
