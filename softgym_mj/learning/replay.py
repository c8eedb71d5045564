"""`Replay`: a replay buffer of several seeds, and its batches."""

import dataclasses
import logging
from collections.abc import Mapping, Sequence
from typing import Any

import torch
from torch import Tensor

from softgym_mj.exceptions import check_count
from softgym_mj.learning.forms import signed_orders
from softgym_mj.learning.learner import Step
from softgym_mj.learning.networks import drawn, generators, whole_numbers
from softgym_mj.learning.symmetries import Symmetry

# Newest env steps of each seed whose images are in a state; all images are tens of gigabytes.
NEWEST_IMAGES = 20_000
_log = logging.getLogger(__name__)


@dataclasses.dataclass(frozen=True)
class Batch:
    """Batch of n-step transitions, with arrays (seeds, n, ...).

    Attributes:
        observation, action, next_observation: Arrays (seeds, n, ...).
        reward: Discounted sums of rewards (seeds, n) up to the next observation.
        discount: Discount (seeds, n) of the next observation's value; 0 after a termination.
    """

    observation: Tensor
    action: Tensor
    reward: Tensor
    next_observation: Tensor
    discount: Tensor


class Replay:
    """Replay buffer of the newest vector steps: arrays (steps, seeds, num_envs, ...).

    Each seed has environments of its own. `sample` does not synchronize with the device, so it can
    be part of a CUDA graph.

    Attributes:
        size: Number of vector steps.
        discount: Discount per env step: a tensor on the device, which may change.
    """

    def __init__(
        self,
        capacity: int,
        seeds: Sequence[int],
        num_envs: int,
        observation: tuple[int, ...],
        action: int,
        *,
        discount: float,
        steps: int = 1,
        symmetries: Sequence[Symmetry] = (),
        device: torch.device | str = "cpu",
    ):
        """Allocates the buffer.

        Args:
            capacity: Maximum number of vector steps.
            seeds: Seeds of the samples.
            num_envs: Number of environments of each seed.
            observation: Shape of an observation; images are stored as uint8, others as float32.
            action: Size of an action.
            discount: Discount per env step.
            steps: Number of steps in n-step returns, which stop at the end of an episode.
            symmetries: Symmetries of which a random one transforms each sampled step.
            device: PyTorch device.
        """
        self._steps = check_count("steps", steps, 1, capacity)
        self._capacity, self.size, self._next = capacity, 0, 0
        self.discount = torch.full((), discount, device=device)
        self._seeds, self._num_envs = len(seeds), num_envs
        self._sources = generators(seeds, device)
        lead = capacity, len(seeds), num_envs
        kind = torch.uint8 if len(observation) == 3 else torch.float32
        self.arrays = {
            "observation": torch.zeros(*lead, *observation, dtype=kind, device=device),
            "action": torch.zeros(*lead, action, device=device),
            "reward": torch.zeros(lead, device=device),
            "next_observation": torch.zeros(*lead, *observation, dtype=kind, device=device),
            "terminated": torch.zeros(lead, dtype=torch.bool, device=device),
            "ended": torch.zeros(lead, dtype=torch.bool, device=device),
        }
        # Number of vector steps and index of the oldest, which `sample` reads on the device.
        self._extent = torch.zeros(2, dtype=torch.int64, device=device)
        self._symmetries = signed_orders(symmetries, device) if symmetries else None

    @property
    def sources(self) -> list[torch.Generator]:
        """Random generators of samples, one per seed."""
        return self._sources

    def add(self, step: Step) -> None:
        """Adds a vector step."""
        for name, array in self.arrays.items():
            array[self._next] = getattr(step, name).reshape(array.shape[1:]).to(array.dtype)
        self._next = (self._next + 1) % self._capacity
        self.size = min(self.size + 1, self._capacity)
        self._note()

    def _note(self) -> None:
        """Copies the number of vector steps to the device."""
        self._extent[0].fill_(self.size)
        self._extent[1].fill_(self._next if self.size == self._capacity else 0)

    def sample(self, number: int) -> Batch:
        """Samples `number` steps of each seed uniformly.

        The buffer must have at least as many vector steps as n-step returns.
        """
        size, oldest = self._extent
        # The samples of a seed do not depend on the other seeds.
        shares = drawn(self._sources, 3, number, normal=False)
        first = whole_numbers(shares[:, 0], size - (self._steps - 1))
        batch = self._added_up(
            (oldest + first) % self._capacity, whole_numbers(shares[:, 1], self._num_envs)
        )
        if self._symmetries is None:
            return batch
        return _shown(
            batch, whole_numbers(shares[:, 2], len(self._symmetries[0])), *self._symmetries
        )

    def slices(self, number: int, length: int) -> Step:
        """Samples sequences of vector steps of each seed: (seeds, number, length, ...).

        A sequence may cross the end of an episode, where `ended` is true. The buffer must have at
        least `length` vector steps.
        """
        size, oldest = self._extent
        shares = drawn(self._sources, 2, number, normal=False)
        first = (oldest + whole_numbers(shares[:, 0], size - (length - 1)))[..., None]
        seed = torch.arange(self._seeds, device=first.device)[:, None, None]
        at = (first + torch.arange(length, device=first.device)) % self._capacity
        env_index = whole_numbers(shares[:, 1], self._num_envs)[..., None]
        return Step(*(self.arrays[name][at, seed, env_index] for name in Step._fields))

    def _added_up(self, first: Tensor, env_index: Tensor) -> Batch:
        """Returns the batch that starts at these vector steps and environments (seeds, number)."""
        seed = torch.arange(self._seeds, device=first.device)[:, None]
        arrays = self.arrays
        observation = arrays["observation"][first, seed, env_index]
        action = arrays["action"][first, seed, env_index]
        reward = torch.zeros(first.shape, device=first.device)
        factor = torch.ones((), device=first.device)
        going = torch.ones_like(reward)  # 1 until the episode ends, then 0.
        last, discount = first, torch.zeros_like(reward)
        for k in range(self._steps):
            at = (first + k) % self._capacity
            reward = reward + going * factor * arrays["reward"][at, seed, env_index]
            last = torch.where(going > 0, at, last)
            factor = factor * self.discount
            # Truncated episodes bootstrap from the value; only terminations end the return.
            lives = (~arrays["terminated"][at, seed, env_index]).float()
            discount = torch.where(going > 0, factor * lives, discount)
            going = going * (~arrays["ended"][at, seed, env_index]).float()
        following = arrays["next_observation"][last, seed, env_index]
        return Batch(observation, action, reward, following, discount)

    # ------------------------------------------------------------------ state

    def get_state(self) -> dict[str, Any]:
        """Returns the state from which `set_state` continues, with the newest images only."""
        number, following, which = self.size, self._next, slice(0, self.size)
        if self.arrays["observation"].dtype == torch.uint8:
            number = min(self.size, -(-NEWEST_IMAGES // self._num_envs))
        if number < self.size:
            which = (torch.arange(number) + self._next - number) % self._capacity
            following = number % self._capacity
        return {
            "arrays": {name: array[which].clone() for name, array in self.arrays.items()},
            "size": number,
            "whole": self.size,
            "next": following,
            "random": [source.get_state() for source in self._sources],
        }

    def set_state(self, state: Mapping[str, Any]) -> None:
        """Restores a state of `get_state`."""
        self.size, self._next = state["size"], state["next"]
        if self.size < state["whole"]:
            _log.info("Continues with the newest %d of %d steps", self.size, state["whole"])
        for name, array in state["arrays"].items():
            self.arrays[name][: self.size] = array
        for source, saved in zip(self._sources, state["random"], strict=True):
            source.set_state(saved)
        self._note()


def _shown(
    batch: Batch, which: Tensor, orders: Tensor, signs: Tensor, of_actions: Tensor, turns: Tensor
) -> Batch:
    """Transforms each step by the symmetry of an index (seeds, n), given by orders and signs."""

    def turned(values: Tensor) -> Tensor:
        return values.gather(-1, orders[which]) * signs[which]

    return Batch(
        turned(batch.observation),
        batch.action.gather(-1, of_actions[which]) * turns[which],
        batch.reward,
        turned(batch.next_observation),
        batch.discount,
    )
