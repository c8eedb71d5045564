"""`ArmBatch`: one or two arms in each environment of a batch, with the control of `Arms`."""

import functools
from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np

from softgym_mj.exceptions import InvalidArgumentError
from softgym_mj.robots.arm import arms as cpu
from softgym_mj.robots.arm.grasps import CLOSING_SPEED, GRASPS, AttachGrasp
from softgym_mj.robots.arm.joint_servos import SOLVE_EVERY
from softgym_mj.robots.arm.models import Arm
from softgym_mj.robots.arm.mounts import Mount
from softgym_mj.robots.arm.position_action import PositionAction
from softgym_mj.robots.arm_batch import (
    clearance,
    contacts,
    dynamics,
    hands,
    inverse_kinematics,
    models,
)
from softgym_mj.robots.arm_batch.action_spaces import ACTION_SPACES
from softgym_mj.robots.arm_batch.chain import Pose
from softgym_mj.robots.arm_batch.controlled_arms import ControlledArms
from softgym_mj.robots.arm_batch.sharing import to_jax
from softgym_mj.robots.arm_batch.state import ArmState, packed
from softgym_mj.robots.base import SIM_STEP


class Motion(NamedTuple):
    """Hands at the end of each of t sim steps, with p physics steps in all.

    Attributes:
        points: tool points (t, num_envs, n, 3) [m].
        rotations: rotation matrices of the tools (t, num_envs, n, 3, 3).
        velocities: velocities of the tool points (t, num_envs, n, 3) [m/s].
        openings: distances of the pads (t, num_envs, n) [m].
        joints: joint angles (t, num_envs, n, m) [rad].
        solids: motion of the hands' solids in each physics step; arrays begin with (p, num_envs,
            n).
    """

    points: jax.Array
    rotations: jax.Array
    velocities: jax.Array
    openings: jax.Array
    joints: jax.Array
    solids: hands.SolidSteps


