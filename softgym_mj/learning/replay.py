"""`Replay`: what environments of several seeds have gone through, and batches of it."""

import functools
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
import torch
from torch import Tensor

from softgym_mj.exceptions import check_count
from softgym_mj.learning.networks import generators
from softgym_mj.learning.sac import Batch
from softgym_mj.learning.symmetries import Symmetry


class Replay:
    """The newest env steps of environments that step together: (steps, seeds, worlds, ...).

    Each seed learns from worlds of its own.

    Attributes:
        size: how many vector steps there are.
    """

    def __init__(
        self,
        capacity: int,
        seeds: Sequence[int],
        worlds: int,
        observation: int,
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
            worlds: of each seed.
            observation, action: sizes.
            discount: of rewards, in each env step.
            steps: env steps whose rewards are added up, until the episode ends.
            symmetries: each step that is learned from is shown by one of them; none as it was.
            device: where.
        """
        self._steps = check_count("steps", steps, 1, capacity)
        self._capacity, self._discount, self.size, self._next = capacity, discount, 0, 0
        self._seeds, self._worlds = len(seeds), worlds
        self._sources = generators(seeds, device)
        lead = capacity, len(seeds), worlds
        self._kept = {
            "observation": torch.zeros(*lead, observation, device=device),
            "action": torch.zeros(*lead, action, device=device),
            "reward": torch.zeros(lead, device=device),
            "next_observation": torch.zeros(*lead, observation, device=device),
            "terminated": torch.zeros(lead, dtype=torch.bool, device=device),
            "ended": torch.zeros(lead, dtype=torch.bool, device=device),
        }
        self._symmetries: tuple[Tensor, ...] = ()
        if symmetries:
            self._symmetries = tuple(
                torch.tensor(
                    np.stack([getattr(s, name) for s in symmetries]), device=device
                ).float()
                for name in ("observation", "action")
            )

    def add(self, **arrays: Tensor) -> None:
        """Keeps a vector step.

        Args:
            **arrays: observation, action, reward, next_observation, and whether the simulation has
                diverged (terminated) or the episode is over for any reason (ended): each (seeds *
                worlds, ...), those of a seed one after the other. The next observation is of the
                same episode.
        """
        for name, kept in self._kept.items():
            kept[self._next] = arrays[name].reshape(kept.shape[1:]).to(kept.dtype)
        self._next = (self._next + 1) % self._capacity
        self.size = min(self.size + 1, self._capacity)

    def sample(self, number: int) -> Batch:
        """A batch of so many steps for each seed, drawn with equal chances.

        There must have been as many vector steps as are added up.
        """
        oldest = self._next if self.size == self._capacity else 0
        begins, worlds, shown = [], [], []
        for source in self._sources:  # Each draws the same numbers whoever is beside it.
            draw = functools.partial(
                torch.randint, size=(number,), generator=source, device=source.device
            )
            begins.append(draw(self.size - self._steps + 1))
            worlds.append(draw(self._worlds))
            if self._symmetries:
                shown.append(draw(len(self._symmetries[0])))
        first, world = torch.stack(begins), torch.stack(worlds)
        batch = self._added_up((oldest + first) % self._capacity, world)
        return self._shown(batch, torch.stack(shown)) if shown else batch

    def _added_up(self, first: Tensor, world: Tensor) -> Batch:
        """The batch that begins in these vector steps and worlds (seeds, number)."""
        seed = torch.arange(self._seeds, device=first.device)[:, None]
        kept = self._kept
        observation = kept["observation"][first, seed, world]
        action = kept["action"][first, seed, world]
        reward, factor = torch.zeros(first.shape, device=first.device), 1.0
        going = torch.ones_like(reward)  # Whether the episode still goes on.
        last, discount = first, torch.zeros_like(reward)
        for k in range(self._steps):
            at = (first + k) % self._capacity
            reward = reward + going * factor * kept["reward"][at, seed, world]
            last = torch.where(going > 0, at, last)
            factor *= self._discount
            # Of an episode that has come to its horizon the value goes on.
            lives = (~kept["terminated"][at, seed, world]).float()
            discount = torch.where(going > 0, factor * lives, discount)
            going = going * (~kept["ended"][at, seed, world]).float()
        following = kept["next_observation"][last, seed, world]
        return Batch(observation, action, reward, following, discount)

    def _shown(self, batch: Batch, which: Tensor) -> Batch:
        """Each step by the symmetry of a number (seeds, number)."""
        of_observations, of_actions = self._symmetries

        def turned(matrices: Tensor, values: Tensor) -> Tensor:
            return torch.einsum("snij,snj->sni", matrices[which], values)

        return Batch(
            turned(of_observations, batch.observation),
            turned(of_actions, batch.action),
            batch.reward,
            turned(of_observations, batch.next_observation),
            batch.discount,
        )

    # ------------------------------------------------------------------ state

    def get_state(self) -> dict[str, Any]:
        """All that `set_state` needs to go on with the same numbers."""
        return {
            "kept": {name: array[: self.size].clone() for name, array in self._kept.items()},
            "size": self.size,
            "next": self._next,
            "random": [source.get_state() for source in self._sources],
        }

    def set_state(self, state: Mapping[str, Any]) -> None:
        """Goes on from what `get_state` returned."""
        self.size, self._next = state["size"], state["next"]
        for name, array in state["kept"].items():
            self._kept[name][: self.size] = array
        for source, kept in zip(self._sources, state["random"], strict=True):
            source.set_state(kept)
