"""`InitialStateCache`: what a batch is told of the variations of a task."""

import dataclasses
import functools
import pickle
from collections.abc import Callable, Iterable, Mapping, Sequence
from typing import Any

import cloudpickle

from softgym_mj.batch.device import CpuDevice, Device
from softgym_mj.envs.environment import Environment
from softgym_mj.envs.gymnasium_env import SoftGymEnv
from softgym_mj.envs.snapshots import Snapshot
from softgym_mj.exceptions import InvalidArgumentError
from softgym_mj.parallel.executors import ProcessExecutor
from softgym_mj.rendering.observables import blank_images
from softgym_mj.tasks.shared.base import Task
from softgym_mj.vector.batch.cameras import Cameras
from softgym_mj.vector.batch.padded_rows import PaddedRows
from softgym_mj.vector.batch.physics import Arrays, BatchPhysics
from softgym_mj.vector.processes import num_cores

# Methods of a task that see one simulation: what they do is not known of a batch.
_OF_ONE = (
    "after_step", "before_step", "before_substep", "diagnostics", "get_state", "info", "set_state",
)  # fmt: skip

MANY, _SHARE = 64, 8  # Starts that several processes read, and how many of them at a time.
SOON = 4  # Episodes of each environment in which most variations come up.


def read(env: Environment, physics: BatchPhysics, cameras: Cameras) -> dict[str, Any]:
    """Returns an environment's state as a row of `InitialStateCache`, in NumPy arrays."""
    task = env.task
    return {
        "physics": physics.read(),
        "view": cameras.read(env, physics),
        "episode": vars(task.episode),
        "domain": {name: task.domain.values[name] for name in task.domain.varying},
        "strain": float(task.scene.most_strained),
    }


def read_starts(pickled: bytes, variations: Sequence[int]) -> list[dict[str, Any]]:
    """What `read` says of starts of variations, in any process.

    Args:
        pickled: by cloudpickle: what makes the environment, the kind of side, and the names of
            what is observed.
        variations: their indices.
    """
    env, physics, cameras = _opened(pickled)
    found = []
    with blank_images():
        for variation in variations:
            env.reset(variation)
            found.append(read(env, physics, cameras))
    return found


@functools.cache
def _opened(pickled: bytes) -> tuple[Environment, BatchPhysics, Cameras]:
    make, kind, names = pickle.loads(pickled)
    with blank_images():
        env = make().dm_env
    device = CpuDevice()
    physics = kind(env, 1, device)
    return env, physics, Cameras(env, names, 1, physics, device)


class InitialStateCache:
    """Starts of variations, each read once off an environment on the CPU, and snapshots.

    Attributes:
        rows: a row per initial state: physics and cameras as `placed` returns them, the measures'
            episode data, values of the domain parameters that vary, and the largest strain of an
            edge so far.
    """

    def __init__(
        self,
        env: Environment,
        physics: BatchPhysics,
        cameras: Cameras,
        device: Device,
        make: Callable[[], SoftGymEnv] | None = None,
    ):
        """Checks that a batch can play the task.

        Args:
            env: plays it.
            physics: reads what is there,
            cameras: and what they see.
            device: where the rows are.
            make: makes such an environment in other processes, if that can be done.

        Raises:
            InvalidArgumentError: for what a batch cannot do, by name.
        """
        for method in _OF_ONE:
            if getattr(type(env.task), method) is not getattr(Task, method):
                valid = f"one whose class defines no {method}, on this device"
                raise InvalidArgumentError("task", env.name, valid)
        if env.task.counts_intersections:
            raise InvalidArgumentError("count_intersections", True, "False, on this device")
        self._env, self._physics, self._cameras, self._make = env, physics, cameras, make
        self.rows = PaddedRows(1, device)
        self._known: dict[Any, int] = {}

    def prepare(self, variations: Iterable[int]) -> None:
        """Reads the starts of variations, of many in as many processes as there are cores."""
        missing = sorted({v for v in variations if v not in self._known})
        if self._make is None or len(missing) < MANY or num_cores() == 1:
            for variation in missing:
                self.row(variation)
            return
        pickled = cloudpickle.dumps((self._make, type(self._physics), self._cameras.observed))
        shares = [missing[i : i + _SHARE] for i in range(0, len(missing), _SHARE)]
        with ProcessExecutor(min(num_cores(), len(shares))) as executor:
            for i, found in executor.results(read_starts, [(pickled, s) for s in shares]):
                for variation, values in zip(shares[i], found, strict=True):
                    self._put(variation, values)

    def row(self, variation: int) -> int:
        """The row of the start of a variation."""
        if variation not in self._known:
            self._reset(variation)
            self._put(variation, read(self._env, self._physics, self._cameras))
        return self._known[variation]

    def _reset(self, variation: int) -> None:
        """Without images, which need OpenGL."""
        with blank_images():
            self._env.reset(variation)

    def _put(self, key: Any, values: Mapping[str, Any]) -> None:
        row = self._known.setdefault(key, len(self._known))
        placed = {
            "physics": self._physics.placed(values["physics"]),
            "view": self._cameras.placed(values["view"]),
        }
        self.rows.put(row, {**values, **placed})

    def restored(self, i: int, snapshot: Snapshot) -> tuple[int, int]:
        """The row of where the episode of a snapshot of any environment is, and its variation.

        Args:
            i: another snapshot with this number takes its place.
            snapshot: what is read.

        Raises:
            SnapshotError: for one of another task or with other settings.
        """
        with blank_images():
            self._env.set_state(snapshot)
        self._put(("snapshot", i), read(self._env, self._physics, self._cameras))
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
            state: as `BatchPhysics.arrays` has it.
            actor: what it remembers.
            variation: that is played.
            strain: largest of an edge in the episode.
            count: env steps since its start.
            ended: whether it has ended.
        """
        self._reset(variation)
        for name, array in self._physics.arrays().items():
            array[...] = state[name]
        self._env.physics.data.time = count * self._env.control_timestep()
        found = self._env.get_state()
        task = {**found.task, "most_strained": strain, "actor": dict(actor)}
        return dataclasses.replace(found, task=task, step_count=count, ended=ended)
