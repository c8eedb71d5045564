"""`ClothBatch`: batch physics of a rope or cloth with grippers."""

import math
from typing import Any

import numpy as np

from softgym_mj.batch.device import Device
from softgym_mj.cloth import batch_solver
from softgym_mj.cloth.batch_solver import ClothBatchSolver, SolidMotion, describe
from softgym_mj.entities.flex import edge_strains, highest_speed, is_overloaded
from softgym_mj.envs.environment import Environment
from softgym_mj.exceptions import cpu_only
from softgym_mj.metrics import Array, constant, lengths
from softgym_mj.robots.grip import remembered
from softgym_mj.robots.pick_and_place import PixelPickAndPlace
from softgym_mj.robots.picker import Picker
from softgym_mj.tasks.shared.base import Task
from softgym_mj.tasks.shared.state import State
from softgym_mj.vector.batch import static_solids
from softgym_mj.vector.batch.distance_tables import DistanceTables
from softgym_mj.vector.batch.physics import Arrays, BatchPhysics
from softgym_mj.vector.batch.pick_and_place import PickAndPlaceBatch
from softgym_mj.vector.batch.pickers import PickerBatch

# Methods of `Picker` that `PickerBatch` replaces; a class with another action space overrides
# `commands` only.
_OF_PICKER = "begin", "command", "get_state", "move", "place", "plan", "positions", "set_state"


def _is_known(actor: type) -> bool:
    """Whether batches support a class of actors."""
    own = (getattr(actor, name, None) is getattr(Picker, name) for name in _OF_PICKER)
    return actor is PixelPickAndPlace or all(own)


