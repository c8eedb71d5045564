"""`Backend`: what simulates the environments of a `VectorEnv`."""

from collections.abc import Callable, Mapping, Sequence
from typing import Any, Protocol

import gymnasium
import numpy as np
from gymnasium.vector import AutoresetMode
from gymnasium.vector.utils import batch_space, iterate

from softgym_mj.envs.clipping import Clipping
from softgym_mj.envs.snapshots import Snapshot
from softgym_mj.exceptions import InvalidArgumentError, LifecycleError
from softgym_mj.robots.base import BOUND_TOLERANCE, bounds_violated
from softgym_mj.validation import as_array
from softgym_mj.vector.variation_sampler import VariationSampler

MOST_ENVIRONMENTS = 10_000  # In a process each takes 20 MiB and more.


class Backend(Protocol):
    """Simulates environments of one task; the caller decides when each starts which variation.

    Spaces, `metadata` and `render_mode` are those of one environment. Methods return NumPy arrays
    or arrays on a device; all methods but `close` are called within `begin`.
    """

    num_envs: int
    observation_space: gymnasium.Space
    action_space: gymnasium.Space
    metadata: dict[str, Any]
    render_mode: str | None
    sampler: VariationSampler  # Draws the variations of automatic resets; set by `VectorEnv`.
    clipped: Clipping | None = None  # Clips actions; None rejects those outside the space.

    def begin(self, function: Callable[..., Any], *args: Any) -> Callable[[], Any]:
        """Runs a function after earlier ones, to its end even if the caller is interrupted.

        Returns:
            A function that waits for the result and returns it, once.
        """

    def expect(self, variations: Sequence[int]) -> None:
        """Prepares for resets that draw from these variations."""
        return None

    def reset(self, variations: Mapping[int, int]) -> None:
        """Starts episodes of variations, by number of the environment."""

    def restore(self, snapshots: Mapping[int, Snapshot]) -> None:
        """Continues episodes, by number of the environment."""

    def checked(self, actions: Any) -> Any:
        """Returns a checked copy of the actions of all environments, for `advance`.

        Raises:
            InvalidArgumentError: If an action is invalid.
        """
        return checked_actions(actions, self.num_envs, self.action_space, self.clipped)

    def advance(self, actions: Any, mode: AutoresetMode) -> tuple[Any, Any, Any, Any, Any]:
        """Makes one env step of all environments, with automatic resets according to `mode`.

        Returns:
            Observations, rewards (num_envs,), terminated, truncated (num_envs,) bool, infos.

        Raises:
            LifecycleError: If an episode has ended and the mode has no automatic resets.
        """

    def settle(self) -> None:
        """Updates `sampler` to the episodes that the environments have started meanwhile."""
        return None

    def observe(self) -> Any:
        """Returns the observations of all environments; later calls do not overwrite them."""

    def infos(self, mask: np.ndarray) -> dict[str, Any]:
        """Returns infos by name of environments in `mask` (num_envs,) bool, from the last step."""

    def last(self, observations: Any, infos: dict[str, Any], ended: np.ndarray) -> dict[str, Any]:
        """Returns Gymnasium's `final_obs` and `final_info` for `ended` (num_envs,) bool."""
        each = list(iterate(batch_space(self.observation_space, self.num_envs), observations))
        found = np.full(self.num_envs, None, object)
        for i in np.flatnonzero(ended):
            found[i] = each[i]
        return {"final_obs": found, "final_info": infos,
                "_final_obs": ended, "_final_info": ended.copy()}  # fmt: skip

    def get_state(self) -> list[Snapshot]:
        """Returns a snapshot of each environment."""

    def call(self, name: str, arguments: Sequence[tuple[Sequence, Mapping]]) -> tuple[Any, ...]:
        """Calls a method of each environment with its own arguments, or reads an attribute."""

    def close(self) -> None:
        """Releases processes and memory."""


def check_running(ended: np.ndarray) -> None:
    """Raises `LifecycleError` if any episode in `ended` (num_envs,) bool has ended."""
    if ended.any():
        raise LifecycleError(
            f"episodes of environments {np.flatnonzero(ended).tolist()} have ended: call "
            'reset(options={"reset_mask": terminated | truncated}) before step()'
        )


def clipping(env: gymnasium.Env) -> Clipping | None:
    """Returns the clipping of actions of environments like `env`; None if they reject them."""
    clips = getattr(env.unwrapped, "clip_actions", False)
    space = env.action_space
    return Clipping(space) if clips and isinstance(space, gymnasium.spaces.Box) else None


def checked_actions(
    actions: Any, number: int, space: gymnasium.Space, clipped: Clipping | None = None
) -> np.ndarray:
    """Returns checked actions of `number` environments as an array (number, n).

    Args:
        actions: Actions of all environments.
        number: Number of environments.
        space: Action space of each; only a Box is checked.
        clipped: Clips actions; None rejects actions outside the space.

    Raises:
        InvalidArgumentError: If the number of actions or their shape is wrong, or if one is not
            finite or outside the space.
    """
    given, box = actions, space if isinstance(space, gymnasium.spaces.Box) else None
    actions = as_array("actions", given).copy()  # An interrupted step may come to it later.
    if box is not None and actions.dtype.kind not in "fiub":
        raise InvalidArgumentError("actions", given, f"real numbers {(number, *box.shape)}")
    if actions.shape[:1] != (number,):
        valid = f"an action for each of the {number} environments"
        raise InvalidArgumentError("actions.shape", actions.shape, valid)
    if box is None:
        return actions
    if actions.shape[1:] != box.shape:
        raise InvalidArgumentError(
            f"actions are {actions.dtype}{actions.shape}; expected real numbers "
            f"{(number, *box.shape)}."
        )
    actions = actions if clipped is None else clipped(actions)
    fits = (actions >= box.low - BOUND_TOLERANCE) & (actions <= box.high + BOUND_TOLERANCE)
    bad = np.argwhere(~fits)  # NaN fails both comparisons.
    if len(bad):
        first = tuple(bad[0].tolist())
        raise InvalidArgumentError(
            f"actions{list(first)} = {actions[first]}, of environment {first[0]}, "
            f"{bounds_violated(actions[first])} No environment has been stepped."
        )
    return actions
