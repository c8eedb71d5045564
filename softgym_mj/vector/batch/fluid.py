"""`FluidBatch`: batch physics of water in cups, one of which moves."""

from typing import Any

import numpy as np

from softgym_mj.batch.device import Device
from softgym_mj.entities.cup_poses import whole_pose
from softgym_mj.envs.environment import Environment
from softgym_mj.exceptions import cpu_only
from softgym_mj.fluid.batch_solver import FluidBatchSolver, describe
from softgym_mj.metrics import Array, columns
from softgym_mj.robots.base import SIM_STEP
from softgym_mj.robots.cup_mover import CupMover, cup_step, moved
from softgym_mj.tasks.shared.base import Task
from softgym_mj.tasks.shared.state import State
from softgym_mj.vector.batch.physics import Arrays, BatchPhysics

POSITION_AND_QUATERNION = slice(7)  # Position and quaternion of a whole pose (8,).


class FluidBatch(BatchPhysics):
    """Batch physics of water in cups; the moving cup follows the rules of `CupMover`."""

    _pushes = False  # Whether the water exerts forces on the cup.

    def __init__(self, env: Environment, num_envs: int, device: Device):
        """Allocates the batch for an environment's task.

        Args:
            env: Example environment, which provides initial states.
            num_envs, device: Arguments of `FluidBatchSolver`.

        Raises:
            InvalidArgumentError: Unless the actor is a cup and there is one body of water.
        """
        task, self._env = env.task, env
        self._check(task)
        if len(task.scene.materials) != 1:
            raise cpu_only(f"a task with several objects {[*task.scene.materials]}")
        (self._name,) = task.scene.materials
        self._water, self._mover, self._cups = (
            task.scene.materials[self._name], task.actor, task.scene.cups,
        )  # fmt: skip
        self._names = [cup.mjcf_model.model for cup in self._cups]
        self._device, self._xp, self._number = device, device.xp, num_envs
        sizes = num_envs, task.max_points, len(self._cups), device
        self._solver = FluidBatchSolver(*sizes, self._pushes)
        self.flags, self.state = self._solver.flags, self._solver.rows()
        self._step: Array = None

    def _check(self, task: Task) -> None:
        """Raises `InvalidArgumentError` if the actor or a setting is not supported."""
        if type(task.actor) is not CupMover:
            raise cpu_only(f"actor={task.actor.name.split('/')[0]!r} with water")

    @property
    def changed(self) -> int:  # type: ignore[override]
        """Number of times that arrays outside `state` have been replaced."""
        return self._solver.grown

    # ------------------------------------------------------------------ the environment

    def read(self) -> Arrays:
        """Reads water, mover and cups of the CPU environment.

        Keys besides the state: model (for `FluidBatchSolver`), poses of cups (`whole_pose`) and
        their sizes (`Cup.arrays`).
        """
        own = self.arrays()
        return {
            **{name: own[name].copy() for name in FluidBatchSolver.fields},
            **self._actor_state(),
            "model": describe(self._env.physics.model.ptr, self._bodies()),
            "present": np.ones(self._water.num_points, bool),
            "poses": np.stack([cup.whole_pose for cup in self._cups]),
            "sizes": np.stack([cup.arrays["size"] for cup in self._cups]),
        }

    def _actor_state(self) -> dict[str, Any]:
        """Reads the state of the actor in the CPU environment."""
        return self._mover.get_state()

    def placed(self, read: Arrays) -> Arrays:
        return {**read, "model": np.array(self._solver.load(read["model"]))}

    def arrays(self) -> Arrays:
        """Returns views of the solver's state and of the poses of cups without joints, by name."""
        state = self._water.state
        found = {name: state[name] for name in ("known", "positions", "velocities")}
        # Poses of walls, and with water that pushes them, forces and impulses.
        walls = len(state["rest"]) // (7 + 2 * 6 if self._pushes else 7)
        poses, forces, pending = np.split(state["rest"], [7 * walls, 13 * walls])
        found["walls"] = poses.reshape(-1, 7)
        found["forces"], found["pending"] = forces.reshape(-1, 6), pending.reshape(-1, 6)
        for k, name in self._free.items():
            cup = self._cups[k]
            found[f"{name} position"], found[f"{name} quaternion"] = cup.position, cup.quaternion
        return found

    @property
    def _free(self) -> dict[int, str]:
        """Names of the cups without joints by index."""
        return dict(enumerate(self._names))

    def _bodies(self) -> list[int]:
        """Returns ids of the cups' bodies."""
        model = self._env.physics.model.ptr
        return [model.body(cup.body.full_identifier).id for cup in self._cups]

    def movers(self) -> list[int]:
        return self._bodies()

    # ------------------------------------------------------------------ environments

    def command(self, actions: Array) -> None:
        self._solver.queue.plan()
        self._step = cup_step(self._mover.max_step, actions)
        self.state["rejected"] = self._xp.zeros_like(self.state["rejected"])

    def sim_step(self) -> None:
        xp, state = self._xp, self.state
        pose = _planar(state["poses"])[:, 0]
        goal, allowed = self._moved(pose)
        state["rejected"] = state["rejected"] + xp.astype(~allowed, state["rejected"].dtype)
        state["way"] = xp.stack([pose, goal], axis=1)
        state["poses"] = xp.concat([whole_pose(goal)[:, None], state["poses"][:, 1:]], axis=1)
        self._solver.step(state["poses"][..., POSITION_AND_QUATERNION])

    def _moved(self, pose: Array) -> tuple[Array, Array]:
        """Returns `moved` for poses (num_envs, 3) of the cup that the actor moves."""
        sizes, planar = self.state["sizes"], _planar(self.state["poses"])
        cups = {name: (sizes[:, k], planar[:, k]) for k, name in enumerate(self._names)}
        cups[self._names[0]] = sizes[:, 0], pose
        return moved(self._mover.rule, pose, self._step, cups)

    # ------------------------------------------------------------------ what is seen

    def task_state(self, number: int) -> State:
        xp, state = self._xp, self.state
        present = xp.asarray(state["present"][:, :number], copy=True)
        points = self.points(number)
        poses = {
            name: xp.asarray(state["poses"][:, k], copy=True) for k, name in enumerate(self._names)
        }
        water = {self._name: points}, {self._name: present}
        return State(*water, poses, self._sensed(), self._remembered())

    def _sensed(self) -> Array:
        """Returns the proprioception (num_envs, n)."""
        return _planar(self.state["poses"][:, 0])

    def _remembered(self) -> Array:
        """Returns the internal state (num_envs, n) of the actor."""
        return (self.state["way"][:, 1] - self.state["way"][:, 0]) / SIM_STEP

    def points(self, number: int) -> Array:
        present = self.state["present"][:, :number, None]
        positions = self.state["positions"][:, : present.shape[1]]
        return self._xp.where(present, positions, 0.0)

    def poses(self) -> Array:
        return self.state["poses"][..., POSITION_AND_QUATERNION]

    def strains(self) -> Array:
        """Returns zeros (num_envs,): water has no edges."""
        return self._device.zeros((self._number,), "float64")

    def info(self, strains: Array, largest: Array) -> dict[str, Array]:
        return {"rejected_moves": self.state["rejected"]}

    def holds(self) -> Array:
        """Returns an empty array (num_envs, 0): there are no grippers."""
        return self._device.zeros((self._number, 0), "uint8")

    def get_state(self, i: int) -> tuple[Arrays, Arrays]:
        state = dict(self._solver.get_state(i))
        poses = self._device.get(self.state["poses"][i])
        for k, name in self._free.items():
            state[f"{name} position"], state[f"{name} quaternion"] = poses[k, :3], poses[k, 3:7]
        return state, {name: self._device.get(self.state[name][i]) for name in ("way", "rejected")}


def _planar(poses: Array) -> Array:
    """Returns x, z [m] and theta [rad] (..., 3) of whole poses (..., 8)."""
    return columns(*(poses[..., i] for i in (0, 2, 7)))
