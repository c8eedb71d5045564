"""`Starts`: what a batch is told of the variations of a task."""

import copy
import dataclasses

from softgym_mj.envs.environment import Environment, Snapshot
from softgym_mj.exceptions import InvalidArgumentError
from softgym_mj.tasks.shared.base import Task
from softgym_mj.vector.batch.side import Arrays, Side, Start

# Methods of a task that see one simulation: what they do is not known of a batch.
_OF_ONE = (
    "after_step", "before_step", "before_substep", "diagnostics", "get_state", "info", "set_state",
)  # fmt: skip


class Starts:
    """Starts of variations, each made once by an environment on the CPU, and snapshots."""

    def __init__(self, env: Environment, side: Side):
        """Checks that a batch can play the task.

        Args:
            env: plays it.
            side: reads what is there.

        Raises:
            InvalidArgumentError: for what a batch cannot do, by name.
        """
        for method in _OF_ONE:
            if getattr(type(env.task), method) is not getattr(Task, method):
                valid = f"one whose class defines no {method}, on this device"
                raise InvalidArgumentError("task", env.name, valid)
        if env.task.counts_intersections:
            raise InvalidArgumentError("count_intersections", True, "False, on this device")
        self._env, self._side = env, side
        self._known: dict[int, Start] = {}

    def __getitem__(self, variation: int) -> Start:
        """The start of a variation."""
        if variation not in self._known:
            self._env.reset(variation)
            self._known[variation] = self._read()
        return self._known[variation]

    def _read(self) -> Start:
        """Where the environment is."""
        task = self._env.task
        return Start(
            self._side.describe(),
            {name: array.copy() for name, array in self._side.arrays().items()},
            copy.deepcopy(task.actor.get_state()),
            task.episode,
            {name: task.domain.values[name] for name in task.domain.varying},
            task.scene.most_strained,
        )

    def read(self, snapshot: Snapshot) -> Start:
        """Where the episode of a snapshot of any environment is.

        Raises:
            SnapshotError: for one of another task or with other settings.
        """
        self._env.set_state(snapshot)
        return self._read()

    def snapshot(
        self,
        variation: int,
        state: Arrays,
        actor: Arrays,
        strain: float,
        step_count: int,
        ended: bool,
    ) -> Snapshot:
        """What `Environment.get_state` returns of an episode, which any environment continues.

        Args:
            variation: that is played.
            state: as `Side.arrays` has it.
            actor: what it remembers.
            strain: largest of an edge in the episode.
            step_count: env steps since its start.
            ended: whether it has ended.
        """
        self._env.reset(variation)
        for name, array in self._side.arrays().items():
            array[...] = state[name]
        self._env.physics.data.time = step_count * self._env.control_timestep()
        found = self._env.get_state()
        task = {**found.task, "most_strained": strain, "actor": dict(actor)}
        return dataclasses.replace(found, task=task, step_count=step_count, ended=ended)
