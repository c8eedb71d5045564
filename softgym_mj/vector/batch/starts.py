"""`Starts`: what a batch is told of the variations of a task."""

import dataclasses
from typing import Any

from softgym_mj.envs.environment import Environment, Snapshot
from softgym_mj.exceptions import InvalidArgumentError
from softgym_mj.native.places import Place
from softgym_mj.tasks.shared.base import Task
from softgym_mj.vector.batch.rows import Rows
from softgym_mj.vector.batch.side import Arrays, Side

# Methods of a task that see one simulation: what they do is not known of a batch.
_OF_ONE = (
    "after_step", "before_step", "before_substep", "diagnostics", "get_state", "info", "set_state",
)  # fmt: skip


class Starts:
    """Starts of variations, each made once by an environment on the CPU, and snapshots.

    Attributes:
        rows: of worlds that start so: what `Side.row` says; what measures compare with; values of
            the domain parameters that vary; the largest strain of an edge so far.
    """

    def __init__(self, env: Environment, side: Side, place: Place):
        """Checks that a batch can play the task.

        Args:
            env: plays it.
            side: reads what is there.
            place: where the rows are.

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
        self.rows = Rows(1, place)
        self._known: dict[Any, int] = {}

    def row(self, variation: int) -> int:
        """The row of the start of a variation."""
        if variation not in self._known:
            self._env.reset(variation)
            self._read(variation)
        return self._known[variation]

    def _read(self, key: Any) -> None:
        """Notes where the environment is."""
        task = self._env.task
        row = self._known.setdefault(key, len(self._known))
        domain = {name: task.domain.values[name] for name in task.domain.varying}
        values = {"side": self._side.row(), "episode": vars(task.episode), "domain": domain}
        self.rows.put(row, {**values, "strain": float(task.scene.most_strained)})

    def read(self, i: int, snapshot: Snapshot) -> tuple[int, int]:
        """The row of where the episode of a snapshot of any environment is, and its variation.

        Args:
            i: another snapshot with this number takes its place.
            snapshot: what is read.

        Raises:
            SnapshotError: for one of another task or with other settings.
        """
        self._env.set_state(snapshot)
        self._read(("snapshot", i))
        return self._known["snapshot", i], self._env.task.variation

    def snapshot(
        self,
        state: Arrays,
        actor: Arrays,
        *,
        variation: int,
        strain: float,
        count: int,
        ended: bool,
    ) -> Snapshot:
        """What `Environment.get_state` returns of an episode, which any environment continues.

        Args:
            state: as `Side.arrays` has it.
            actor: what it remembers.
            variation: that is played.
            strain: largest of an edge in the episode.
            count: env steps since its start.
            ended: whether it has ended.
        """
        self._env.reset(variation)
        for name, array in self._side.arrays().items():
            array[...] = state[name]
        self._env.physics.data.time = count * self._env.control_timestep()
        found = self._env.get_state()
        task = {**found.task, "most_strained": strain, "actor": dict(actor)}
        return dataclasses.replace(found, task=task, step_count=count, ended=ended)
