"""`InitialStateCache`: initial states of variations, as rows on the device of a batch."""

import dataclasses
import functools
import pickle
import warnings
from collections.abc import Callable, Iterable, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from typing import Any

import cloudpickle
from dm_control import composer

from softgym_mj.batch.device import CpuDevice, Device
from softgym_mj.envs.environment import Environment
from softgym_mj.envs.gymnasium_env import SoftGymEnv
from softgym_mj.envs.snapshots import Snapshot
from softgym_mj.exceptions import StoreError, cpu_only
from softgym_mj.native.caches import ADVICE
from softgym_mj.parallel.executors import make_executor
from softgym_mj.rendering.observables import blank_images
from softgym_mj.tasks.shared.base import Task
from softgym_mj.vector.batch.cameras import Cameras
from softgym_mj.vector.batch.padded_rows import PaddedRows
from softgym_mj.vector.batch.physics import Arrays, BatchPhysics
from softgym_mj.vector.batch.start_files import StartFiles, start_files
from softgym_mj.vector.processes import num_cores

# Methods of a task that act on a single simulation, which batches cannot call.
_OF_ONE = (
    "after_step", "after_substep", "before_step", "before_substep", "diagnostics", "get_discount",
    "get_reward", "get_state", "info", "set_state", "should_terminate_episode",
)  # fmt: skip
# Hooks of entities during steps, likewise.
_HOOKS = "before_step", "before_substep", "after_substep", "after_step"

MANY, _SHARE = 64, 8  # Initial states from which several processes read, and reads per call.
SOON = 4  # Episodes per environment within which most variations occur.


def _moving_bodies(env: Environment, physics: BatchPhysics) -> list[str]:
    """Returns names of bodies with joints that belong neither to an object nor to the actor."""
    model = env.physics.model.ptr
    known = {*physics.movers(), *model.flex_vertbodyid.tolist()}
    return [model.body(i).name for i in sorted({*model.jnt_bodyid.tolist()} - known)]


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


def read_starts(
    pickled: bytes, files: StartFiles | None, variations: Sequence[int]
) -> tuple[list[dict[str, Any]], str]:
    """Returns `read` of the initial states of variations, and why no file keeps them, if so.

    Runs in any process.

    Args:
        pickled: By cloudpickle: function that makes the environment, class of the batch physics,
            and names of observations.
        files: Files that keep them; None keeps none.
        variations: Variation indices.
    """
    env, physics, cameras = _opened(pickled)
    found, failure = [], ""
    with blank_images():
        for variation in variations:
            env.reset(variation)
            found.append(read(env, physics, cameras))
            if files is not None and not failure:
                try:
                    files.put(variation, found[-1])
                except StoreError as error:
                    failure = str(error)
    return found, failure


@functools.lru_cache(maxsize=1)
def _opened(pickled: bytes) -> tuple[Environment, BatchPhysics, Cameras]:
    make, kind, names = pickle.loads(pickled)
    with blank_images():
        env = make().dm_env
    device = CpuDevice()
    physics = kind(env, 1, device)
    return env, physics, Cameras(env, names, 1, physics, device)


