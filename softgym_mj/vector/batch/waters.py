"""`Waters`: water in cups, one of which moves, in many worlds."""

import math

import numpy as np

from softgym_mj.entities.cup_poses import whole_pose
from softgym_mj.envs.environment import Environment
from softgym_mj.exceptions import InvalidArgumentError
from softgym_mj.fluid.worlds import WaterWorlds, describe
from softgym_mj.native.places import Place
from softgym_mj.robots.base import SIM_STEP
from softgym_mj.robots.cup_mover import CupMover
from softgym_mj.tasks.shared.state import State
from softgym_mj.vector.batch.side import Arrays, Side, Start

POSITION_AND_QUATERNION, PLANAR = slice(7), [0, 2, 7]  # Of a whole pose.


class Waters(Side):
    """See the module docstring. The cup that moves does what `CupMover` does."""

    def __init__(self, env: Environment, num_worlds: int, place: Place):
        """Makes worlds for an environment's task.

        Args:
            env: says how episodes start.
            num_worlds, place: of `WaterWorlds`.

        Raises:
            InvalidArgumentError: unless a cup that is told where to go is the actor.
        """
        task, self._env = env.task, env
        if type(task.actor) is not CupMover:
            raise InvalidArgumentError("actor", task.actor.name, "'cup', on this device")
        if len(task.scene.materials) != 1:
            valid = "one rope, cloth or water, on this device"
            raise InvalidArgumentError("objects", [*task.scene.materials], valid)
        (self._name,) = task.scene.materials
        self._water, self._mover, self._cups = (
            task.scene.materials[self._name], task.actor, task.scene.cups,
        )  # fmt: skip
        self._names = [cup.mjcf_model.model for cup in self._cups]
        self._moving = np.flatnonzero(self._mover.max_step)
        number = task.max_points
        self._worlds = WaterWorlds(num_worlds, number, len(self._cups), place)
        self._present = np.zeros((num_worlds, number), bool)
        self._poses = np.zeros((num_worlds, len(self._cups), 8))
        self._sizes = np.zeros((num_worlds, len(self._cups), 4))
        self._step, self._way = np.zeros((num_worlds, 3)), np.zeros((num_worlds, 2, 3))
        self._rejected = np.zeros(num_worlds, int)

    @property
    def flags(self) -> np.ndarray:
        return self._worlds.flags

    # ------------------------------------------------------------------ the environment

    def describe(self) -> np.ndarray:
        """See `Side`: bytes (size,) uint8 of `WaterWorlds`."""
        model = self._env.physics.model.ptr
        return describe(model, [model.body(cup.body.full_identifier).id for cup in self._cups])

    def arrays(self) -> Arrays:
        """See `Side`: of `WaterWorlds`, then where the cups are."""
        model, data = self._env.physics.model.ptr, self._env.physics.data.ptr
        count, state = self._water.num_points, data.plugin_state[model.plugin_stateadr[0] :]
        known, positions, velocities, walls = np.split(state, [1, 1 + 3 * count, 1 + 6 * count])
        found = {
            "known": known,
            "positions": positions.reshape(-1, 3),
            "velocities": velocities.reshape(-1, 3),
            "walls": walls.reshape(-1, 7),
        }
        for name, cup in zip(self._names, self._cups, strict=True):
            found[f"{name} position"], found[f"{name} quaternion"] = cup.position, cup.quaternion
        return found

    # ------------------------------------------------------------------ worlds

    def start(self, i: int, start: Start) -> None:
        own = {name: start.state[name] for name in ("known", "positions", "velocities", "walls")}
        self._worlds.start(i, start.model)
        self._worlds.set_state(i, own)
        self._present[i] = False
        self._present[i, : len(own["positions"])] = True
        for k, name in enumerate(self._names):
            position, quaternion = (start.state[f"{name} {x}"] for x in ("position", "quaternion"))
            self._poses[i, k, :3], self._poses[i, k, 3:7] = position, quaternion
            self._poses[i, k, 7] = 2.0 * math.atan2(quaternion[2], quaternion[0])
            self._sizes[i, k] = start.episode.shapes[name]["size"]
        self._way[i], self._rejected[i] = start.actor["way"], start.actor["rejected"]

    def command(self, actions: np.ndarray) -> None:
        self._step = np.zeros_like(self._step)
        self._step[:, self._moving] = self._mover.max_step[self._moving] * actions
        self._rejected = np.zeros_like(self._rejected)

    def sim_step(self) -> None:
        pose = self._poses[:, 0, PLANAR]
        cups = {
            name: (self._sizes[:, k], self._poses[:, k, PLANAR])
            for k, name in enumerate(self._names)
        }
        wanted, allowed = self._mover.rule(pose + self._step, cups)
        self._rejected = self._rejected + ~allowed
        goal = np.where(allowed[:, None], wanted, pose)
        self._way = np.stack([pose, goal], axis=1)
        self._poses[:, 0] = whole_pose(goal)
        self._worlds.step(self._poses[..., POSITION_AND_QUATERNION])

    # ------------------------------------------------------------------ what is seen

    def state(self, number: int) -> State:
        present = self._present[:, :number].copy()
        points = self._worlds.positions[:, :number].copy()
        points[~present] = 0.0
        poses = {name: self._poses[:, k].copy() for k, name in enumerate(self._names)}
        velocity = (self._way[:, 1] - self._way[:, 0]) / SIM_STEP
        sensed = self._poses[:, 0, PLANAR]
        return State({self._name: points}, {self._name: present}, poses, sensed, velocity)

    def strains(self) -> np.ndarray:
        """See `Side`: zeros (num_worlds,), there is no edge."""
        return np.zeros(len(self._present))

    def info(self, strains: np.ndarray, largest: np.ndarray) -> dict[str, np.ndarray]:
        return {"rejected_moves": self._rejected}

    def holds(self) -> np.ndarray:
        """See `Side`: (num_worlds, 0), there are no grippers."""
        return np.zeros((len(self._present), 0), np.uint8)

    def get_state(self, i: int) -> tuple[Arrays, Arrays]:
        state = dict(self._worlds.get_state(i))
        for k, name in enumerate(self._names):
            state[f"{name} position"] = self._poses[i, k, :3].copy()
            state[f"{name} quaternion"] = self._poses[i, k, 3:7].copy()
        return state, {"way": self._way[i].copy(), "rejected": np.array(self._rejected[i])}
