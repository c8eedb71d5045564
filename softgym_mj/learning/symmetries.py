"""Symmetries of tasks: transformations of env steps that leave rewards and dynamics unchanged.

They rotate or reflect a task, reverse a rope or exchange grippers, and multiply the data of a
replay. `Task.symmetries` lists those of a task.
"""

import math
from typing import NamedTuple

import numpy as np
from scipy.linalg import block_diag

from softgym_mj.envs.environment import Environment
from softgym_mj.exceptions import InvalidArgumentError
from softgym_mj.robots.gripper import HELD
from softgym_mj.robots.symmetry import ActorSymmetry, blocks
from softgym_mj.tasks.shared.entries import Entries
from softgym_mj.tasks.shared.observations import names_of
from softgym_mj.tasks.shared.symmetry import Turned


class Symmetry(NamedTuple):
    """Symmetry of a task.

    Attributes:
        observation: Matrix (n, n) of an observation.
        action: Matrix (m, m) of actions.
        turn, order: Fields of `tasks.shared.symmetry.Turned`.
        pickers: Order of the grippers.
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
    """Returns the symmetries of a task with pickers or arms; the first one is the identity.

    Args:
        env: Environment of the task after a reset.
        *observed: Names of the transformed observations, of `TURNED`, which follow each other.

    Raises:
        InvalidArgumentError: for a task or an actor without symmetries.
    """
    task = env.task
    if not task.symmetries:
        raise InvalidArgumentError("task", env.name, SYMMETRIC)
    state = task.scene.state()
    reduced, key_points = (find(state, task.episode) for find in (task.reduced, task.key_points))

    def of_observation(name: str, turned: Turned, own: ActorSymmetry) -> np.ndarray:
        if name == "proprioception":
            return own.sensed
        if name == HELD:
            return blocks([np.eye(1)] * len(own.order), own.order)
        points = _of_points(key_points if name == "key_points" else reduced, *turned)
        result = block_diag(points, own.sensed)
        return block_diag(result, own.remembered) if name == "markov" else result

    found = [
        Symmetry(
            block_diag(*(of_observation(name, turned, own) for name in observed)),
            own.action, turned.turn, turned.order, own.order,
        )
        for turned in task.symmetries
        for own in task.actor.symmetries(turned.turn)
    ]  # fmt: skip
    if not found:
        valid = f"pickers, or arms that act by positions: others have no symmetries; or {WITHOUT}"
        raise InvalidArgumentError("actor", task.actor.name.split("/")[0], valid)
    return found


def _of_points(entries: Entries, turn: np.ndarray, order: str) -> np.ndarray:
    """Returns the matrix (n, n) of these entries."""
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
    return blocks([turn] * len(places), places)
