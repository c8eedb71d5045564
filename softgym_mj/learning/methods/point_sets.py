"""Soft actor-critic on full states, with networks of point sets.

The same small network maps each point, together with the state of pickers or cups, to features,
which are pooled by mean (Deep Sets, Zaheer et al., 2017) and maximum (PointNet, Qi et al., 2017).
The result does not depend on the order of points.
"""

import dataclasses
from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np
import torch
from torch import Tensor, nn

from softgym_mj.envs.environment import Environment
from softgym_mj.exceptions import InvalidArgumentError
from softgym_mj.learning.learner import Problem
from softgym_mj.learning.methods.sac import SAC, SACSettings
from softgym_mj.learning.networks import MLP, Actor, Critics
from softgym_mj.learning.off_policy import OffPolicy
from softgym_mj.learning.replay import Replay
from softgym_mj.learning.symmetries import Symmetry, symmetries
from softgym_mj.validation import typed


@typed
@dataclasses.dataclass(frozen=True)
class PointSetSettings(SACSettings):
    """Settings of soft actor-critic on point sets.

    Attributes:
        points: Sizes of the layers for points; the outputs of the last one are pooled.

    Raises:
        InvalidArgumentError: for a value out of range.
    """

    points: tuple[int, ...] = (64, 128)

    def __post_init__(self):
        super().__post_init__()
        if not self.points or min(self.points) < 1:
            raise InvalidArgumentError("points", self.points, "sizes of layers, 1 or more")


class Layout(NamedTuple):
    """Layout of a full state.

    Attributes:
        sets: Index of the first entry and number of points of each set, objects first.
        rest: Indices of entries in no set.
    """

    sets: tuple[tuple[int, int], ...]
    rest: tuple[int, ...]


def layout(env: Environment) -> Layout:
    """Returns the layout of a task's full state.

    Args:
        env: Environment of the task after a reset.
    """
    task = env.task
    sets, end = [(0, task.max_points)], 3 * task.max_points
    for entry in task.extra_state(task.scene.state(), task.episode).values():
        size = np.size(entry.values)
        if entry.kind == "points":
            sets.append((end, size // 3))
        end += size
    taken = {start + i for start, number in sets for i in range(3 * number)}
    size = task.observe("full").size
    return Layout(tuple(sets), tuple(i for i in range(size) if i not in taken))


class PointSets(nn.Module):
    """Features of full states.

    Attributes:
        size: Number of features.
    """

    rest: Tensor

    def __init__(
        self, sources: Sequence[torch.Generator], where: Layout, sizes: Sequence[int], *, norm: bool
    ):
        """Draws the weights.

        Args:
            sources: Random generators, one per seed.
            where: Layout of the full state.
            sizes: Sizes of the layers for points.
            norm: Whether hidden layers have LayerNorm.
        """
        super().__init__()
        self._sets = where.sets
        rest = torch.tensor(where.rest, dtype=torch.int64, device=sources[0].device)
        self.register_buffer("rest", rest, persistent=False)
        inputs = [3 + len(where.rest), *sizes]
        self.each = nn.ModuleList(MLP(sources, inputs, norm=norm) for _ in where.sets)
        self.size = len(where.rest) + 2 * sizes[-1] * len(where.sets)

    def forward(self, full: Tensor) -> Tensor:
        """Maps full states (seeds, n, k) to features (seeds, n, size)."""
        rest = full[..., self.rest]
        result = [rest]
        for network, (start, number) in zip(self.each, self._sets, strict=True):
            points = full[..., start : start + 3 * number].unflatten(-1, (number, 3))
            beside = rest[..., None, :].expand(-1, -1, number, -1)
            seen = torch.cat([points, beside], dim=-1)
            each = network(seen.flatten(1, 2)).unflatten(1, (-1, number))
            there = (points != 0).any(-1, keepdim=True)  # Full states are padded with zeros.
            result.append(each.masked_fill(~there, -torch.inf).amax(-2))
            result.append(each.masked_fill(~there, 0.0).sum(-2) / there.sum(-2))
        return torch.cat(result, dim=-1)


class PointSAC(SAC):
    """Soft actor-critic on full states."""

    settings: PointSetSettings

    def __init__(
        self,
        settings: PointSetSettings,
        seeds: Sequence[int],
        where: Layout,
        action: int,
        device: torch.device | str = "cpu",
    ):
        """Draws the networks for a layout of full states; other arguments are those of `SAC`."""
        self._where = where
        size = len(where.rest) + 3 * sum(number for _, number in where.sets)
        super().__init__(settings, seeds, size, action, device)

    def _networks(self, observation: int, action: int) -> tuple[Actor, nn.Module]:
        settings, norm = self.settings, self.settings.norm
        of_actor, of_critics = (
            PointSets(self.sources, self._where, settings.points, norm=normed)
            for normed in (False, norm)
        )
        sizes = of_actor.size, action, settings.hidden
        return (
            Actor(self.sources, *sizes, settings.log_std, of_actor),
            Critics(self.sources, *sizes, norm=norm, seen=of_critics),
        )


def full_symmetries(env: Environment) -> list[Symmetry]:
    """Returns the symmetries of a task's full states, without permutations of points.

    Args:
        env: Environment of the task after a reset.

    Raises:
        InvalidArgumentError: for a task or an actor without symmetries.
    """
    number = env.task.observe("full").size // 3  # Points only, as `symmetries` has checked.
    result = []
    for symmetry in symmetries(env):
        if symmetry.order == "same":
            pickers = len(symmetry.pickers)
            order = [*range(number - pickers), *(number - pickers + k for k in symmetry.pickers)]
            turned = np.kron(np.eye(number, dtype=np.int8)[order], symmetry.turn.astype(np.int8))
            result.append(symmetry._replace(observation=turned))
    return result


def make(settings: PointSetSettings, problem: Problem) -> OffPolicy:
    """Returns the `Learner` of a problem.

    Raises:
        InvalidArgumentError: for other observations than full.
    """
    env = problem.example()
    if problem.observation != env.task.observe("full").shape:
        raise InvalidArgumentError("observation", problem.observation, "'full'")
    sac = PointSAC(settings, problem.seeds, layout(env), problem.action, problem.device)

    def replay(*args: Any, **arguments: Any) -> Replay:
        result = full_symmetries(env) if settings.symmetric else ()
        return Replay(*args, **{**arguments, "symmetries": result})

    return OffPolicy(settings, problem, sac, replay)
