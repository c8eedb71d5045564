"""`Backend`: what simulates the environments of a `VectorEnv`."""

from collections.abc import Callable, Mapping, Sequence
from typing import Any, Protocol

import gymnasium
import numpy as np
from gymnasium.vector import AutoresetMode
from gymnasium.vector.utils import batch_space, iterate

from softgym_mj.envs.environment import Snapshot
from softgym_mj.exceptions import LifecycleError
from softgym_mj.vector.draws import Draws


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
    draws: Draws  # What follows by itself; a `VectorEnv` sets it.

    def begin(self, function: Callable[..., Any], *args: Any) -> Callable[[], Any]:
        """Has a function carried out, after those before and to its end whatever interrupts this.

        Returns:
            What waits for it and returns what it returns, once.
        """

    def reset(self, variations: Mapping[int, int]) -> None:
        """Starts episodes of variations, by number of the environment."""

    def restore(self, snapshots: Mapping[int, Snapshot]) -> None:
        """Continues episodes, by number of the environment."""

    def advance(self, actions: Any, mode: AutoresetMode) -> tuple[Any, Any, Any, Any, Any]:
        """Makes a step of a `VectorEnv`, and resets by itself as a mode says.

        Returns:
            Observations, rewards (num_envs,), terminated, truncated (num_envs,) bool, infos.

        Raises:
            LifecycleError: if an episode has ended and nothing resets by itself.
        """
        everyone, ended = np.ones(self.num_envs, bool), self.ended()
        if mode == AutoresetMode.DISABLED:
            check_running(ended)
        starts = self._drawn(ended & (mode == AutoresetMode.NEXT_STEP))
        outcome = self.step(actions, starts)
        ended, last = self.ended(), {}
        if mode == AutoresetMode.SAME_STEP and ended.any():
            last = self.last(self.observe(), self.infos(ended), ended)
            self.reset(self._drawn(ended))
        return self.observe(), *outcome, last | self.infos(everyone)

    def last(self, observations: Any, infos: dict[str, Any], ended: np.ndarray) -> dict[str, Any]:
        """What infos say of episodes that have ended (num_envs,) bool, as Gymnasium has it."""
        each = list(iterate(batch_space(self.observation_space, self.num_envs), observations))
        found = np.full(self.num_envs, None, object)
        for i in np.flatnonzero(ended):
            found[i] = each[i]
        return {"final_obs": found, "final_info": infos,
                "_final_obs": ended, "_final_info": ended.copy()}  # fmt: skip

    def _drawn(self, mask: np.ndarray) -> dict[int, int]:
        """Variations of the next episodes, by number of the environment."""
        return {i: self.draws.next(i) for i in np.flatnonzero(mask).tolist()}

    def step(self, actions: np.ndarray, variations: Mapping[int, int]) -> tuple[Any, Any, Any]:
        """Applies actions (num_envs, n); those in `variations` start an episode instead.

        Returns:
            Rewards, 0 for a start, terminated and truncated, each (num_envs,).
        """

    def ended(self) -> np.ndarray:
        """Whose episode has ended, (num_envs,) bool of NumPy."""

    def observe(self) -> Any:
        """Observations of all, which later calls leave as they are."""

    def infos(self, mask: np.ndarray) -> dict[str, Any]:
        """Infos by name of those in `mask` (num_envs,) bool, of their last step or start."""

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
