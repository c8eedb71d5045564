"""Symmetries of tasks: transformations of env steps that leave rewards and dynamics unchanged.

They rotate or reflect a task, reverse a rope or exchange pickers, and multiply the data of a
replay. `Task.symmetries` lists those of a task.
"""

import itertools
import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from scipy.linalg import block_diag

from softgym_mj.envs.environment import Environment
from softgym_mj.exceptions import InvalidArgumentError
from softgym_mj.robots.gripper import HELD
from softgym_mj.tasks.shared.entries import Entries
from softgym_mj.tasks.shared.observations import names_of


class Symmetry(NamedTuple):
    """Symmetry of a task.

    Attributes:
        observation: Matrix (n, n) of an observation.
        action: Matrix (m, m) of actions.
        turn, order: Fields of `tasks.shared.symmetry.Turned`.
        pickers: Order of the pickers.
    """

    observation: np.ndarray
    action: np.ndarray
    turn: np.ndarray
    order: str
    pickers: tuple[int, ...]


# Observations that symmetries transform.
TURNED = ("reduced", "markov", "key_points", "proprioception", HELD)
WITHOUT = "train without symmetries: --settings '{\"symmetric\": false}'"
SYMMETRIC = f"a task whose class defines `symmetries`; or {WITHOUT}"

# Order of a cloth's corners by (row, column): (0, 0), (last, 0), (0, last), (last, last).
_CORNERS = {
    "same": (0, 1, 2, 3), "rows": (1, 0, 3, 2), "columns": (2, 3, 0, 1), "both": (3, 2, 1, 0),
}  # fmt: skip


def check_observed(observed: str | tuple[str, ...]) -> None:
    """Raises `InvalidArgumentError` unless symmetries can transform all observations."""
    if not set(names_of(observed)) <= set(TURNED):
        valid = f"{', '.join(TURNED)} with symmetric=True"
        raise InvalidArgumentError("observation", observed, valid)


def symmetries(env: Environment, *observed: str) -> list[Symmetry]:
    """Returns the symmetries of a task with pickers; the first one is the identity.

    Args:
        env: Environment of the task after a reset.
        *observed: Names of the transformed observations, of `TURNED`, which follow each other.

    Raises:
        InvalidArgumentError: for a task or an actor without symmetries.
    """
    task = env.task
    if not task.symmetries:
        raise InvalidArgumentError("task", env.name, SYMMETRIC)
    if task.actor.name != "picker":
        valid = f"'picker', as others have no symmetries; or {WITHOUT}"
        raise InvalidArgumentError("actor", task.actor.name.split("/")[0], valid)
    number = task.actor.num_grippers
    orders = [tuple(range(number)), tuple(reversed(range(number)))][: min(number, 2)]
    state = task.scene.state()
    reduced, key_points = (find(state, task.episode) for find in (task.reduced, task.key_points))

    def of_observation(
        name: str, turn: np.ndarray, order: str, pickers: Sequence[int]
    ) -> np.ndarray:
        if name == "proprioception":
            return _blocks([turn] * number, pickers)
        if name == HELD:
            return _blocks([np.eye(1)] * number, pickers)
        if name == "key_points":
            return _of_observation(key_points, turn, order, pickers)
        result = _of_observation(reduced, turn, order, pickers)
        if name == "reduced":
            return result
        # For each picker: whether it holds a vertex, and its offset to that vertex.
        return block_diag(result, _blocks([block_diag(1.0, turn)] * number, pickers))

    return [
        Symmetry(
            block_diag(*(of_observation(name, turn, order, pickers) for name in observed)),
            _blocks([block_diag(turn, 1.0)] * number, pickers),
            turn, order, pickers,
        )
        for (turn, order), pickers in itertools.product(task.symmetries, orders)
    ]  # fmt: skip


def _of_observation(
    entries: Entries, turn: np.ndarray, order: str, pickers: Sequence[int]
) -> np.ndarray:
    """Returns the matrix (n, n) of these entries and the pickers' positions."""
    places: list[int] = []  # New order of the points.
    each = [*entries.items()]
    own = [i for i, (_, entry) in enumerate(each) if entry.role == "object"]
    counts = [np.size(entry.values) // 3 for _, entry in each]
    starts = np.cumsum([0, *counts]).tolist()
    for i, (name, entry) in enumerate(each):
        if entry.kind == "numbers":
            raise InvalidArgumentError(
                "reduced", name, "points only: other numbers cannot be rotated"
            )
        if i not in own or order == "same":
            places += range(starts[i], starts[i + 1])
        elif order == "reversed":
            places += range(starts[i + 1] - 1, starts[i] - 1, -1)
        elif entry.kind == "points" and math.isqrt(counts[i]) ** 2 == counts[i]:
            grid = np.arange(starts[i], starts[i + 1]).reshape(2 * [math.isqrt(counts[i])])
            grid = grid[::-1] if order in ("rows", "both") else grid
            places += (grid[:, ::-1] if order in ("columns", "both") else grid).ravel().tolist()
        elif entry.kind == "point" and len(own) == len(_CORNERS[order]):
            places.append(starts[own[_CORNERS[order][own.index(i)]]])
        else:
            valid = f"one point for each of four corners, or a square, as order {order!r} needs"
            raise InvalidArgumentError("reduced", name, valid)
    places += [starts[-1] + k for k in pickers]
    return _blocks([turn] * len(places), places)


def _blocks(parts: Sequence[np.ndarray], order: Sequence[int]) -> np.ndarray:
    """Returns a matrix (n k, n k) with block i (k, k) at row i and column order[i]."""
    size = len(parts[0])
    result = np.zeros((len(parts) * size,) * 2)
    for i, (part, k) in enumerate(zip(parts, order, strict=True)):
        result[i * size : (i + 1) * size, k * size : (k + 1) * size] = part
    return result
