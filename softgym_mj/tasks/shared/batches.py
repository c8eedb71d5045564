"""Check that functions of a task treat a batch as each of its simulations."""

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np

from softgym_mj.exceptions import InvalidArgumentError
from softgym_mj.metrics import Array, to_host
from softgym_mj.tasks.shared.observations import STATES
from softgym_mj.tasks.shared.state import Episode, State

CLOSE = 1e-6  # Relative and absolute tolerance: sums of a batch may have another order.
_ADVICE = (
    "with device='host' or 'cuda' arrays have an axis of environments in front: write "
    "`points[..., 0]`, not `points[:, 0]`, and functions of `softgym_mj.metrics` in place of "
    "NumPy's; device='cpu' needs neither"
)


def check_batch(
    task: Any, state: State, episode: Episode, names: Sequence[str], index: int
) -> None:
    """Compares what a task computes for a batch with what it computes for one of its simulations.

    Args:
        task: the task.
        state, episode: those of the batch, with a leading dimension (num_envs,).
        names: observations.
        index: number of a simulation that has started.

    Raises:
        InvalidArgumentError: if they differ, or the task cannot compute them.
    """

    def described(state: State, episode: Episode) -> dict[str, Array]:
        return task.describe(state, episode, task.measure(state, episode))

    def observed(name: str) -> Callable[[State, Episode], dict[str, Array]]:
        return lambda *of: {name: STATES[name].value(task, *of)}

    number = len(state.sensed)
    own = state.row(index), episode.row(index)
    functions = {"measure()": described, **{name: observed(name) for name in names}}
    for function, compute in functions.items():
        try:
            whole, single = compute(state, episode), compute(*own)
        except InvalidArgumentError:
            raise
        except Exception as error:  # Whatever the task's code raises.
            raise InvalidArgumentError(
                f"{function} fails for {number} environments: {type(error).__name__}: {error}; "
                f"{_ADVICE}"
            ) from error
        for name, value in whole.items():
            found, expected = to_host(value), to_host(single[name])
            if found.shape not in (valid := (number, *expected.shape), ()):
                found_as = f"has shape {found.shape}, expected {valid}"
            elif not np.allclose(
                found[index] if found.ndim else found, expected, CLOSE, CLOSE, equal_nan=True
            ):
                found_as = f"differs from that of environment {index} alone"
            else:
                continue
            raise InvalidArgumentError(
                f"{name!r} by {function} for {number} environments {found_as}; {_ADVICE}"
            )
