"""`Flexes`: a rope or cloth with pickers, in many worlds."""

import math

import numpy as np

from softgym_mj.cloth.worlds import KEPT_PAIRS, ClothWorlds, describe
from softgym_mj.entities.flex import Flex
from softgym_mj.envs.environment import Environment
from softgym_mj.exceptions import InvalidArgumentError
from softgym_mj.native.places import Place
from softgym_mj.robots.grip import remembered
from softgym_mj.robots.picker import Picker
from softgym_mj.tasks.shared.state import State
from softgym_mj.vector.batch.pickers import Pickers
from softgym_mj.vector.batch.rows import Rows
from softgym_mj.vector.batch.side import Arrays, Side, Start


class Mesh:
    """What a batch knows of a flex of some size and material.

    Attributes:
        model: of `ClothWorlds`.
        origin: of vertices (n, 3) [m].
        edges: vertices of edges (m, 2); lengths: of these at rest [m].
        hold_stretch, hold_force, radius: of the flex.
    """

    def __init__(self, model: np.ndarray, flex: Flex):
        """Notes what is known of a flex that has been compiled."""
        self.model = model
        self.origin, self.edges, self.lengths = flex.origin, flex.edges, flex.rest_lengths
        self.hold_stretch, self.hold_force = flex.hold_stretch, flex.hold_force
        self.radius = flex.radius
        self._ways = flex.ways

    def gap(self, first: int, second: int) -> float:
        """As `Flex.largest_gap`."""
        return (1.0 + self.hold_stretch) * self._ways.between(first, second)