class InitialStateCache:
    """Cache of initial states and snapshots, each read once from a CPU environment.

    Attributes:
        rows: A row per initial state: physics and cameras as `placed` returns them, the measures'
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
        """Checks that batches support the task.

        Args:
            env: CPU environment of the task.
            physics: Reads its state.
            cameras: Reads its scene.
            device: Device of the rows.
            make: Makes such an environment in other processes; None reads in this one.

        Raises:
            InvalidArgumentError: If batches do not support the task or a setting.
        """
        for method in _OF_ONE:
            if getattr(type(env.task), method) is not getattr(Task, method):
                raise cpu_only(f"task={env.name!r}, whose class defines {method},")
        for entity in env.task.root_entity.iter_entities():
            for name in _HOOKS:
                hook = getattr(type(entity), name)
                is_known = hook.__module__.startswith("softgym_mj.")  # Arms: batches sense, too.
                if hook is not getattr(composer.Entity, name) and not is_known:
                    kind = type(entity).__name__
                    raise cpu_only(f"task={env.name!r}, whose {kind} defines {name},")
        if env.task.counts_intersections:
            raise cpu_only("count_intersections=True")
        if others := _moving_bodies(env, physics):
            raise cpu_only(f"task={env.name!r}, whose scene has moving bodies {others},")
        self._env, self._physics, self._cameras, self._make = env, physics, cameras, make
        self.rows = PaddedRows(1, device)
        self._known: dict[Any, int] = {}

    def prepare(self, variations: Iterable[int]) -> None:
        """Reads initial states of variations; of many, from files or in one process per core."""
        missing = sorted({v for v in variations if v not in self._known})
        if self._make is None or len(missing) < MANY:
            for variation in missing:
                self.row(variation)
            return
        pickled = cloudpickle.dumps((self._make, type(self._physics), self._cameras.observed))
        # Scenes of images have textures, which are larger than the states.
        files = None if self._cameras.observed else start_files(pickled, type(self._env.task))
        # Placed as they come: of a mesh, each brings a grid of up to 8 MB, and all share the first.
        rows, failure = {}, ""
        if files is not None:
            with ThreadPoolExecutor(num_cores()) as threads:  # Decompression releases the GIL.
                stored = zip(missing, threads.map(files.find, missing), strict=True)
                rows = {v: self._row(values) for v, values in stored if values is not None}
        new = [v for v in missing if v not in rows]
        shares = [new[i : i + _SHARE] for i in range(0, len(new), _SHARE)]
        with make_executor(max(min(num_cores(), len(shares)), 1)) as executor:
            calls = [(pickled, files, share) for share in shares]
            for i, (values, new_failure) in executor.results(read_starts, calls):
                rows |= zip(shares[i], map(self._row, values), strict=True)
                failure = failure or new_failure
        if failure:
            warnings.warn(f"{failure}. {ADVICE}", stacklevel=2)
        # Put together: a GPU gets one array per name instead of a small one per variation.
        first = len(self._known)
        self.rows.put_all(first, [rows[v] for v in missing])
        self._known.update(zip(missing, range(first, first + len(missing)), strict=True))

    def row(self, variation: int) -> int:
        """Returns the row of the initial state of a variation."""
        if variation not in self._known:
            self._reset(variation)
            self._put(variation, read(self._env, self._physics, self._cameras))
        return self._known[variation]

    def _reset(self, variation: int) -> None:
        """Resets the CPU environment without images, which need OpenGL."""
        with blank_images():
            self._env.reset(variation)

    def _put(self, key: Any, values: Mapping[str, Any]) -> None:
        self.rows.put(self._known.setdefault(key, len(self._known)), self._row(values))

    def _row(self, values: Mapping[str, Any]) -> dict[str, Any]:
        """Returns a row of `rows` from the result of `read` in any process."""
        return {
            **values,
            "physics": self._physics.placed(values["physics"]),
            "view": self._cameras.placed(values["view"]),
        }

    def restored(self, i: int, snapshot: Snapshot) -> tuple[int, int]:
        """Returns the row of a snapshot of any environment, and its variation.

        Args:
            i: Key; a later snapshot with the same key replaces it.
            snapshot: Snapshot to read.

        Raises:
            SnapshotError: If it is of another task or has other settings.
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
        """Returns a snapshot, as `Environment.get_state`, that any environment can continue.

        Args:
            state: Arrays by name, as from `BatchPhysics.arrays`.
            actor: State of the actor.
            variation: Variation index of the episode.
            strain: Largest edge strain of the episode.
            count: Env steps since its start.
            ended: Whether it has ended.
        """
        self._reset(variation)
        for name, array in self._physics.arrays().items():
            array[...] = state[name]
        self._env.physics.data.time = count * self._env.control_timestep()
        found = self._env.get_state()
        task = {**found.task, "most_strained": strain, "actor": dict(actor)}
        return dataclasses.replace(found, task=task, step_count=count, ended=ended)
