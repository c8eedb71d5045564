"""`Replay`: a replay buffer of several seeds, and its batches."""

import dataclasses
from collections.abc import Sequence

import torch
from torch import Tensor

from softgym_mj.exceptions import check_count
from softgym_mj.learning.learner import Step
from softgym_mj.learning.networks import drawn, whole_numbers
from softgym_mj.learning.ring import NEWEST_IMAGES, Ring
from softgym_mj.learning.signed_orders import signed_orders, turned
from softgym_mj.learning.symmetries import Symmetry


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


class Replay(Ring):
    """Replay buffer of the newest vector steps.

    Attributes:
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
        self.discount = torch.full((), discount, device=device)
        kind = torch.uint8 if len(observation) == 3 else torch.float32
        entries = {
            "observation": (observation, kind),
            "action": ((action,), torch.float32),
            "reward": ((), torch.float32),
            "next_observation": (observation, kind),
            "terminated": ((), torch.bool),
            "ended": ((), torch.bool),
        }
        super().__init__(capacity, seeds, num_envs, entries, device)
        self._symmetries = signed_orders(symmetries, device) if symmetries else None

    def add(self, step: Step) -> None:
        """Adds a vector step."""
        self._append(step._asdict())

    def sample(self, number: int) -> Batch:
        """Samples `number` steps of each seed uniformly.

        The buffer must have at least as many vector steps as n-step returns.
        """
        size, oldest, _ = self._extent
        # The samples of a seed do not depend on the other seeds.
        shares = drawn(self.sources, 3, number, normal=False)
        first = whole_numbers(shares[:, 0], size - (self._steps - 1))
        batch = self._n_step_batch(
            (oldest + first) % self._capacity, whole_numbers(shares[:, 1], self._num_envs)
        )
        if self._symmetries is None:
            return batch
        return _transform(
            batch, whole_numbers(shares[:, 2], len(self._symmetries[0])), *self._symmetries
        )

    def slices(self, number: int, length: int) -> Step:
        """Samples sequences of vector steps of each seed: (seeds, number, length, ...).

        A sequence may cross the end of an episode, where `ended` is true. The buffer must have at
        least `length` vector steps.
        """
        size, oldest, _ = self._extent
        shares = drawn(self.sources, 2, number, normal=False)
        first = (oldest + whole_numbers(shares[:, 0], size - (length - 1)))[..., None]
        seed = torch.arange(len(self.sources), device=first.device)[:, None, None]
        at = (first + torch.arange(length, device=first.device)) % self._capacity
        env_index = whole_numbers(shares[:, 1], self._num_envs)[..., None]
        return Step(*(self.arrays[name][at, seed, env_index] for name in Step._fields))

    def _n_step_batch(self, first: Tensor, env_index: Tensor) -> Batch:
        """Returns the batch that starts at these vector steps and environments (seeds, number)."""
        seed = torch.arange(len(self.sources), device=first.device)[:, None]
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

    def _num_stored(self) -> int:
        if self.arrays["observation"].dtype != torch.uint8:
            return self.size
        return min(self.size, -(-NEWEST_IMAGES // self._num_envs))


def _transform(
    batch: Batch, which: Tensor, orders: Tensor, signs: Tensor, of_actions: Tensor, turns: Tensor
) -> Batch:
    """Transforms each step by the symmetry of an index (seeds, n), given by orders and signs."""
    return Batch(
        turned(batch.observation, which, orders, signs),
        turned(batch.action, which, of_actions, turns),
        batch.reward,
        turned(batch.next_observation, which, orders, signs),
        batch.discount,
    )
