"""Symmetries of tasks: ways to show the same step of an episode in another place, order or mirror.

A task that is turned, mirrored, seen from the rope's other end or with its pickers exchanged is the
same task: what has been seen once has been seen as many times. Which turns and orders leave it as
it is the task says: `Task.symmetries`.
"""

import itertools
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from scipy.linalg import block_diag

from softgym_mj.envs.environment import Environment
from softgym_mj.exceptions import InvalidArgumentError
from softgym_mj.tasks.shared.entries import Entries


class Symmetry(NamedTuple):
    """One that leaves rewards and dynamics as they are.

    Attributes:
        observation: (n, n) by which `reduced`, or `markov`, is multiplied, as a column.
        action: (m, m) by which actions are.
        turn, order: as of `tasks.shared.symmetry.Turned`.
        pickers: their order.
    """

    observation: np.ndarray
    action: np.ndarray
    turn: np.ndarray
    order: str
    pickers: tuple[int, ...]


# Of the corners of a cloth: (0, 0), (last, 0), (0, last), (last, last) by row and column.
_CORNERS = {
    "same": (0, 1, 2, 3), "rows": (1, 0, 3, 2), "columns": (2, 3, 0, 1), "both": (3, 2, 1, 0),
}  # fmt: skip


def symmetries(env: Environment) -> list[Symmetry]:
    """Those of a task with pickers, of its reduced observations; the first one changes nothing.

    Args:
        env: plays the task; after a reset. They are of `markov` if that is what it observes.

    Raises:
        InvalidArgumentError: for a task or an actor that has none.
    """
    task = env.task
    if not task.symmetries:
        valid = "one whose class has `symmetries`: see softgym_mj.tasks.shared.symmetry"
        raise InvalidArgumentError("task", env.name, valid)
    if task.actor.name != "picker":
        raise InvalidArgumentError("actor", task.actor.name, "'picker'")
    number = task.actor.num_grippers
    orders = [tuple(range(number)), tuple(reversed(range(number)))][: min(number, 2)]
    entries = task.reduced(task.scene.state(), task.episode)
    remembers = "markov" in env.observation_spec()

    def of_observation(turn: np.ndarray, order: str, pickers: Sequence[int]) -> np.ndarray:
        result = _of_observation(entries, turn, order, pickers)
        if not remembers:
            return result
        # Of each picker whether it holds something, and where that is from it.
        return block_diag(result, _blocks([block_diag(1.0, turn)] * number, pickers))

    return [
        Symmetry(
            of_observation(turn, order, pickers),
            _blocks([block_diag(turn, 1.0)] * number, pickers),
            turn, order, pickers,
        )
        for (turn, order), pickers in itertools.product(task.symmetries, orders)
    ]  # fmt: skip


def _of_observation(
    entries: Entries, turn: np.ndarray, order: str, pickers: Sequence[int]
) -> np.ndarray:
    """A matrix (n, n): of the numbers of these entries, then of the pickers' places."""
    places: list[int] = []  # Which point comes where.
    each = [*entries.items()]
    own = [i for i, (_, entry) in enumerate(each) if entry.role == "object"]
    starts = np.cumsum([0, *(np.size(entry.values) // 3 for _, entry in each)]).tolist()
    for i, (name, entry) in enumerate(each):
        if entry.kind == "numbers":
            raise InvalidArgumentError("reduced", name, "points alone, to be turned")
        if i not in own or order == "same":
            places += range(starts[i], starts[i + 1])
        elif order == "reversed":
            places += range(starts[i + 1] - 1, starts[i] - 1, -1)
        elif entry.kind == "point" and len(own) == len(_CORNERS[order]):
            places.append(starts[own[_CORNERS[order][own.index(i)]]])
        else:
            valid = f"a point of each of four corners, to be in the order {order!r}"
            raise InvalidArgumentError("reduced", name, valid)
    places += [starts[-1] + k for k in pickers]
    return _blocks([turn] * len(places), places)


def _blocks(parts: Sequence[np.ndarray], order: Sequence[int]) -> np.ndarray:
    """Blocks (k, k) of a matrix (n k, n k): part i is that of row i and column order[i]."""
    size = len(parts[0])
    result = np.zeros((len(parts) * size,) * 2)
    for i, (part, k) in enumerate(zip(parts, order, strict=True)):
        result[i * size : (i + 1) * size, k * size : (k + 1) * size] = part
    return result