class ClothBatch(BatchPhysics):
    """Batch physics of one flex that pickers move; a subclass has other grippers."""

    def __init__(self, env: Environment, num_envs: int, device: Device):
        """Allocates the batch for an environment's task.

        Args:
            env: Example environment, which provides initial states.
            num_envs, device: Arguments of `ClothBatchSolver`.

        Raises:
            InvalidArgumentError: Unless there is exactly one flex and the actor is supported.
        """
        task, flexes = env.task, env.task.flexes.flexes
        if len(flexes) != 1 or len(task.objects) != 1:
            raise cpu_only(f"a task with several objects {[*task.scene.materials]}")
        self._check(task)
        self._env, self._flex, self._actor = env, flexes[0], task.actor
        self._name = next(iter(task.scene.materials))
        self._static = static_solids.find(env.physics.model.ptr)
        if unmet := self._unmet():
            raise cpu_only(f"actor={task.actor.name!r} in a scene with fixed solids {unmet}")
        self._device, self._xp = device, device.xp
        sizes = num_envs, task.max_points, task.actor.num_grippers, device
        self._solver = ClothBatchSolver(*sizes, *self._solids(), self._notes_pushes)
        self.flags, self.state = self._solver.flags, self._solver.rows()
        self._pickers: PickerBatch = self._grips(num_envs)
        self._distances = DistanceTables(device)

    def _check(self, task: Task) -> None:
        """Raises `InvalidArgumentError` if the actor is not supported."""
        if not _is_known(type(task.actor)):
            raise cpu_only(f"actor={task.actor.name.split('/')[0]!r}")

    def _unmet(self) -> list[str]:
        """Returns names of fixed solids that the actor must not meet."""
        solids = [] if isinstance(self._actor, Picker) else self._static
        return [self._env.physics.model.ptr.geom(solid).name for solid in solids]

    def _solids(self) -> tuple[int, int]:
        """Returns `solids` and `dofs` of `ClothBatchSolver`."""
        return len(self._static), 0

    @property
    def _notes_pushes(self) -> bool:
        """Whether `ClothBatchSolver.pushes` are needed."""
        return False

    def _grips(self, num_envs: int) -> PickerBatch:
        actor, device = self._actor, self._device
        own = actor.radius, actor.pick_distance
        if isinstance(actor, PixelPickAndPlace):
            return PickAndPlaceBatch(self.state, device, num_envs, *own)
        return PickerBatch(self.state, device.xp, actor.num_grippers, *own, actor.commands)

    @property
    def changed(self) -> int:  # type: ignore[override]
        """Number of times that arrays outside `state` have been replaced."""
        return self._distances.size + self._solver.grown

    # ------------------------------------------------------------------ the environment

    def read(self) -> Arrays:
        """Reads state, picker state and mesh of the CPU environment.

        Keys besides the state: model (for `ClothBatchSolver`), origin of vertices [m], ends and
        rest lengths [m] of edges, pairs and distances (`PairDistances`), the flex's radius,
        hold_force, max_tracking_error and hold_stretch, view (camera of pixel actions), and
        static_poses.
        """
        flex = self._flex
        return {
            **{name: array.copy() for name, array in self.arrays().items()},
            **self._actor_state(),
            "model": self._described(),
            "origin": flex.origin,
            "present": np.ones(flex.num_points, bool),
            "count": np.array(flex.num_points),
            "ends": np.ascontiguousarray(flex.edges),
            "lengths": flex.rest_lengths,
            "pairs": flex.mesh_distances.pairs.indices,
            "distances": flex.mesh_distances.pairs.distances,
            "num_edges": np.array(len(flex.edges)),
            "radius": np.array(flex.radius),
            "hold_force": np.array(flex.hold_force),
            "max_tracking_error": np.array(flex.max_tracking_error),
            "hold_stretch": np.array(flex.hold_stretch),
            "static_poses": self._static_poses(),
        }

    def _static_poses(self) -> np.ndarray:
        physics = self._env.physics
        return static_solids.poses(physics.model.ptr, physics.data.ptr, self._static)

    def _actor_state(self) -> dict[str, Any]:
        """Reads the state of the actor in the CPU environment."""
        is_pixel = isinstance(self._actor, PixelPickAndPlace)
        return {**self._actor.get_state(), **({"view": self._actor.view()} if is_pixel else {})}

    def _described(self) -> np.ndarray:
        """Converts the CPU environment's model for `ClothBatchSolver`."""
        return describe(self._env.physics.model.ptr, self._grippers(), solids=self._static)

    def placed(self, read: Arrays) -> Arrays:
        """Returns a row of `state`; pairs_at is the mesh's index in the distance tables."""
        own = {name: read[name] for name in read if name not in ("pairs", "distances")}
        key = read["ends"].tobytes() + read["lengths"].tobytes()
        first = self._distances.add(key, read["pairs"], read["distances"])
        model = self._solver.load(read["model"])
        return {**own, "model": np.array(model), "pairs_at": np.array(first)}

    def arrays(self) -> Arrays:
        found = {
            "qpos": self._flex.slides,
            "qvel": self._flex.slide_velocities,
            **self._actor_arrays(),
        }
        model, data = self._env.physics.model.ptr, self._env.physics.data.ptr
        rest, vertices = data.plugin_state[model.plugin_stateadr[0] :], self._flex.num_points
        for name, shape in {
            "valid": (1,),
            "reference": (vertices, 3),
            "after_edge": (len(self._flex.edges),),
            "holding_force": (vertices,),
            "after_layers": (vertices, batch_solver.KEPT_PAIRS, 4),
            "sides": (batch_solver.SIDES if self._solids()[0] else 0,),
        }.items():
            size = math.prod(shape)
            found[name], rest = rest[:size].reshape(shape), rest[size:]
        found["twist"] = np.zeros(1)  # The ropes of tasks do not twist.
        return found

    def _actor_arrays(self) -> Arrays:
        """Returns views of the actor's state in the CPU environment by name."""
        slides, velocities = self._actor.slides, self._actor.slide_velocities
        return {"gripper_qpos": slides, "gripper_qvel": velocities}

    def _grippers(self) -> list[int]:
        """Returns ids of the pickers' geoms."""
        model, root = self._env.physics.model.ptr, self._actor.mjcf_model.model
        return [model.geom(f"{root}/picker_{i}").id for i in range(self._actor.num_grippers)]

    def movers(self) -> list[int]:
        bodies = self._env.physics.model.ptr.geom_bodyid
        return [int(bodies[geom]) for geom in self._grippers()]

    # ------------------------------------------------------------------ environments

    def command(self, actions: Array) -> None:
        self._solver.queue.plan()
        self._pickers.command(actions)

    def sim_steps(self, usual: int) -> int:
        pickers = self._pickers
        return pickers.longest if isinstance(pickers, PickAndPlaceBatch) else usual

    def sim_step(self) -> None:
        xp, state, pickers = self._xp, self.state, self._pickers
        pickers.plan(self._offsets, state["present"])
        goals = pickers.goals(state["radius"])
        held = xp.clip(state["held"], min=0)
        forces = xp.take_along_axis(state["holding_force"], held, axis=1)
        start, way = (
            xp.take_along_axis(state[name], held[..., None], axis=1) for name in ("origin", "qpos")
        )
        behind = lengths(goals - (start + way))
        slips = is_overloaded(
            forces, behind, state["hold_force"][:, None], state["max_tracking_error"][:, None]
        )
        pickers.release_overloaded(goals, slips, self._gap)
        self._step(goals)

    def _offsets(self, centers: Array) -> Array:
        """Returns vertices relative to centers (num_envs, n, 3): (num_envs, n, vertices, 3) [m]."""
        state, room = self.state, self.state["origin"].shape[1]
        return state["qpos"][:, None, :room] + (state["origin"][:, None] - centers[:, :, None])

    def _step(self, goals: Array) -> None:
        """Steps the flex; held vertices move to their goals (num_envs, grippers, 3) [m]."""
        xp, state, models = self._xp, self.state, self._solver.models
        pickers = self._pickers
        if isinstance(pickers, PickAndPlaceBatch):  # Environments without a model stand still.
            whole = xp.asarray(models, copy=True)
            models[...] = xp.where(pickers.moving, whole, 0)
        motion = SolidMotion(state["static_poses"], 0.0, 0.0, 1) if self._static else None
        self._solver.step(state["center"], state["held"], goals, motion)
        if isinstance(pickers, PickAndPlaceBatch):
            models[...] = whole

    def _gap(self, first: Array, second: Array) -> Array:
        first, second = (self._xp.clip(held, min=0) for held in (first, second))
        distances = self._distances.between(self.state["pairs_at"], first, second)
        return (1.0 + self.state["hold_stretch"]) * distances

    # ------------------------------------------------------------------ what is seen

    def points(self, number: int) -> Array:
        return self._padded(number, 0.0)

    def _padded(self, number: int, padding: float) -> Array:
        """Returns `points` with other coordinates [m] of vertices that do not exist."""
        state = self.state
        number = min(number, state["origin"].shape[1])
        points = state["origin"][:, :number] + state["qpos"][:, :number]
        return self._xp.where(state["present"][:, :number, None], points, padding)

    def task_state(self, number: int) -> State:
        present = self._xp.asarray(self.state["present"][:, :number], copy=True)
        points = self.points(number)
        return State(
            {self._name: points}, {self._name: present}, {}, self._sensed(), self._remembered()
        )

    def _sensed(self) -> Array:
        """Returns the proprioception (num_envs, n)."""
        centers = self._xp.asarray(self.state["center"], copy=True)
        return centers.reshape((len(centers), -1))

    def _remembered(self) -> Array:
        """Returns the internal state (num_envs, n) of the actor."""
        return remembered(self._pickers.grips)

    def poses(self) -> Array:
        """Returns the poses of pickers, which never rotate."""
        centers = self.state["center"]
        still = constant([1.0, 0.0, 0.0, 0.0], centers)
        turns = self._xp.zeros_like(centers[..., :1]) + still
        return self._xp.concat([centers, turns], axis=-1)

    def strains(self) -> Array:
        xp, state = self._xp, self.state
        ends, points = state["ends"], self.points(state["origin"].shape[1])
        edges = xp.arange(ends.shape[1], device=self._device.xp_device)
        exists = edges < state["num_edges"][:, None]
        strains = edge_strains(points, ends, xp.where(exists, state["lengths"], 1.0))
        return xp.max(xp.where(exists, strains, -math.inf), axis=1)

    def info(self, strains: Array, largest: Array) -> dict[str, Array]:
        xp, state = self._xp, self.state
        varies = isinstance(self._pickers, PickAndPlaceBatch)
        return {
            **({"sim_steps": state["sim_steps"]} if varies else {}),
            "max_edge_strain": strains,
            "episode_max_edge_strain": largest,
            "max_speed": highest_speed(state["qvel"]),
            "picks_held": xp.sum(xp.astype(state["held"] >= 0, xp.int64), axis=1),
            "dropped": state["dropped"],
            "yielded": state["yielded"],
        }

    def holds(self) -> Array:
        return self._xp.astype(self.state["held"] >= 0, self._xp.uint8)

    def get_state(self, i: int) -> tuple[Arrays, Arrays]:
        actor = {name: self._device.get(self.state[name][i]) for name in self._actor.get_state()}
        return self._solver.get_state(i), actor
