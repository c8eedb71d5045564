"""`Waters`: water in cups, one of which moves, in many environments."""

import math

import numpy as np

from softgym_mj.batch.device import Device
from softgym_mj.entities.cup_poses import whole_pose
from softgym_mj.envs.environment import Environment
from softgym_mj.exceptions import InvalidArgumentError
from softgym_mj.fluid.batch_solver import FluidBatchSolver, describe
from softgym_mj.metrics import Array, columns
from softgym_mj.robots.base import SIM_STEP
from softgym_mj.robots.cup_mover import CupMover, cup_step, moved
from softgym_mj.tasks.shared.state import State
from softgym_mj.vector.batch.side import Arrays, Side

POSITION_AND_QUATERNION = slice(7)  # Of a whole pose.


class Waters(Side):
    """See the module docstring. The cup that moves does what `CupMover` does."""

    def __init__(self, env: Environment, num_envs: int, device: Device):
        """Makes environments for an environment's task.

        Args:
            env: says how episodes start.
            num_envs, device: of `FluidBatchSolver`.

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
        self._device, self._xp, self._number = device, device.xp, num_envs
        self._solver = FluidBatchSolver(num_envs, task.max_points, len(self._cups), device)
        self.flags, self.now = self._solver.flags, self._solver.rows()
        self._step: Array = None

    @property
    def changed(self) -> int:  # type: ignore[override]
        """See `Side`."""
        return self._solver.grown

    # ------------------------------------------------------------------ the environment

    def read(self) -> Arrays:
        """See `Side`: the state of the water, what the mover remembers, and the cups.

        model: of `FluidBatchSolver`. poses: as `whole_pose` has them; sizes: as `Cup.arrays` has
        them.
        """
        model, own = self._env.physics.model.ptr, self.arrays()
        poses = []
        for name in self._names:
            quaternion = own[f"{name} quaternion"]
            theta = 2.0 * math.atan2(quaternion[2], quaternion[0])
            poses.append(np.concatenate([own[f"{name} position"], quaternion, [theta]]))
        return {
            **{name: own[name].copy() for name in FluidBatchSolver.fields},
            **self._mover.get_state(),
            "model": describe(model, self.movers()),
            "present": np.ones(self._water.num_points, bool),
            "poses": np.stack(poses),
            "sizes": np.stack([cup.arrays["size"] for cup in self._cups]),
        }

    def placed(self, read: Arrays) -> Arrays:
        return {**read, "model": np.array(self._solver.load(read["model"]))}

    def arrays(self) -> Arrays:
        """See `Side`: of `FluidBatchSolver`, then where the cups are."""
        state = self._water.state
        found = {name: state[name] for name in ("known", "positions", "velocities")}
        found["walls"] = state["rest"].reshape(-1, 7)
        for name, cup in zip(self._names, self._cups, strict=True):
            found[f"{name} position"], found[f"{name} quaternion"] = cup.position, cup.quaternion
        return found

    def movers(self) -> list[int]:
        model = self._env.physics.model.ptr
        return [model.body(cup.body.full_identifier).id for cup in self._cups]

    # ------------------------------------------------------------------ environments

    def command(self, actions: Array) -> None:
        self._solver.queue.plan()
        self._step = cup_step(self._mover.max_step, actions)
        self.now["rejected"] = self._xp.zeros_like(self.now["rejected"])

    def sim_step(self) -> None:
        xp, now = self._xp, self.now
        planar = _planar(now["poses"])
        cups = {name: (now["sizes"][:, k], planar[:, k]) for k, name in enumerate(self._names)}
        pose = planar[:, 0]
        goal, allowed = moved(self._mover.rule, pose, self._step, cups)
        now["rejected"] = now["rejected"] + xp.astype(~allowed, now["rejected"].dtype)
        now["way"] = xp.stack([pose, goal], axis=1)
        now["poses"] = xp.concat([whole_pose(goal)[:, None], now["poses"][:, 1:]], axis=1)
        self._solver.step(self.poses())

    # ------------------------------------------------------------------ what is seen

    def state(self, number: int) -> State:
        xp, now = self._xp, self.now
        present = xp.asarray(now["present"][:, :number], copy=True)
        points = self.points(number)
        poses = {
            name: xp.asarray(now["poses"][:, k], copy=True) for k, name in enumerate(self._names)
        }
        velocity = (now["way"][:, 1] - now["way"][:, 0]) / SIM_STEP
        sensed = _planar(now["poses"][:, 0])
        return State({self._name: points}, {self._name: present}, poses, sensed, velocity)

    def points(self, number: int) -> Array:
        present = self.now["present"][:, :number, None]
        positions = self.now["positions"][:, : present.shape[1]]
        return self._xp.where(present, positions, 0.0)

    def poses(self) -> Array:
        return self.now["poses"][..., POSITION_AND_QUATERNION]

    def strains(self) -> Array:
        """See `Side`: zeros (num_envs,), there is no edge."""
        return self._device.zeros((self._number,), "float64")

    def info(self, strains: Array, largest: Array) -> dict[str, Array]:
        return {"rejected_moves": self.now["rejected"]}

    def holds(self) -> Array:
        """See `Side`: (num_envs, 0), there are no grippers."""
        return self._device.zeros((self._number, 0), "uint8")

    def get_state(self, i: int) -> tuple[Arrays, Arrays]:
        state = dict(self._solver.get_state(i))
        poses = self._device.get(self.now["poses"][i])
        for pose, name in zip(poses, self._names, strict=True):
            state[f"{name} position"], state[f"{name} quaternion"] = pose[:3], pose[3:7]
        return state, {name: self._device.get(self.now[name][i]) for name in ("way", "rejected")}


def _planar(poses: Array) -> Array:
    """x, z [m] and theta [rad] (..., 3) of whole poses (..., 8)."""
    return columns(*(poses[..., i] for i in (0, 2, 7)))
