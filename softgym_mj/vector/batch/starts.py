"""`Starts`: what worlds are told of the variations of a task."""

import dataclasses
import hashlib
import math
from collections.abc import Mapping

import numpy as np
import scipy.sparse
import scipy.sparse.csgraph

from softgym_mj.cloth.worlds import KEPT_PAIRS, describe
from softgym_mj.entities.flex import Flex
from softgym_mj.envs.environment import Environment, Snapshot
from softgym_mj.exceptions import InvalidArgumentError
from softgym_mj.robots.grip import GripLimits
from softgym_mj.robots.picker import Picker
from softgym_mj.tasks.shared.base import Task
from softgym_mj.tasks.shared.state import Episode

# Methods of a task that see one simulation: what they do is not known of a batch.
_OF_ONE = (
    "after_step", "before_step", "before_substep", "diagnostics", "get_state", "info", "set_state",
)  # fmt: skip


class Mesh:
    """What a batch knows of a flex of some size and material.

    Attributes:
        model: of `Worlds`.
        origin: of vertices (n, 3) [m].
        edges: vertices of edges (m, 2); lengths: of these at rest [m].
        hold_stretch, hold_force, radius: of the flex.
    """

    def __init__(self, env: Environment, flex: Flex, actor: Picker):
        """Describes what an environment has compiled."""
        compiled = env.physics.model.ptr
        geoms = [i for i in range(compiled.ngeom) if _is_ball(compiled, i, actor)]
        self.model = describe(compiled, geoms)
        self.key = hashlib.sha256(self.model.tobytes()).digest()
        self.origin, self.edges, self.lengths = flex.origin, flex.edges, flex.rest_lengths
        self.hold_stretch, self.hold_force = flex.hold_stretch, flex.hold_force
        self.radius = flex.radius
        self._ways: dict[int, np.ndarray] = {}

    def gap(self, first: int, second: int) -> float:
        """As `Flex.largest_gap`."""
        start, end = min(first, second), max(first, second)
        if start not in self._ways:
            graph = scipy.sparse.csr_array(
                (self.lengths, tuple(self.edges.T)), shape=(len(self.origin),) * 2
            )
            self._ways[start] = scipy.sparse.csgraph.dijkstra(graph, directed=False, indices=start)
        return (1.0 + self.hold_stretch) * float(self._ways[start][end])


def _is_ball(model, geom: int, actor: Picker) -> bool:
    name = model.geom(geom).name.removeprefix(f"{actor.mjcf_model.model}/")
    return name in {f"picker_{i}" for i in range(actor.num_grippers)}


@dataclasses.dataclass(frozen=True)
class Start:
    """How a variation starts.

    Attributes:
        mesh: of the flex.
        points: slides of its vertices (n, 3) [m].
        grips: what pickers hold, of `Attachment.get_state`.
        limits: of their centres.
        episode: what measures compare with.
        domain: values of the domain parameters that vary, by name.
        strain: largest of an edge.
    """

    mesh: Mesh
    points: np.ndarray
    grips: Mapping[str, np.ndarray]
    limits: GripLimits
    episode: Episode
    domain: Mapping[str, float]
    strain: float


class Starts:
    """Starts of variations, each made once by an environment on the CPU.

    Attributes:
        env: that environment.
    """

    def __init__(self, env: Environment):
        """Checks that a batch can play the task.

        Raises:
            InvalidArgumentError: for what it cannot do, by name.
        """
        self.env = env
        task = env.task
        if type(task.actor) is not Picker:
            raise InvalidArgumentError("actor", task.actor.name, "'picker', on this device")
        flexes = task.flexes.flexes
        if len(flexes) != 1 or len(task.objects) != 1:
            valid = "one rope or cloth, on this device"
            raise InvalidArgumentError("objects", [*task.scene.materials], valid)
        for method in _OF_ONE:
            if getattr(type(task), method) is not getattr(Task, method):
                valid = f"one whose class defines no {method}, on this device"
                raise InvalidArgumentError("task", env.name, valid)
        if task.counts_intersections:
            raise InvalidArgumentError("count_intersections", True, "False, on this device")
        self.flex, self.actor = flexes[0], task.actor
        self._known: dict[int, Start] = {}
        self._meshes: dict[bytes, Mesh] = {}

    def __getitem__(self, variation: int) -> Start:
        """The start of a variation."""
        if variation not in self._known:
            self.env.reset(variation)
            mesh = Mesh(self.env, self.flex, self.actor)
            mesh = self._meshes.setdefault(mesh.key, mesh)
            task = self.env.task
            self._known[variation] = Start(
                mesh, self.flex.slides.copy(), self.actor.get_state(), self.actor.grip_limits,
                task.episode, {n: task.domain.values[n] for n in task.domain.varying},
                task.scene.most_strained,
            )  # fmt: skip
        return self._known[variation]

    # ------------------------------------------------------------------ snapshots

    def read(self, snapshot: Snapshot) -> tuple[Start, dict[str, np.ndarray]]:
        """How the episode of a snapshot of any environment has started, and its state of `Worlds`.

        Raises:
            SnapshotError: for one of another task or with other settings.
        """
        self.env.check_origin(snapshot)
        start = self[int(snapshot.task["variation"])]
        self.env.set_state(snapshot)
        return start, {name: array.copy() for name, array in self._arrays().items()}

    def snapshot(
        self,
        variation: int,
        state: Mapping[str, np.ndarray],
        grips: Mapping[str, np.ndarray],
        strain: float,
        step_count: int,
        ended: bool,
    ) -> Snapshot:
        """What `Environment.get_state` returns of an episode, which any environment continues.

        Args:
            variation: that is played.
            state: of `Worlds`.
            grips: what the pickers remember.
            strain: largest of an edge in the episode.
            step_count: env steps since its start.
            ended: whether it has ended.
        """
        self.env.reset(variation)
        for name, array in self._arrays().items():
            array[...] = state[name]
        self.env.physics.data.time = step_count * self.env.control_timestep()
        found = self.env.get_state()
        task = {**found.task, "most_strained": strain, "actor": dict(grips)}
        return dataclasses.replace(found, task=task, step_count=step_count, ended=ended)

    def _arrays(self) -> dict[str, np.ndarray]:
        """Views of what the environment's mjData has of a state of `Worlds`."""
        found = {
            "qpos": self.flex.slides,
            "qvel": self.flex.slide_velocities,
            "gripper_qpos": self.actor.slides,
            "gripper_qvel": self.actor.slide_velocities,
        }
        model, data = self.env.physics.model.ptr, self.env.physics.data.ptr
        rest, vertices = data.plugin_state[model.plugin_stateadr[0] :], self.flex.num_points
        for name, shape in {
            "valid": (1,),
            "reference": (vertices, 3),
            "after_edge": (len(self.flex.edges),),
            "holding_force": (vertices,),
            "after_layers": (vertices, KEPT_PAIRS, 4),
        }.items():
            size = math.prod(shape)
            found[name], rest = rest[:size].reshape(shape), rest[size:]
        return found