class Flexes(Side):
    """See the module docstring."""

    def __init__(self, env: Environment, num_worlds: int, place: Place):
        """Makes worlds for an environment's task.

        Args:
            env: says how episodes start.
            num_worlds, place: of `ClothWorlds`.

        Raises:
            InvalidArgumentError: unless there is one flex and the actor is a picker.
        """
        task, flexes = env.task, env.task.flexes.flexes
        if type(task.actor) is not Picker:
            raise InvalidArgumentError("actor", task.actor.name, "'picker', on this device")
        if len(flexes) != 1 or len(task.objects) != 1:
            valid = "one rope, cloth or water, on this device"
            raise InvalidArgumentError("objects", [*task.scene.materials], valid)
        self._env, self._flex, self._actor = env, flexes[0], task.actor
        self._name = next(iter(task.scene.materials))
        actor, number = task.actor, task.max_points
        self._worlds = ClothWorlds(num_worlds, number, actor.num_grippers, place)
        self._pickers = Pickers(num_worlds, actor.num_grippers, actor.radius, actor.pick_distance)
        self._meshes: list[Mesh | None] = [None] * num_worlds
        self._known: dict[bytes, Mesh] = {}
        self._edges = Rows(num_worlds)
        self._origin = np.zeros((num_worlds, number, 3))
        self._present = np.zeros((num_worlds, number), bool)
        self._radius, self._force = np.zeros(num_worlds), np.zeros(num_worlds)

    @property
    def flags(self) -> np.ndarray:
        return self._worlds.flags

    # ------------------------------------------------------------------ the environment

    def describe(self) -> Mesh:
        """See `Side`; meshes that are alike are the same."""
        model, root = self._env.physics.model.ptr, self._actor.mjcf_model.model
        number = self._actor.num_grippers
        model = describe(model, [model.geom(f"{root}/picker_{i}").id for i in range(number)])
        return self._known.setdefault(model.tobytes(), Mesh(model, self._flex))

    def arrays(self) -> Arrays:
        """See `Side`: of `ClothWorlds`."""
        found = {
            "qpos": self._flex.slides,
            "qvel": self._flex.slide_velocities,
            "gripper_qpos": self._actor.slides,
            "gripper_qvel": self._actor.slide_velocities,
        }
        model, data = self._env.physics.model.ptr, self._env.physics.data.ptr
        rest, vertices = data.plugin_state[model.plugin_stateadr[0] :], self._flex.num_points
        for name, shape in {
            "valid": (1,),
            "reference": (vertices, 3),
            "after_edge": (len(self._flex.edges),),
            "holding_force": (vertices,),
            "after_layers": (vertices, KEPT_PAIRS, 4),
        }.items():
            size = math.prod(shape)
            found[name], rest = rest[:size].reshape(shape), rest[size:]
        return found

    # ------------------------------------------------------------------ worlds

    def start(self, i: int, start: Start) -> None:
        mesh: Mesh = start.model
        count = len(mesh.origin)
        self._meshes[i] = mesh
        self._worlds.start(i, mesh.model)
        self._worlds.set_state(i, start.state)
        self._pickers.set_state(i, start.actor)
        self._origin[i], self._present[i] = 0.0, False
        self._origin[i, :count], self._present[i, :count] = mesh.origin, True
        self._radius[i], self._force[i] = mesh.radius, mesh.hold_force
        self._edges.put(i, {"ends": mesh.edges, "lengths": mesh.lengths, "counts": len(mesh.edges)})

    def command(self, actions: np.ndarray) -> None:
        self._pickers.command(actions)

    def sim_step(self) -> None:
        worlds, pickers = self._worlds, self._pickers

        def offsets(centres: np.ndarray) -> np.ndarray:
            return worlds.qpos[:, None] + (self._origin[:, None] - centres[:, :, None])

        pickers.plan(offsets, self._present)
        goals = pickers.goals(self._radius)
        held = np.maximum(pickers.grips.held, 0)
        forces = np.take_along_axis(worlds.holding_force, held, 1)
        pickers.give_way(goals, forces > self._force[:, None], self._gap)
        worlds.step(pickers.grips.centre, pickers.grips.held, goals)

    def _gap(self, worlds: np.ndarray, first: np.ndarray, second: np.ndarray) -> np.ndarray:
        gaps = []
        for i, a, b in zip(worlds.tolist(), first.tolist(), second.tolist(), strict=True):
            mesh = self._meshes[i]
            assert mesh is not None, "a world that steps has one"
            gaps.append(mesh.gap(a, b))
        return np.array(gaps)

    # ------------------------------------------------------------------ what is seen

    def state(self, number: int) -> State:
        present = self._present[:, :number].copy()
        points = (self._origin + self._worlds.qpos)[:, :number]
        points[~present] = 0.0
        centres = self._pickers.grips.centre.reshape(len(points), -1).copy()
        return State(
            {self._name: points},
            {self._name: present},
            {},
            centres,
            remembered(self._pickers.grips),
        )

    def strains(self) -> np.ndarray:
        edges, points = self._edges.whole, self._origin + self._worlds.qpos
        ends, rows = edges["ends"], np.arange(len(points))[:, None]
        away = np.linalg.norm(points[rows, ends[..., 0]] - points[rows, ends[..., 1]], axis=-1)
        exists = np.arange(ends.shape[1]) < edges["counts"][:, None]
        strains = away / np.where(exists, edges["lengths"], 1.0) - 1.0
        return np.where(exists, strains, -np.inf).max(1)

    def info(self, strains: np.ndarray, largest: np.ndarray) -> dict[str, np.ndarray]:
        return {
            "max_edge_strain": strains,
            "episode_max_edge_strain": largest,
            "max_speed": np.sqrt((self._worlds.qvel**2).sum(-1).max(-1)),
            "picks_held": (self._pickers.grips.held >= 0).sum(1),
            "dropped": self._pickers.grips.dropped,
            "yielded": self._pickers.yielded,
        }

    def holds(self) -> np.ndarray:
        return (self._pickers.grips.held >= 0).astype(np.uint8)

    def get_state(self, i: int) -> tuple[Arrays, Arrays]:
        return self._worlds.get_state(i), self._pickers.get_state(i)
