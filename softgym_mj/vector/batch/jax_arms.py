"""`JaxArms`: what batch physics with arms have in common."""

import functools
from collections.abc import Callable, Sequence
from typing import Any, NamedTuple, TypeVar

import jax
import mujoco
import numpy as np

from softgym_mj.batch.device import Device
from softgym_mj.batch.solver import NOT_FINITE
from softgym_mj.envs.environment import Environment
from softgym_mj.exceptions import cpu_only
from softgym_mj.metrics import Array
from softgym_mj.robots.arm.actor import ArmActor
from softgym_mj.robots.arm.joint_servos import SOLVE_EVERY
from softgym_mj.robots.arm_batch.sharing import device_like, put, shared
from softgym_mj.robots.arm_batch.state import (
    ArmState,
    control_state,
    joint_state,
    packed,
    read_state,
    unpacked,
)
from softgym_mj.robots.base import SIM_STEP
from softgym_mj.tasks.shared.base import Task
from softgym_mj.vector.batch.physics import Arrays

T = TypeVar("T")


@functools.lru_cache(maxsize=8)
def _made(make: Callable[..., Any], *arguments: Any) -> Any:
    return make(*arguments)


class JaxArms:
    """Mixin of batch physics whose sim steps alternate with those of arms, by JAX.

    State of the arms: "arms", with the arrays of `read_state`, and "sensed", "remembered" and
    "poses" as in `PushedArms`.
    """

    is_interleaved = True
    state: dict[str, Any]
    flags: Array
    _env: Environment
    _device: Device
    _xp: Any
    _count = 0  # Sim steps in this env step.
    _results: Any  # Arrays that must not be overwritten yet.

    def _check_steps(self, task: Task) -> None:
        """Raises `InvalidArgumentError` if arms in batches do not support the steps of a task."""
        if task.physics_timestep != SIM_STEP:
            raise cpu_only(f"timestep={task.physics_timestep}")
        if task.action_repeat % SOLVE_EVERY:
            raise cpu_only(f"action_repeat={task.action_repeat} (odd) with arms")

    def _compiled(self, make: Callable[..., T], *arguments: Any) -> T:
        """Returns arms whose functions are compiled once for all batches of a process."""
        with jax.default_device(self._jax_device):
            return _made(make, *arguments)

    @functools.cached_property
    def _jax_device(self) -> jax.Device:
        return device_like(self.flags)

    def _shared(self, arrays: Any) -> Any:
        """Returns arrays of JAX in place of arrays of this batch."""
        return shared(arrays, self._jax_device)

    def _read(self, actor: ArmActor, bodies: Sequence[int]) -> dict[str, np.ndarray]:
        """Returns a row of the arms' state, with poses of `bodies`, from the CPU environment."""
        data = self._env.physics.data.ptr
        mujoco.mj_kinematics(self._env.physics.model.ptr, data)
        return {
            **read_state(actor),
            "sensed": actor.proprioception(),
            "remembered": actor.remembered(),
            "poses": np.concatenate([data.xpos[bodies], data.xquat[bodies]], axis=1),
        }

    def _end(self, state: ArmState, ended: NamedTuple) -> None:
        """Ends an env step with the state of the arms, and flags those that diverged."""
        put(self.state["arms"], {**unpacked(state), **ended._asdict()})
        self._results, self._count = (state, ended), 0
        unknown = ~self._xp.isfinite(self.state["arms"]["sensed"]).all(-1)
        self.flags[...] = self.flags | self._xp.astype(unknown, self.flags.dtype) * NOT_FINITE

    def _sensed(self) -> Array:
        return self._xp.asarray(self.state["arms"]["sensed"], copy=True)

    def _arms_of(self, i: int) -> tuple[Arrays, Arrays]:
        """Returns what arms add to `get_state` of environment `i`."""
        own = {name: self._device.get(array[i]) for name, array in self.state["arms"].items()}
        return joint_state(own), control_state(packed(own))
