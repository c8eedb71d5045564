"""`Replay`: what environments of several seeds have gone through, and batches of it."""

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

# Env steps of each seed whose images go into a state, the newest ones: all of them are tens of GB.
NEWEST_IMAGES = 20_000
_log = logging.getLogger(__name__)


@dataclasses.dataclass(frozen=True)
class Batch:
    """Steps to learn from, (seeds, n, ...) each.

    Attributes:
        observation, action, next_observation: (seeds, n, ...).
        reward: sums (seeds, n) up to the next observation, discounted.
        discount: factor (seeds, n) to the value of the next observation: 0 where there is none.
    """

    observation: Tensor
    action: Tensor
    reward: Tensor
    next_observation: Tensor
    discount: Tensor


class Replay:
    """The newest env steps of environments that step together: (steps, seeds, num_envs, ...).

    Each seed learns from environments of its own. Nothing in `sample` asks for a number of the
    device, so that it can be part of one of CUDA's graphs.

    Attributes:
        size: how many vector steps there are.
        discount: of rewards in each env step: a number on the device, which may change.
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
        """Makes room.

        Args:
            capacity: vector steps that are kept; older ones make way.
            seeds: of random numbers.
            num_envs: of each seed.
            observation: shape; those of images are kept as uint8, others as float32.
            action: size.
            discount: of rewards, in each env step.
            steps: env steps whose rewards are added up, until the episode ends.
            symmetries: each step that is learned from is shown by one of them; none as it was.
            device: where.
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
        # How many vector steps there are, and which is the oldest: what `sample` reads.
        self._extent = torch.zeros(2, dtype=torch.int64, device=device)
        self._symmetries = signed_orders(symmetries, device) if symmetries else None

    @property
    def sources(self) -> list[torch.Generator]:
        """Where the random numbers come from."""
        return self._sources

    def add(self, step: Step) -> None:
        """Keeps a vector step."""
        for name, array in self.arrays.items():
            array[self._next] = getattr(step, name).reshape(array.shape[1:]).to(array.dtype)
        self._next = (self._next + 1) % self._capacity
        self.size = min(self.size + 1, self._capacity)
        self._note()

    def _note(self) -> None:
        """Tells the device how many vector steps there are."""
        self._extent[0].fill_(self.size)
        self._extent[1].fill_(self._next if self.size == self._capacity else 0)

    def sample(self, number: int) -> Batch:
        """A batch of so many steps for each seed, drawn with equal chances.

        There must have been as many vector steps as are added up.
        """
        size, oldest = self._extent
        # Each seed draws the same numbers whoever is beside it.
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
        """So many stretches of vector steps for each seed, (seeds, number, length, ...).

        A stretch may go beyond the end of an episode, which `ended` tells. There must have been as
        many vector steps as a stretch is long.
        """
        size, oldest = self._extent
        shares = drawn(self._sources, 2, number, normal=False)
        first = (oldest + whole_numbers(shares[:, 0], size - (length - 1)))[..., None]
        seed = torch.arange(self._seeds, device=first.device)[:, None, None]
        at = (first + torch.arange(length, device=first.device)) % self._capacity
        env_index = whole_numbers(shares[:, 1], self._num_envs)[..., None]
        return Step(*(self.arrays[name][at, seed, env_index] for name in Step._fields))

    def _added_up(self, first: Tensor, env_index: Tensor) -> Batch:
        """The batch that begins in these vector steps and environments (seeds, number)."""
        seed = torch.arange(self._seeds, device=first.device)[:, None]
        arrays = self.arrays
        observation = arrays["observation"][first, seed, env_index]
        action = arrays["action"][first, seed, env_index]
        reward = torch.zeros(first.shape, device=first.device)
        factor = torch.ones((), device=first.device)
        going = torch.ones_like(reward)  # Whether the episode still goes on.
        last, discount = first, torch.zeros_like(reward)
        for k in range(self._steps):
            at = (first + k) % self._capacity
            reward = reward + going * factor * arrays["reward"][at, seed, env_index]
            last = torch.where(going > 0, at, last)
            factor = factor * self.discount
            # Of an episode that has come to its horizon the value goes on.
            lives = (~arrays["terminated"][at, seed, env_index]).float()
            discount = torch.where(going > 0, factor * lives, discount)
            going = going * (~arrays["ended"][at, seed, env_index]).float()
        following = arrays["next_observation"][last, seed, env_index]
        return Batch(observation, action, reward, following, discount)

    # ------------------------------------------------------------------ state

    def get_state(self) -> dict[str, Any]:
        """All that `set_state` needs to go on with the same numbers; of images the newest ones."""
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
        """Goes on from what `get_state` returned."""
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
    """Each step by the symmetry of a number (seeds, n), of these orders and signs."""

    def turned(values: Tensor) -> Tensor:
        return values.gather(-1, orders[which]) * signs[which]

    return Batch(
        turned(batch.observation),
        batch.action.gather(-1, of_actions[which]) * turns[which],
        batch.reward,
        turned(batch.next_observation),
        batch.discount,
    )
