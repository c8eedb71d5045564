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
from softgym_mj.robots.base import BOUND_TOLERANCE
from softgym_mj.validation import as_array
from softgym_mj.vector.variation_sampler import VariationSampler

MOST_ENVIRONMENTS = 10_000  # In a process each takes 20 MiB and more.


class Backend(Protocol):
    """Environments of one task, by number; they are told which variation to start, and when.

    Spaces, `metadata` and `render_mode` are those of one environment. Arrays that methods return
    are NumPy's, or on a device; all methods but `close` are called within `begin`.
    """

    num_envs: int
    observation_space: gymnasium.Space
    action_space: gymnasium.Space
    metadata: dict[str, Any]
    render_mode: str | None
    sampler: VariationSampler  # Of what follows by itself; a `VectorEnv` sets it.
    clipped: Clipping | None = None  # As of `checked_actions`.

    def begin(self, function: Callable[..., Any], *args: Any) -> Callable[[], Any]:
        """Has a function carried out, after those before and to its end whatever interrupts this.

        Returns:
            What waits for it and returns what it returns, once.
        """

    def expect(self, variations: Sequence[int]) -> None:
        """Is told before a reset that draws variations which ones may be drawn from now on."""
        return None

    def reset(self, variations: Mapping[int, int]) -> None:
        """Starts episodes of variations, by number of the environment."""

    def restore(self, snapshots: Mapping[int, Snapshot]) -> None:
        """Continues episodes, by number of the environment."""

    def checked(self, actions: Any) -> Any:
        """Actions of all, a copy, for `advance`.

        Raises:
            InvalidArgumentError: for a bad one.
        """
        return checked_actions(actions, self.num_envs, self.action_space, self.clipped)

    def advance(self, actions: Any, mode: AutoresetMode) -> tuple[Any, Any, Any, Any, Any]:
        """Makes a step of a `VectorEnv`, and resets by itself as a mode says.

        Returns:
            Observations, rewards (num_envs,), terminated, truncated (num_envs,) bool, infos.

        Raises:
            LifecycleError: if an episode has ended and nothing resets by itself.
        """

    def settle(self) -> None:
        """Has `sampler` be where the environments are, which may be further on."""
        return None

    def observe(self) -> Any:
        """Observations of all, which later calls leave as they are."""

    def infos(self, mask: np.ndarray) -> dict[str, Any]:
        """Infos by name of those in `mask` (num_envs,) bool, of their last step or start."""

    def last(self, observations: Any, infos: dict[str, Any], ended: np.ndarray) -> dict[str, Any]:
        """What infos say of episodes that have ended (num_envs,) bool, as Gymnasium has it."""
        each = list(iterate(batch_space(self.observation_space, self.num_envs), observations))
        found = np.full(self.num_envs, None, object)
        for i in np.flatnonzero(ended):
            found[i] = each[i]
        return {"final_obs": found, "final_info": infos,
                "_final_obs": ended, "_final_info": ended.copy()}  # fmt: skip

    def get_state(self) -> list[Snapshot]:
        """A snapshot of each."""

    def call(self, name: str, arguments: Sequence[tuple[Sequence, Mapping]]) -> tuple[Any, ...]:
        """What a method of each returns, given its own args and kwargs; or an attribute."""

    def close(self) -> None:
        """Frees what simulates."""


def check_running(ended: np.ndarray) -> None:
    """Raises `LifecycleError` if the episode of any environment has ended (num_envs,) bool."""
    if ended.any():
        raise LifecycleError(
            f"episodes of environments {np.flatnonzero(ended).tolist()} have ended: call "
            'reset(options={"reset_mask": terminated | truncated}) before step()'
        )


def clipping(env: gymnasium.Env) -> Clipping | None:
    """Returns what clips actions of environments like `env`; None if they refuse those outside."""
    clips = getattr(env.unwrapped, "clip_actions", False)
    space = env.action_space
    return Clipping(space) if clips and isinstance(space, gymnasium.spaces.Box) else None


def checked_actions(
    actions: Any, number: int, space: gymnasium.Space, clipped: Clipping | None = None
) -> np.ndarray:
    """Actions of `number` environments, as an array (number, n).

    Args:
        actions: of all.
        number: of environments.
        space: action space of each; only a Box is checked.
        clipped: what clips actions; None to refuse those outside of the space.

    Raises:
        InvalidArgumentError: unless there is one for each; for one of the wrong shape, not finite
            or outside of the space.
    """
    actions = as_array("actions", actions).copy()  # An interrupted step may come to it later.
    if actions.shape[:1] != (number,):
        valid = f"an action for each of the {number} environments"
        raise InvalidArgumentError("actions", f"an array of shape {actions.shape}", valid)
    if not isinstance(space, gymnasium.spaces.Box):
        return actions
    if actions.dtype.kind not in "fiub" or actions.shape[1:] != space.shape:
        raise InvalidArgumentError(
            f"actions are {actions.dtype}{actions.shape}; expected real numbers "
            f"{(number, *space.shape)}."
        )
    actions = actions if clipped is None else clipped(actions)
    fits = (actions >= space.low - BOUND_TOLERANCE) & (actions <= space.high + BOUND_TOLERANCE)
    bad = np.argwhere(~fits)  # NaN does not fit, either.
    if len(bad):
        first = tuple(bad[0].tolist())
        raise InvalidArgumentError(
            f"actions{list(first)} = {actions[first]}, of environment {first[0]}, must be finite "
            "and within [-1, 1]; clip_actions=True clips them. No environment has been stepped."
        )
    return actions
