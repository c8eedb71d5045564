"""`PointEncoder`: a network whose features depend on single points of an object.

Which point counts changes abruptly with the state, such as the one with the largest error. Layers
that see all numbers at once learn such choices slowly; attention over points learns them fast.
"""

from typing import NamedTuple

import numpy as np
import torch
from torch import Tensor, nn

from softgym_mj.envs.environment import Environment
from softgym_mj.exceptions import InvalidArgumentError
from softgym_mj.robots.arm.arms import Arms

SCALE = 8.0  # [1/m] Positions are multiplied by it, so that workspaces measure a few units.
POINTS = "reduced", "key_points", "markov"  # Observations with points.
_HEADS = 8  # Number of attentions over the points.


class Layout(NamedTuple):
    """Indices of points in an observation of `POINTS`.

    Attributes:
        points: of the object (n, 3).
        goals: of their goals (n, 3); (0, 3) without any.
        grippers: of the grippers (m, 3).
    """

    points: np.ndarray
    goals: np.ndarray
    grippers: np.ndarray


def layout_of(env: Environment, name: str) -> Layout:
    """Returns where an observation has points.

    Args:
        env: environment.
        name: one of `POINTS`.

    Raises:
        InvalidArgumentError: unless it has points of an object, as many of a goal or none, and
            positions of grippers, which must be pickers or hands of arms.
    """
    task = env.task
    places: dict[str, list[int]] = {"object": [], "goal": [], "other": []}
    size = 0
    method = "reduced" if name == "markov" else name  # `markov` begins with `reduced`.
    entries = getattr(task, method)(task.scene.state(), task.episode)
    for entry in entries.values():
        number = np.size(entry.values)
        if entry.kind != "numbers":
            places[entry.role] += range(size, size + number)
        size += number
    points, goals = (np.reshape(places[role], (-1, 3)) for role in ("object", "goal"))
    # Positions of pickers and tool points of arms follow the numbers of the task.
    located = task.actor.name == "picker" or isinstance(task.actor, Arms)
    if not len(points) or len(goals) not in (0, len(points)) or not located:
        valid = f"False, unless pickers or arms move an object whose points `{name}` lists"
        raise InvalidArgumentError("points", True, valid)
    number = 3 * task.actor.num_grippers
    return Layout(points, goals, np.arange(size, size + number).reshape(-1, 3))


class PointEncoder(nn.Module):
    """Features of numbers that start with an observation of a `Layout`."""

    def __init__(self, layout: Layout, numbers: int, features: int):
        """Draws the weights from PyTorch's generator.

        Args:
            layout: where the points are.
            numbers: size of an observation.
            features: number of features, a multiple of 8.

        Raises:
            InvalidArgumentError: for another number.
        """
        super().__init__()
        if features % _HEADS:
            valid = f"a multiple of {_HEADS} with points=True"
            raise InvalidArgumentError("features", features, valid)
        points, goals, grippers = layout
        for name, indices in zip(Layout._fields, layout, strict=True):
            self.register_buffer(name, torch.as_tensor(indices.astype(np.int64)))
        # Each point: itself, its goals from either end and the ways there, the ways from the
        # grippers, all numbers, and its place in the object.
        inputs = 3 + 12 * bool(len(goals)) + 3 * len(grippers) + numbers + len(points)
        self.each = nn.Sequential(
            *_layer(inputs, features), nn.Linear(features, features), nn.SiLU()
        )
        self.all = nn.Sequential(*_layer(2 * features, features))
        self.again = nn.Sequential(
            *_layer(2 * features, features), nn.Linear(features, features), nn.SiLU()
        )
        self.scores, self.values = nn.Linear(features, _HEADS), nn.Linear(features, features)
        self.result = nn.Sequential(*_layer(2 * features, features))

    def forward(self, numbers: Tensor) -> Tensor:
        """Returns features (n, features) of observations (n, numbers)."""
        numbers = SCALE * numbers
        points, goals, grippers = (
            numbers[:, own] for own in (self.points, self.goals, self.grippers)
        )
        parts = [points]
        if goals.shape[1]:
            for each in (goals, goals.flip(1)):
                parts += [each, each - points]
        parts += [points - grippers[:, k, None] for k in range(grippers.shape[1])]
        parts.append(numbers[:, None].expand(-1, points.shape[1], -1))
        order = torch.eye(points.shape[1], dtype=numbers.dtype, device=numbers.device)
        parts.append(order.expand(len(numbers), -1, -1))
        each = self.each(torch.cat(parts, -1))
        common = self.all(torch.cat([each.mean(1), each.amax(1)], -1))
        again = self.again(torch.cat([each, common[:, None].expand_as(each)], -1))
        values = self.values(again).unflatten(-1, (_HEADS, -1))
        attended = (self.scores(again).softmax(1)[..., None] * values).sum(1).flatten(1)
        return self.result(torch.cat([attended, common], -1))


def _layer(inputs: int, outputs: int) -> list[nn.Module]:
    return [nn.Linear(inputs, outputs), nn.LayerNorm(outputs), nn.SiLU()]
