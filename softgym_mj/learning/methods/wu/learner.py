"""Pick-and-place of Wu et al. (RSS 2020) for several seeds: soft actor-critic of place points.

During training, pick points are random cloth pixels and a policy predicts the place point. The best
action maximizes the critics' value over all cloth pixels. The actor is "pixel_pick_and_place".

Numbers marked [S] are from softagent's `rlpyt_cloth`: `configs/dm_control/qpg/sac/softgym_sac.py`,
`algos/qpg/sac_v2.py`, `agents/qpg/sac_agent_v2.py`, `models/conv2d.py`. Differences: critics rate
executed places (there: means before tanh), the actor is updated after the critics, random places
are uniform, and initial weights are orthogonal.
"""

import dataclasses
import math
from collections.abc import Sequence
from typing import Any

import torch
from torch import Tensor, nn

from softgym_mj.exceptions import InvalidArgumentError, check_count, check_number
from softgym_mj.learning.learner import Problem, UnexportableError
from softgym_mj.learning.methods.pixels import picture_size
from softgym_mj.learning.methods.sac import SAC, SACSettings
from softgym_mj.learning.methods.wu.cloth_pixels import cloth_pixels, pixel_centers
from softgym_mj.learning.methods.wu.networks import PICK, Judging, Looking, Placing, seen
from softgym_mj.learning.networks import Actor, drawn, generators, whole_numbers
from softgym_mj.learning.off_policy import OffPolicy
from softgym_mj.learning.replay import Batch
from softgym_mj.validation import typed

_PLACE = 3  # Size of a place point.
_LEAST = 8  # Minimum side of an image [pixels].
_AT_ONCE = 16  # Images of each seed whose cloth pixels are rated together, in at most 1 GB.


@typed
@dataclasses.dataclass(frozen=True)
class WuSettings(SACSettings):
    """Settings of the method; the defaults are the paper's.

    Attributes:
        channels: Channels of each convolution.
        best_share: Share of cloth pixels of highest value from which the action is drawn.
        bfloat16: Whether convolutions compute in bfloat16 with 32-bit weights.

    Raises:
        InvalidArgumentError: for a value out of range.
    """

    random_steps: int = 10_000
    updates: int = 2
    batch: int = 1024
    replay: int = 600_000
    hidden: tuple[int, ...] = (256, 256)
    tau: float = 0.005
    actor_rate: float = 6e-4
    critic_rate: float = 1e-3
    alpha_rate: float = 6e-4
    alpha: float = 1.0
    alpha_beta: float = 0.9
    actor_every: int = 1
    target_every: int = 1
    log_std: tuple[float, float] = (-20.0, 2.0)
    channels: tuple[int, ...] = (64, 64, 4)
    best_share: float = 0.2
    bfloat16: bool = False

    def __post_init__(self):
        super().__post_init__()
        for number in self.channels:
            check_count("channels", number, 1)
        check_number("best_share", self.best_share, gt=0.0, le=1.0)
        if self.symmetric:
            raise InvalidArgumentError("symmetric", True, "False: images have no symmetries")