class ArmBatch(ControlledArms):
    """Arms of environments that step together, on the device of their arrays.

    No object pushes on the arms. Numbers have double precision, because the posture's cost is a
    millionth of the tools'. `torch.from_dlpack` shares arrays with PyTorch.
    """

    def __init__(
        self,
        arm: Arm,
        mounts: Sequence[Mount],
        timestep: float = SIM_STEP,
        action: str = PositionAction.name,
        grasp: str = "attach",
    ):
        """Prepares the arms.

        Args:
            arm: kind of arm.
            mounts: bases of the arms of an environment.
            timestep: physics step [s], a sim step divided by a whole number.
            action: one of `ACTION_SPACES`.
            grasp: one of `GRASPS`.
        """
        tips = AttachGrasp.tip_clearance - GRASPS[grasp].tip_clearance
        with jax.enable_x64(True):
            kinematics = inverse_kinematics.kinematics_of(arm, tuple(mounts), tips)
            super().__init__(arm, kinematics, ACTION_SPACES[action](arm, kinematics), timestep)
        self._grasp, self._solids = grasp, hands.solids_of(arm, grasp)
        self._shapes = clearance.shapes_of(*models.solid_model(arm, grasp))
        self._parts = round(SIM_STEP / timestep)
        self._step = jax.jit(jax.vmap(self._env_step, (0, 0, None), (0, 1)), static_argnums=2)

    @classmethod
    def of(cls, arms: cpu.Arms, timestep: float = SIM_STEP) -> "ArmBatch":
        """Returns a batch of arms as those of an environment."""
        grasp, action = kinds_of(arms)
        return cls(arms.arm, arms.mounts, timestep, action, grasp)

    def stack(self, rows: Sequence[dict[str, np.ndarray]], device: Any = None) -> ArmState:
        """Returns the state of environments on a device of JAX, from a row of each.

        Args:
            rows: results of `read_state`.
            device: the device; None for the first of JAX's.
        """
        with jax.enable_x64(True):
            own = {name: np.stack([row[name] for row in rows]) for name in rows[0]}
            return jax.device_put(packed(own), device or jax.devices()[0])

    def step(self, state: ArmState, actions: Any, sim_steps: int) -> tuple[ArmState, Motion]:
        """Returns state and motion of an env step.

        Args:
            state: state of the environments.
            actions: entries and grip of each arm (num_envs, k n), an array of NumPy, of JAX or,
                on the same device, of PyTorch.
            sim_steps: number of sim steps, even.

        Raises:
            InvalidArgumentError: for an odd number of sim steps.
        """
        if sim_steps % SOLVE_EVERY:
            raise InvalidArgumentError("sim_steps", sim_steps, f"a multiple of {SOLVE_EVERY}")
        with jax.enable_x64(True):
            (device,) = state.positions.devices()
            actions = jnp.asarray(to_jax(actions, device), jnp.float64)
            return self._step(state, actions, sim_steps)

    # ------------------------------------------------------------------ one environment

    def _env_step(
        self, state: ArmState, action: jax.Array, sim_steps: int
    ) -> tuple[ArmState, Motion]:
        entries, closed = self._split(action)

        def period(found, _):
            now, pose = found
            now = self._solve(now, entries)
            return jax.lax.scan(sim_step, (now, pose), jnp.arange(SOLVE_EVERY))

        def sim_step(found, phase):
            now, pose = found
            now = self._advance_command(now, entries, phase > 0)
            now, pose, solids = self._move(self._gripped(now, closed), pose, phase)
            return (now, pose), (self._motion(now, pose), solids)

        begin = state, self._poses(state.positions)
        (state, _), (motion, solids) = jax.lax.scan(period, begin, None, sim_steps // SOLVE_EVERY)
        points, rotations, velocities, openings, joints = (
            array.reshape(-1, *array.shape[2:]) for array in motion
        )
        solids = jax.tree.map(lambda array: array.reshape(-1, *array.shape[3:]), solids)
        return state, Motion(points, rotations, velocities, openings, joints, solids)

    def _split(self, action: jax.Array) -> tuple[jax.Array, jax.Array]:
        """Returns entries (n, k) of an action without grips, and which hands it closes (n,)."""
        each = action.reshape(len(self.kinematics.base), -1)
        return each[:, :-1], each[:, -1] > 0.0

    def _gripped(self, state: ArmState, closed: jax.Array) -> ArmState:
        """Returns the state with the fingers commanded for a sim step, as `Grasp.plan`."""
        if self._grasp == "attach":
            shut, opened = self._arm.finger_commands
        else:
            lowest, opened = self._arm.finger_range
            shut = jnp.maximum(state.fingers - CLOSING_SPEED * SIM_STEP, lowest)
        return state._replace(fingers=jnp.where(closed[:, None], shut, opened) * jnp.ones(2))

    def _move(
        self, state: ArmState, pose: Pose, phase: jax.Array
    ) -> tuple[ArmState, Pose, hands.SolidSteps]:
        """Returns state and pose after the physics of a sim step, and the motion of solids in it.

        Args:
            state: state of the arms.
            pose: their pose.
            phase: sim steps since the last solution.
        """

        def part(moving, count):
            state, pose = moving
            fraction = (count + 1.0) / self._parts
            state, _, solids = self._part(state, pose, phase + fraction)
            return (state, self._poses(state.positions)), solids

        (state, pose), solids = jax.lax.scan(part, (state, pose), jnp.arange(self._parts))
        return state, pose, solids

    def _part(
        self,
        state: ArmState,
        pose: Pose,
        phase: jax.Array,
        fixed: Mapping[str, contacts.Fixed] | None = None,
        touches: jax.Array | None = None,
    ) -> tuple[ArmState, jax.Array, hands.SolidSteps]:
        """Returns the state after a physics step, the arms' inertia, and the motion of solids.

        Args:
            state: state of the arms.
            pose: their pose.
            phase: sim steps from the last solution to the end of the physics step.
            fixed: fixed solids by kind.
            touches: which solids of hands touch them (n, k) bool.
        """
        arm, arms, command = self._dynamics, self.kinematics, self._commands(state, phase)

        def step(pose, positions, speeds, command, base, yaw, touches):
            met = None
            if fixed:
                place = base, yaw
                met = contacts.contacts(arm.chain, self._shapes, fixed, pose, place, touches)
            return dynamics.step(arm, pose, positions, speeds, command, contacts=met)

        positions, speeds, inertia = jax.vmap(step)(
            pose, state.positions, state.speeds, command, arms.base, arms.yaw, touches
        )
        solids = jax.vmap(functools.partial(hands.steps, arm, self._solids))(
            pose, state.speeds, speeds, arms.base, arms.yaw
        )
        return state._replace(positions=positions, speeds=speeds), inertia, solids

    def _motion(self, state: ArmState, pose: Pose) -> tuple[jax.Array, ...]:
        """Returns the fields of `Motion` except the solids."""
        tools = inverse_kinematics.hands(self.kinematics, self._dynamics.chain, pose, state.speeds)
        joints, fingers = jnp.split(state.positions, [self._joints], axis=1)
        return *tools, fingers.sum(-1), joints


def kinds_of(arms: cpu.Arms) -> tuple[str, str]:
    """Returns the names of grasp and action of arms."""
    _, grasp, *action = arms.name.split("/")
    return grasp, (*action, PositionAction.name)[0]
