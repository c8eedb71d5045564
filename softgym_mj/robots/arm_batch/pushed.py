"""`PushedArms`: arms in a batch that the object on their hands pushes back."""

import functools
from collections.abc import Mapping, Sequence
from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np

from softgym_mj.robots.arm.arms import Arms
from softgym_mj.robots.arm.fingers import OUT_OF_THE_WAY
from softgym_mj.robots.arm.grasps import CLOSING_SPEED, GRASPS, AttachGrasp
from softgym_mj.robots.arm.models import Arm
from softgym_mj.robots.arm.mounts import Mount
from softgym_mj.robots.arm.position_action import PositionAction
from softgym_mj.robots.arm_batch import (
    clearance,
    commands,
    contacts,
    dynamics,
    hands,
    inverse_kinematics,
    models,
)
from softgym_mj.robots.arm_batch.action_spaces import ACTION_SPACES
from softgym_mj.robots.arm_batch.chain import Pose
from softgym_mj.robots.arm_batch.controlled_arms import ControlledArms
from softgym_mj.robots.arm_batch.state import ArmState
from softgym_mj.robots.base import SIM_STEP

SUBSTEPS = 25  # Substeps of cloth and rope in a step, as in cloth/plugin.


class Push(NamedTuple):
    """Push of an object in a step, on n arms with k solids, m joints and two fingers.

    Attributes:
        impulses: sums J and K of each solid, `ClothBatchSolver.solid_impulses`
            (num_envs, n, k, 2, 6).
        accelerations: joint accelerations without the object (num_envs, n, m + 2) [rad/s^2
            or m/s^2].
        responses: joint velocities per unit impulse on each solid (num_envs, n, k, m + 2, 6).
    """

    impulses: jax.Array
    accelerations: jax.Array
    responses: jax.Array


class Hands(NamedTuple):
    """Hands at the start of a step, and their solids in it.

    Attributes:
        points: tool points (num_envs, n, 3) [m].
        velocities: their velocities (num_envs, n, 3) [m/s].
        solid: whether the pads touch anything in the step (num_envs, n) bool.
        solids: motion of the solids without the object; arrays begin with (num_envs, n, k).
        jacobians: as in `SolidMotion` (num_envs, n, k, 6, m + 2).
    """

    points: jax.Array
    velocities: jax.Array
    solid: jax.Array
    solids: hands.SolidSteps
    jacobians: jax.Array


class Ended(NamedTuple):
    """Arms at the end of an env step.

    Attributes:
        sensed: as `JointServos.sensed` (num_envs, n (8 + 2 m)).
        at_reach: number of commanded points at the end of the reach (num_envs,).
        remembered: as `ArmAction.remembered` (num_envs, k).
        poses: positions [m] and quaternions of the moving bodies (num_envs, n bodies, 7).
    """

    sensed: jax.Array
    at_reach: jax.Array
    remembered: jax.Array
    poses: jax.Array