class PickAndPlace(SAC):
    """Soft actor-critic of place points, for random pick points."""

    settings: WuSettings

    def __init__(
        self,
        settings: WuSettings,
        seeds: Sequence[int],
        size: tuple[int, int],
        device: torch.device | str = "cpu",
    ):
        """Draws the networks for images of a size; other arguments are those of `SAC`."""
        self._size, self._centers = size, pixel_centers(*size, device)
        super().__init__(settings, seeds, 0, _PLACE, device)

    def _networks(self, observation: int, action: int) -> tuple[Actor, nn.Module]:
        settings = self.settings
        own = self.sources, settings.channels, self._size, settings.hidden
        kind = torch.bfloat16 if settings.bfloat16 else torch.float32
        actor = Placing(Looking(*own, 2 * action, kind=kind), settings.log_std)
        pair = [Looking(*own, 1, place=action, norm=settings.norm, kind=kind) for _ in range(2)]
        return actor, Judging(pair)

    def draw_pick(self, images: Tensor) -> Tensor:
        """Returns centers (seeds, n, 2) of cloth pixels, drawn uniformly."""
        mask = _candidates(images)
        rank = whole_numbers(drawn(self.sources, mask.shape[1], normal=False), mask.sum(-1))
        return self._centers[(mask.cumsum(-1) <= rank[..., None]).sum(-1)]

    def act(self, observation: Tensor, *, explore: bool) -> Tensor:
        """Returns actions (seeds, n, 5) for images (seeds, n, height, width, 3)."""
        if not explore:
            return self.best(observation, self.sources)
        with torch.no_grad():
            pick = self.draw_pick(observation)
            noise = self._noise(observation.shape[1], _PLACE)
            return torch.cat([pick, self.actor.sample(seen(observation, pick), noise)[0]], -1)

    def best(self, images: Tensor, sources: Sequence[torch.Generator]) -> Tensor:
        """Returns actions (seeds, n, 5): one of the best cloth pixels, with its mean place.

        Args:
            images: Images (seeds, n, height, width, 3).
            sources: Random generators of the choice.
        """
        with torch.no_grad():
            shares = drawn(sources, images.shape[1], normal=False)
            parts = zip(images.split(_AT_ONCE, 1), shares.split(_AT_ONCE, 1), strict=True)
            return torch.cat([self._best(*part) for part in parts], 1)

    def _best(self, images: Tensor, shares: Tensor) -> Tensor:
        """Returns actions (seeds, n, 5) of some images (seeds, n, height, width, 3)."""
        mask, lead = _candidates(images), images.shape[:2]
        count = mask.sum(-1)
        # Cloth pixels come first; the number is the maximum over images.
        order = mask.byte().argsort(dim=-1, descending=True, stable=True)[..., : int(count.max())]
        pick = self._centers[order]  # (seeds, n, pixels, 2).
        flat, pixels = pick.flatten(1, 2), order.shape[-1]
        looking = [self.actor.body, *self.critics.pair]
        result, *pair = (own.convolutions(images).repeat_interleave(pixels, 1) for own in looking)
        place = self.actor.body.judge(result, flat).chunk(2, dim=-1)[0].tanh()
        judged = [
            critic.judge(features, flat, place)[..., 0].unflatten(1, (-1, pixels))
            for critic, features in zip(self.critics.pair, pair, strict=True)
        ]
        value = self._reduce_critics(torch.stack(judged)).where(mask.gather(-1, order), -math.inf)
        number = (self.settings.best_share * count).ceil().long()
        rank = whole_numbers(shares, number)[..., None]
        at = value.argsort(-1, descending=True).gather(-1, rank)[..., None]
        return torch.cat([pick, place.unflatten(1, (lead[1], -1))], -1).take_along_dim(at, 2)[
            :, :, 0
        ]

    # ------------------------------------------------------------------ losses

    def update(self, batch: Batch) -> dict[str, Tensor]:
        """Makes one update from images; returns losses and entropy weights (seeds,) by name."""
        pick, place = batch.action.split([PICK, _PLACE], -1)
        following = self.draw_pick(batch.next_observation)
        return super().update(
            dataclasses.replace(
                batch,
                observation=seen(batch.observation, pick),
                action=place,
                next_observation=seen(batch.next_observation, following),
            )
        )

    def critic_loss(self, batch: Batch, noise: Tensor) -> Tensor:
        """Returns half of SAC's critic loss (seeds,) [S], of `seen` arrays and place points."""
        return 0.5 * super().critic_loss(batch, noise)

    def actor_losses(self, batch: Batch, noise: Tensor) -> tuple[Tensor, Tensor]:
        """Returns losses of the actor and of the logarithm of the entropy weight (seeds,) [S]."""
        actor, alpha = super().actor_losses(batch, noise)
        return actor, self.log_alpha * (alpha.detach() / self.alpha)

    def policy(self, seed: int) -> nn.Module:
        """Returns the policy of the seed at an index.

        Raises:
            UnexportableError: always.
        """
        valid = "a method with deterministic actions; this one samples the best actions"
        raise UnexportableError("method", "wu", valid)


def _candidates(images: Tensor) -> Tensor:
    """Returns which pixels (seeds, n, height * width) may be picked: cloth, or all if none is."""
    mask = cloth_pixels(images).flatten(2)
    return mask | ~mask.any(-1, keepdim=True)


class Picking(OffPolicy):
    """Off-policy learner whose random actions also pick cloth pixels."""

    algorithm: PickAndPlace

    def act(
        self, observation: Tensor, first: Tensor, memory: Any, *, explore: bool
    ) -> tuple[Tensor, Any]:
        """Returns actions; evaluations have random generators of their own, in `memory`."""
        if not explore:
            memory = memory or generators(self._problem.seeds, self._problem.device)
            return self.algorithm.best(observation, memory), memory
        action, _ = super().act(observation, first, memory, explore=True)
        if self._env_steps < self._settings.random_steps:
            action[..., :PICK] = self.algorithm.draw_pick(observation)
        return action, None


def make(settings: WuSettings, problem: Problem) -> OffPolicy:
    """Returns the `Learner` of a problem.

    Raises:
        InvalidArgumentError: for a problem without images, or of another actor.
    """
    size = picture_size(problem, _LEAST)
    if problem.action != PICK + _PLACE:
        actor = problem.task_settings.get("actor")
        raise InvalidArgumentError("actor", actor, ["pixel_pick_and_place"])
    return Picking(settings, problem, PickAndPlace(settings, problem.seeds, size, problem.device))
