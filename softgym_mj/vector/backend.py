"""`Backend`: what simulates the environments of a `VectorEnv`."""

from collections.abc import Callable, Mapping, Sequence
from typing import Any, Protocol

import gymnasium
import numpy as np

from softgym_mj.envs.environment import Snapshot


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

    def begin(self, function: Callable[..., Any], *args: Any) -> Callable[[], Any]:
        """Has a function carried out, after those before and to its end whatever interrupts this.

        Returns:
            What waits for it and returns what it returns, once.
        """

    def reset(self, variations: Mapping[int, int]) -> None:
        """Starts episodes of variations, by number of the environment."""

    def restore(self, snapshots: Mapping[int, Snapshot]) -> None:
        """Continues episodes, by number of the environment."""

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