class PushedArms(ControlledArms):
    """Arms of environments that step together, on the device of their arrays.

    Their control is that of `Arms`; their sim steps are single physics steps, interleaved with
    those of an object. Numbers have double precision, because the posture's cost is a millionth of
    the tools'.

    Call order in an env step: `solve` and `step_alone`, then `step_alone`, alternately; at the end
    `finish`.

    Attributes:
        is_pad: whether each solid of a hand is a pad (k,).
    """

    def __init__(self, arm: Arm, mounts: Sequence[Mount], grasp: str, action: str):
        """Prepares arms on mounts, with a grasp of `GRASPS` and one of `ACTION_SPACES`."""
        tips = AttachGrasp.tip_clearance - GRASPS[grasp].tip_clearance
        with jax.enable_x64(True):
            kinematics = inverse_kinematics.kinematics_of(arm, tuple(mounts), tips)
            super().__init__(arm, kinematics, ACTION_SPACES[action](arm, kinematics))
        self._grasp, self._solids = grasp, hands.solids_of(arm, grasp)
        self._shapes = clearance.shapes_of(*models.solid_model(arm, grasp))
        self.is_pad = self._solids.is_pad
        self.solve = jax.jit(jax.vmap(self._solved))
        self.step_alone = jax.jit(jax.vmap(self._alone, (0, 0, 0, 0, 0, 0, None)))
        self.finish = jax.jit(jax.vmap(self._finished))

    def no_push(self, number: int, device: jax.Device) -> Push:
        """Returns a push of zero for `number` environments, on a device."""
        shape = number, len(self.kinematics.base)
        solids, joints = len(self.is_pad), self._joints + 2
        shapes = (*shape, solids, 2, 6), (*shape, joints), (*shape, solids, joints, 6)
        with jax.enable_x64(True):
            return jax.device_put(Push(*map(np.zeros, shapes)), device)

    # ------------------------------------------------------------------ one environment

    def _solved(self, state: ArmState, action: jax.Array) -> ArmState:
        entries, _ = self._split(action)
        return self._solve(state, entries)

    def _alone(
        self,
        state: ArmState,
        push: Push,
        action: jax.Array,
        vertices: jax.Array,
        fixed: Mapping[str, contacts.Fixed],
        solid: jax.Array,
        phase: jax.Array,
    ) -> tuple[ArmState, Push, Hands]:
        """Applies the push of the last step, then steps the arms without the object.

        Args:
            state: arms after the last step without its push.
            push: push in the last step.
            action: action of the env step.
            vertices: positions of the object's vertices (v, 3) [m]; infinite ones do not exist.
            fixed: fixed solids by kind.
            solid: whether the pads of each hand touched anything in the last step (n,).
            phase: sim steps since the last solution.

        Returns:
            State after the step without its push, this push except its impulses, and the hands.
        """
        arm, (entries, closed) = self._dynamics, self._split(action)
        state = self._advance_command(_pushed(state, push), entries, phase > 0)
        pose = self._poses(state.positions)
        points, _, velocities = inverse_kinematics.hands(
            self.kinematics, arm.chain, pose, state.speeds
        )
        solid = self._solid(state, closed, self._clear(state, points, vertices), solid)
        state = self._gripped(state, closed)
        touches = solid[:, None] | ~self.is_pad
        later, inertia, solids = self._part(state, pose, phase + 1.0, fixed, touches)
        jacobians = jax.vmap(functools.partial(hands.jacobians, arm, self._solids))(
            pose, self.kinematics.yaw
        )
        found = push._replace(
            accelerations=(later.speeds - state.speeds) / arm.timestep,
            responses=jax.vmap(hands.responses)(jacobians, inertia),
        )
        return later, found, Hands(points, velocities, solid, solids, jacobians)

    def _split(self, action: jax.Array) -> tuple[jax.Array, jax.Array]:
        """Returns entries (n, k) of an action without grips, and which hands it closes (n,)."""
        each = action.reshape(len(self.kinematics.base), -1)
        return each[:, :-1], each[:, -1] > 0.0

    def _clear(self, state: ArmState, points: jax.Array, vertices: jax.Array) -> jax.Array:
        """Returns which hands (n,) are open and clear of vertices, as `Fingers.clear`."""
        opened = state.positions[:, self._joints :].min(1) > sum(self._arm.finger_range) / 2
        squares = ((vertices - points[:, None]) ** 2).sum(-1)
        return opened & (squares.min(1) > OUT_OF_THE_WAY**2)

    def _solid(
        self, state: ArmState, closed: jax.Array, clear: jax.Array, solid: jax.Array
    ) -> jax.Array:
        """Returns whether the pads of each hand (n,) touch anything, as `Grasp.plan`.

        Args:
            state: state of the arms, with the finger commands of the last sim step.
            closed: which hands close (n,).
            clear: result of `_clear`.
            solid: the last result.
        """
        if self._grasp == "attach":
            return ~closed & (solid | clear)
        opening = state.fingers.min(1) < self._arm.finger_range[1]
        return closed | jnp.where(~solid | opening, clear, solid)

    def _gripped(self, state: ArmState, closed: jax.Array) -> ArmState:
        """Returns the state with the fingers commanded for a sim step, as `Grasp.plan`."""
        if self._grasp == "attach":
            shut, opened = self._arm.finger_commands
        else:
            lowest, opened = self._arm.finger_range
            shut = jnp.maximum(state.fingers - CLOSING_SPEED * SIM_STEP, lowest)
        return state._replace(fingers=jnp.where(closed[:, None], shut, opened) * jnp.ones(2))

    def _part(
        self,
        state: ArmState,
        pose: Pose,
        phase: jax.Array,
        fixed: Mapping[str, contacts.Fixed],
        touches: jax.Array,
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

    def _finished(self, state: ArmState, push: Push) -> tuple[ArmState, Ended]:
        """Applies the push of the last sim step of an env step."""
        state = _pushed(state, push)
        pose = self._poses(state.positions)
        ends = commands.at_end(self._arm, self.kinematics, self._action.commanded(state))
        remembered = self._action.remembered(state)
        return state, Ended(self._sensed(state, pose), ends.sum(), remembered, self._placed(pose))


def _pushed(state: ArmState, push: Push) -> ArmState:
    """Returns the state with the push of the last step (cloth/batch/README.md)."""

    def gained(which: int) -> jax.Array:
        impulses = push.impulses[:, :, which, None]
        return (push.responses * impulses).sum((1, 3))

    acts = (push.impulses != 0.0).any((1, 2, 3))[:, None]
    missed = (1.0 - 1.0 / SUBSTEPS) / 2.0 * SIM_STEP**2 * push.accelerations
    return state._replace(
        positions=state.positions + gained(1) - jnp.where(acts, missed, 0.0),
        speeds=state.speeds + gained(0) * (SUBSTEPS / SIM_STEP),
    )


def kinds_of(arms: Arms) -> tuple[str, str]:
    """Returns the names of grasp and action of arms."""
    _, grasp, *action = arms.name.split("/")
    return grasp, (*action, PositionAction.name)[0]
