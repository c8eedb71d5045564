"""`Environment`: a dm_control composer environment with variations, exact snapshots and info."""

import contextlib
import copy
from collections.abc import Callable, Iterator, Sequence

import dm_env
import mujoco
import numpy as np
from dm_control import composer
from dm_control.rl.control import PhysicsError

from softgym_mj.envs import discarded
from softgym_mj.envs.simulated import SimulatedEnvironment
from softgym_mj.envs.snapshots import Snapshot, check_content, check_origin
from softgym_mj.exceptions import (
    InvalidArgumentError,
    LifecycleError,
    SimulationError,
    SnapshotError,
    check_count,
)
from softgym_mj.tasks.shared.base import Task
from softgym_mj.validation import describe
from softgym_mj.variations.indices import check_variation, split_indices

_STATE = mujoco.mjtState.mjSTATE_INTEGRATION
_HOOKS_KEY, _STARTS_KEY = 0x484F4F4B, 0x53544152  # Separate random numbers of hooks from others.


class Environment(SimulatedEnvironment):
    """Runs a `Task`; differs from composer's environment in five ways.

    `reset` chooses a variation and recompiles only if that changes the model, or if the task or an
    entity defines `initialize_episode_mjcf`. `step` rejects invalid actions and ends episodes after
    `horizon` env steps (discount 1: not a terminal state). A simulation that diverges ends the
    episode (discount 0: a terminal state). `get_state` and `set_state` are exact. `info` describes
    the last step.

    Attributes:
        name: task name.
        horizon: env steps in an episode.
        variations: variation indices from which `reset` draws.
        current_variation: variation of the current episode; None before the first reset, and after
            a start that diverges.
        step_count: env steps since reset; may be set to shorten an episode.
        diverged: whether the simulation diverged in the last env step.
        is_rehearsing: whether env steps are being tried and will be undone.
        maker: makes another such environment from a `random_state`; set by `load`.
    """

    def __init__(
        self,
        task: Task,
        *,
        name: str,
        horizon: int,
        split: str | Sequence[int] = "train",
        random_state: int | np.random.RandomState | None = None,
    ):
        """Compiles the model.

        Args:
            task: the task.
            name: its name, checked when a snapshot is restored.
            horizon: env steps in an episode, 1 or more.
            split: "train", "evaluate", "all" or a sequence of variation indices to draw from.
            random_state: seed or generator that draws the variations.

        Raises:
            InvalidArgumentError: for a bad task, split, horizon or random state.
        """
        if not isinstance(task, Task):
            raise InvalidArgumentError("task", task, "a softgym_mj.tasks.Task")
        check_count("horizon", horizon, 1)
        if not isinstance(random_state, np.random.RandomState):
            if random_state is not None:
                check_count("random_state", random_state, 0, 2**32 - 1)
            random_state = np.random.RandomState(random_state)
        discarded.collect()
        discarded.watch(self)
        self.name, self.horizon, self.variations = name, horizon, split_indices(split)
        self.maker: Callable[..., Environment] | None = None
        self.current_variation: int | None = None
        self.step_count = 0
        self.diverged = self.is_rehearsing = False
        plain = Task.initialize_episode_mjcf, composer.Entity.initialize_episode_mjcf
        parts = task, *task.root_entity.iter_entities()
        self._edits_mjcf = any(type(part).initialize_episode_mjcf not in plain for part in parts)
        task.driven = True
        task.choose_variation(self.variations[0])
        self._snapshot_key = task.snapshot_key
        super().__init__(
            task,
            random_state=random_state,
            strip_singleton_obs_buffer_dim=True,
            recompile_mjcf_every_episode=False,
            legacy_step=False,
        )

    def info(self) -> dict[str, np.generic]:
        """Returns NumPy scalars that describe the state after the last step or reset."""
        self._check_open()
        warnings = np.int64(self._data.warning.number.sum())
        diverged = np.bool_(self.diverged)
        return {**self._task.info(), "physics_warnings": warnings, "diverged": diverged}

    # ------------------------------------------------------------------ episodes

    @property
    def is_running(self) -> bool:
        """Whether an episode runs; without one, `step` resets."""
        return not self._reset_next_step

    def reset(self, variation: int | None = None) -> dm_env.TimeStep:
        """Starts an episode.

        Args:
            variation: index 0..999; None to draw one from the split.

        Raises:
            InvalidArgumentError: if there is no such variation.
            SimulationError: if the simulation diverges at the start.
        """
        self._check_open()
        if variation is None:
            variation = self.variations[self._random_state.randint(len(self.variations))]
        self._start(check_variation(variation))
        self._observation_updater.reset(self._physics_proxy, self._random_state)
        observation = self._observation_updater.get_observation()
        return dm_env.TimeStep(dm_env.StepType.FIRST, None, None, observation)

    def seed_hooks(self, variation: int) -> None:
        """Seeds the `random_state` that hooks of a custom task get during steps.

        Those of the start always get one that depends on the variation alone.

        Args:
            variation: index 0..999 of the episode that starts next.

        Raises:
            InvalidArgumentError: if there is no such variation.
        """
        self._random_state.seed([_HOOKS_KEY, check_variation(variation)])

    def _start(self, variation: int):
        # Until the episode has started.
        self.current_variation, self._reset_next_step = None, True
        recompile = self._task.choose_variation(variation)
        random = np.random.RandomState([_STARTS_KEY, variation])
        self._hooks.initialize_episode_mjcf(random)
        if recompile or self._edits_mjcf:
            self._recompile_physics_and_update_observables()
        try:
            with self._physics.reset_context():
                self._hooks.initialize_episode(self._physics_proxy, random)
        except PhysicsError as error:
            reason = f"the start of variation {variation} of {self.name} diverges: {error}"
            raise SimulationError(reason) from error
        self.step_count, self.diverged = 0, False
        self.current_variation = variation
        self._reset_next_step = False

    def step(self, action: np.ndarray) -> dm_env.TimeStep:
        """Applies an action for one env step, or resets after the last one of an episode.

        A simulation that diverges ends the episode: the last time step has discount 0, `diverged`
        is True, and state, observation, reward and info are those of the episode's start.

        Raises:
            InvalidArgumentError: for a wrong shape, NaN, infinity or an entry outside [-1, 1].
        """
        self._check_open()
        if self._reset_next_step:
            return self.reset()
        try:
            timestep = super().step(action)
        except PhysicsError:
            timestep = self._ended_by_divergence()
        self.step_count += 1
        if self.step_count >= self.horizon and not self.diverged:
            self._reset_next_step = True
            timestep = timestep._replace(step_type=dm_env.StepType.LAST)
        return timestep

    def play(
        self, act: Callable[[dm_env.TimeStep], np.ndarray], variation: int | None = None
    ) -> Iterator[dm_env.TimeStep]:
        """Plays an episode of a policy; yields its time steps, starting with that of the reset.

        Args:
            act: returns the action for a time step.
            variation: as in `reset`; a given one also seeds hooks, as `seed_hooks` does.

        Raises:
            SimulationError: if the simulation diverges: such an episode has no score.
        """
        if variation is not None:
            self.seed_hooks(variation)
        timestep = self.reset(variation)
        yield timestep
        while not timestep.last():
            timestep = self.step(act(timestep))
            self.check_converged()
            yield timestep

    def check_converged(self) -> None:
        """Raises `SimulationError` if the simulation diverged in the last env step."""
        if self.diverged:
            raise SimulationError(f"variation {self.current_variation} of {self.name} has diverged")

    def _ended_by_divergence(self) -> dm_env.TimeStep:
        assert self.current_variation is not None, "an episode runs"
        count, warnings = self.step_count, self._data.warning.number.copy()
        self._start(self.current_variation)
        self._data.warning.number[:] = warnings
        self.step_count, self.diverged, self._reset_next_step = count, True, True
        self._observation_updater.reset(self._physics_proxy, self._random_state)
        reward, observation = self._task.get_reward(self._physics_proxy), self.observation()
        return dm_env.TimeStep(dm_env.StepType.LAST, reward, 0.0, observation)

    # ------------------------------------------------------------------ snapshots

    def __reduce__(self):
        """Pickles the episode, so that a copy continues it; hooks that were added are not copied.

        Raises:
            LifecycleError: for an environment that `load` did not make, or that is closed.
        """
        self._check_open()
        if self.maker is None:
            raise LifecycleError(
                "an Environment that softgym_mj.load did not make cannot be copied or "
                "pickled: make another one and use other.set_state(env.get_state())"
            )
        snapshot = None if self.current_variation is None else self.get_state()
        return _remade, (self.maker, self._random_state.get_state(), snapshot)

    def get_state(self) -> Snapshot:
        """Returns a picklable snapshot of the episode, independent of this environment.

        Raises:
            LifecycleError: before the first reset; after `close()`.
        """
        self._check_open()
        if self.current_variation is None:
            raise LifecycleError("no episode has started: call reset() before get_state()")
        physics = np.empty(mujoco.mj_stateSize(self._model, _STATE))
        mujoco.mj_getState(self._model, self._data, physics, _STATE)
        return Snapshot(
            task_name=self.name,
            key=self._snapshot_key,
            physics=physics,
            task=self._task.get_state(),
            step_count=self.step_count,
            ended=self._reset_next_step,
            random_state=self._random_state.get_state(),
        )

    def set_state(self, snapshot: Snapshot) -> None:
        """Restores a snapshot; what follows is bit-identical in any instance of the same task.

        An instance with another variation switches to the snapshot's, which recompiles the model if
        the object's size differs.

        Raises:
            SnapshotError: for a snapshot of another task or other settings, or an invalid one.
            SimulationError: if the start of its variation diverges; the episode remains.
        """
        self._check_open()
        if not isinstance(snapshot, Snapshot):
            raise SnapshotError(f"expected what `get_state` returned, not {snapshot!r}")
        check_origin(snapshot, self.name, self._snapshot_key)
        before = None
        try:
            variation = check_variation(snapshot.task["variation"])
            if variation != self.current_variation:
                before = None if self.current_variation is None else self.get_state()
                self._start(variation)
            size = mujoco.mj_stateSize(self._model, _STATE)
            check_content(snapshot, size, self._task.get_state())
        except (SimulationError, LookupError, TypeError, ValueError) as error:
            if before is not None:
                self.set_state(before)
            if isinstance(error, SimulationError):
                raise
            raise SnapshotError(f"the snapshot is damaged: {error}") from error
        self._restore(snapshot)
        self._data.warning.number[:] = 0
        self._observation_updater.reset(self._physics_proxy, self._random_state)

    def _restore(self, snapshot: Snapshot) -> None:
        mujoco.mj_setState(self._model, self._data, snapshot.physics, _STATE)
        self._task.set_state(copy.deepcopy(snapshot.task))
        self.step_count = snapshot.step_count
        self._reset_next_step, self.diverged = snapshot.ended, False
        self._random_state.set_state(snapshot.random_state)

    @contextlib.contextmanager
    def rehearsal(self) -> Iterator[Callable[[np.ndarray], bool]]:
        """Context in which env steps are tried without observations, then undone.

        It yields a function that takes an env step and returns whether the episode continues; the
        function raises `PhysicsError` if the simulation diverges.
        """
        snapshot, warnings = self.get_state(), self._data.warning.number.copy()
        diverged, within = self.diverged, self.is_rehearsing
        self.is_rehearsing = True
        try:
            yield self._try
        finally:
            self._restore(snapshot)
            self.is_rehearsing = within
            self._data.warning.number[:], self.diverged = warnings, diverged

    def _try(self, action: np.ndarray) -> bool:
        self._hooks.before_step(self._physics_proxy, action, self._random_state)
        for _ in range(self._n_sub_steps):
            self._substep(action)
        self._hooks.after_step(self._physics_proxy, self._random_state)
        self.step_count += 1
        return self.step_count < self.horizon


def _remade(maker: Callable[..., Environment], random: tuple, snapshot: Snapshot | None):
    """Makes the environment that a pickle describes."""
    env = maker(random_state=np.random.RandomState())
    env.random_state.set_state(random)
    if snapshot is not None:
        env.set_state(snapshot)
    return env


describe(Environment, "an environment of softgym_mj.load, or env.unwrapped.dm_env of Gymnasium's")
