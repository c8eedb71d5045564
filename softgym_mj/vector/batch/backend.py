"""`BatchBackend`: environments of a task as rows of arrays."""

from collections.abc import Callable, Mapping, Sequence
from typing import Any

import gymnasium
import numpy as np

from softgym_mj.envs.environment import Snapshot
from softgym_mj.envs.gymnasium_env import SoftGymEnv
from softgym_mj.exceptions import InvalidArgumentError, LifecycleError, check_count
from softgym_mj.metrics import Measures
from softgym_mj.native.places import Processor
from softgym_mj.native.worlds import NOT_FINITE
from softgym_mj.robots.gripper import HELD
from softgym_mj.tasks.shared.observations import STATES
from softgym_mj.tasks.shared.state import Episode, State
from softgym_mj.vector.backend import Backend
from softgym_mj.vector.batch.flexes import Flexes
from softgym_mj.vector.batch.rows import Rows
from softgym_mj.vector.batch.side import Side, Start
from softgym_mj.vector.batch.starts import Starts
from softgym_mj.vector.batch.waters import Waters
from softgym_mj.vector.processes import MOST_ENVIRONMENTS, num_cores


class BatchBackend(Backend):
    """Measures, rewards and observations are the task's own functions, of all worlds at once."""

    def __init__(
        self, example: SoftGymEnv, num_envs: int, num_threads: int | None = None, turns: int = 0
    ):
        """Takes over an environment, which says how episodes start.

        Args:
            example: that environment.
            num_envs: number of environments.
            num_threads: that step worlds; None for one a core.
            turns: of `native.places.Processor`, for tests.

        Raises:
            InvalidArgumentError: for what cannot be played so, by name.
        """
        if example.render_mode is not None:
            raise InvalidArgumentError("render_mode", example.render_mode, "None, on this device")
        self._example = example
        self._task, self.horizon = example.dm_env.task, example.horizon
        self._names = _observations(example)
        self.num_envs = check_count("num_envs", num_envs, 1, MOST_ENVIRONMENTS)
        if num_threads is None:
            num_threads = min(num_envs, num_cores())
        check_count("num_workers", num_threads, 1, num_envs)
        kind = Flexes if self._task.flexes.flexes else Waters
        self._side: Side = kind(example.dm_env, num_envs, Processor(num_threads, turns))
        self._starts = Starts(example.dm_env, self._side)
        self.observation_space = example.observation_space
        self.action_space = example.action_space
        self.metadata, self.render_mode = example.metadata, example.render_mode
        self._episodes, self._domain = Rows(num_envs), Rows(num_envs)
        self._counts = np.zeros(num_envs, int)
        # Of an edge: largest now, and so far in the episode.
        self._strains, self._strain = np.zeros(num_envs), np.zeros(num_envs)
        self._of: list[Start | None] = [None] * num_envs
        self._diverged = np.zeros(num_envs, bool)
        self._state: State | None = None
        self._measures: Measures | None = None

    def begin(self, function: Callable[..., Any], *args: Any) -> Callable[[], Any]:
        outcome = function(*args)
        return lambda: outcome

    def close(self) -> None:
        self._example.close()

    # ------------------------------------------------------------------ episodes

    def reset(self, variations: Mapping[int, int]) -> None:
        for i, variation in variations.items():
            self._start(i, self._starts[variation])
        self._look()

    def _start(self, i: int, start: Start) -> None:
        """Starts an episode of world `i`."""
        self._of[i], self._counts[i], self._diverged[i] = start, 0, False
        self._side.start(i, start)
        self._strain[i] = start.strain
        self._episodes.put(i, vars(start.episode))
        self._domain.put(i, start.domain)

    @property
    def _episode(self) -> Episode:
        return Episode(**self._episodes.whole)

    def _look(self) -> None:
        """Reads the state and measures it."""
        # As many points as the largest episode's arrays have.
        sizes = [points.shape[1] for points in self._episodes.whole["points"].values()]
        self._state = self._side.state(max(sizes))
        self._measures = self._task.measure(self._state, self._episode)
        self._strains = self._side.strains()
        self._strain = np.maximum(self._strain, self._strains)

    def step(self, actions: np.ndarray, variations: Mapping[int, int]) -> tuple[Any, Any, Any]:
        self._side.command(np.asarray(actions, float))
        for _ in range(self._task.action_repeat):
            self._side.sim_step()
        self._counts += 1
        flags = self._side.flags
        for i in np.flatnonzero(flags & NOT_FINITE).tolist():
            # It ends where it has started: measures are finite, and others do not notice.
            count = self._counts[i]
            self._start(i, self._started(i))
            self._counts[i], self._diverged[i] = count, True
            flags[i] = NOT_FINITE
        for i, variation in variations.items():
            self._start(i, self._starts[variation])
        self._look()
        assert self._measures is not None
        rewards = np.asarray(self._measures.reward, float).copy()
        rewards[[*variations]] = 0.0
        return rewards, self._diverged.copy(), self._counts >= self.horizon

    def _started(self, i: int) -> Start:
        start = self._of[i]
        if start is None:
            raise LifecycleError("no episode has started: call reset() first")
        return start

    def ended(self) -> np.ndarray:
        return (self._counts >= self.horizon) | self._diverged

    # ------------------------------------------------------------------ what is seen

    def observe(self) -> Any:
        seen = {name: self._seen(name) for name in self._names}
        if isinstance(self.observation_space, gymnasium.spaces.Dict):
            return {name: seen[name] for name in self.observation_space}
        return seen[self._names[0]]

    def _seen(self, name: str) -> np.ndarray:
        assert self._state is not None, "after a reset"
        if name == HELD:
            return self._side.holds()
        value = STATES[name].value(self._task, self._state, self._episode)
        space = self.observation_space
        own = space[name] if isinstance(space, gymnasium.spaces.Dict) else space
        return np.ascontiguousarray(value, own.dtype)

    def infos(self, mask: np.ndarray) -> dict[str, Any]:
        assert self._state is not None and self._measures is not None, "after a reset"
        found = {
            **self._task.describe(self._state, self._episode, self._measures),
            **self._side.info(self._strains, self._strain),
            **{f"domain_{name}": values for name, values in (self._domain.whole or {}).items()},
            "variation": self._episodes.whole["variation"],
            "physics_warnings": (self._side.flags != 0).astype(int),
        }
        named: dict[str, Any] = {}
        for name, values in found.items():
            whole = np.zeros(self.num_envs, np.asarray(values).dtype)
            whole[mask] = np.broadcast_to(values, self.num_envs)[mask]
            named[name], named[f"_{name}"] = whole, mask.copy()
        return named

    # ------------------------------------------------------------------ snapshots

    def get_state(self) -> list[Snapshot]:
        return [self._snapshot(i) for i in range(self.num_envs)]

    def _snapshot(self, i: int) -> Snapshot:
        return self._starts.snapshot(
            int(self._started(i).episode.variation),
            *self._side.get_state(i),
            float(self._strain[i]),
            int(self._counts[i]),
            bool(self.ended()[i]),
        )

    def restore(self, snapshots: Mapping[int, Snapshot]) -> None:
        for i, snapshot in snapshots.items():
            there = self._starts.read(snapshot)
            self._start(i, there)
            self._of[i] = self._starts[int(there.episode.variation)]
            self._counts[i] = self.horizon if snapshot.ended else snapshot.step_count
        self._look()

    def call(self, name: str, arguments: Sequence[tuple[Sequence, Mapping]]) -> tuple[Any, ...]:
        if name == "horizon":
            return (self.horizon,) * self.num_envs
        if name == "shorten":
            self._counts += [int(share * self.horizon) for (share,), _ in arguments]
            return (None,) * self.num_envs
        raise InvalidArgumentError("name", name, "'horizon' or 'shorten', on this device")


def _observations(example: SoftGymEnv) -> tuple[str, ...]:
    """The names that are observed.

    Raises:
        InvalidArgumentError: for images.
    """
    names = tuple(example.dm_env.observation_spec())
    for name in names:
        if name not in (*STATES, HELD):
            raise InvalidArgumentError("observation", name, (*STATES, HELD))
    return names
