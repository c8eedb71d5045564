"""`CupArmBatch`: batch physics of water in cups, one of which an arm holds."""

import functools
from typing import Any

import jax
import numpy as np

from softgym_mj.batch.device import Device
from softgym_mj.envs.environment import Environment
from softgym_mj.exceptions import cpu_only
from softgym_mj.metrics import Array
from softgym_mj.robots.arm.cup_arm import CupArm
from softgym_mj.robots.arm.joint_servos import SOLVE_EVERY
from softgym_mj.robots.arm_batch import models
from softgym_mj.robots.arm_batch.cups import CupArms, Load, read_load
from softgym_mj.robots.arm_batch.sharing import put
from softgym_mj.robots.arm_batch.state import joint_views, packed
from softgym_mj.robots.base import SIM_STEP
from softgym_mj.tasks.shared.base import Task
from softgym_mj.vector.batch.fluid import POSITION_AND_QUATERNION, FluidBatch
from softgym_mj.vector.batch.jax_arms import JaxArms
from softgym_mj.vector.batch.physics import Arrays


class CupArmBatch(JaxArms, FluidBatch):
    """Batch physics of water in cups, with the moving cup in the hand of an arm.

    Sim steps of the arms, by JAX, alternate with those of the water, whose forces act in the next
    one. State besides that of `FluidBatch`: "arms", with the arrays of `read_state` and those of
    `Ended`, and "load", with those of `Load`.
    """

    _pushes = True
    _mover: CupArm

    def __init__(self, env: Environment, num_envs: int, device: Device):
        super().__init__(env, num_envs, device)
        zeros = device.zeros
        # Arrays that keep their addresses, for graphs: inputs of sim steps, and the next commanded
        # pose of the cup and whether it is allowed.
        self._steps, self._commanded, self._goal = (
            zeros((num_envs, 3), "float64") for _ in range(3)
        )
        self._allowed = zeros((num_envs,), "bool")
        self._mobility = zeros((num_envs, len(self._cups), 2), "float64")

    def _check(self, task: Task) -> None:
        if not isinstance(task.actor, CupArm):
            raise cpu_only(f"actor={task.actor.name!r} with water")
        self._check_steps(task)

    @functools.cached_property
    def _arms(self) -> CupArms:
        return self._compiled(CupArms, self._mover.arm, self._mover.mount)

    # ------------------------------------------------------------------ the environment

    def _actor_state(self) -> dict[str, Any]:
        actor, state = self._mover, self._mover.get_state()
        arms = self._read(actor, self._links())
        load = read_load(actor, self._env.physics.model.ptr)
        return {**{name: state[name] for name in ("way", "rejected")}, "arms": arms, "load": load}

    def arrays(self) -> Arrays:
        return {**super().arrays(), **joint_views(self._mover.servos)}

    @property
    def _free(self) -> dict[int, str]:
        return {k: name for k, name in super()._free.items() if k > 0}

    def _links(self) -> list[int]:
        """Returns ids of the arm's moving bodies."""
        alone, _ = models.dynamic_model(self._mover.arm, SIM_STEP)
        root, model = self._mover.mjcf_model.model, self._env.physics.model.ptr
        moving = np.flatnonzero(alone.body_treeid >= 0)
        return [model.body(f"{root}/{alone.body(i).name}").id for i in moving]

    def movers(self) -> list[int]:
        return [*self._links(), *self._bodies()]

    # ------------------------------------------------------------------ environments

    def command(self, actions: Array) -> None:
        super().command(actions)
        self._steps[...] = self._step
        self._step = self._steps
        self._commanded[...] = self.state["arms"]["remembered"]
        self._choose()

    def _choose(self) -> None:
        """Computes the next commanded pose."""
        self._goal[...], self._allowed[...] = self._moved(self._commanded)

    def begin_sim_step(self) -> None:
        """Makes a sim step of the arms, with the forces of the water in the last one."""
        arms, phase, state, xp = self._arms, self._count % SOLVE_EVERY, self.state, self._xp
        state["rejected"][...] += xp.astype(~self._allowed, state["rejected"].dtype)
        with jax.enable_x64(True):
            if self._count == 0:
                self._now = packed(self._shared(state["arms"]))
                self._load = Load(**self._shared(state["load"]))
            told = self._shared((self._goal, state["forces"]))
            if phase == 0:
                self._now = arms.solve(self._now, told[0])
            self._now, held = arms.step(self._now, self._load, *told, phase)
        into = state["poses"][:, 0], self._mobility[:, 0], self._commanded
        put(dict(zip(held._fields, into, strict=True)), held._asdict())
        # JAX and PyTorch queue work separately and wait for each other where arrays are shared.
        # The last results may be overwritten only now that such a wait has been queued.
        self._results = told, held
        self._count += 1

    def sim_step(self) -> None:
        self._solver.step(self.state["poses"][..., POSITION_AND_QUATERNION], self._mobility)
        self._choose()

    def finish(self) -> None:
        with jax.enable_x64(True):
            ended = self._arms.finish(self._now)
        self._end(self._now, ended)

    # ------------------------------------------------------------------ what is seen

    def _remembered(self) -> Array:
        return self._xp.asarray(self.state["arms"]["remembered"], copy=True)

    def poses(self) -> Array:
        return self._xp.concat([self.state["arms"]["poses"], super().poses()], axis=1)

    def info(self, strains: Array, largest: Array) -> dict[str, Array]:
        return {**super().info(strains, largest), "ik_failures": self.state["arms"]["failures"]}

    def get_state(self, i: int) -> tuple[Arrays, Arrays]:
        state, actor = super().get_state(i)
        joints, control = self._arms_of(i)
        return {**state, **joints}, {**actor, **control}
