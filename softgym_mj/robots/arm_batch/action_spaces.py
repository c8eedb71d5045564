"""Action spaces of arms as functions of one environment: commands that the joints follow."""

from collections.abc import Callable
from typing import Protocol

import jax
import jax.numpy as jnp

from softgym_mj.robots.arm import cartesian
from softgym_mj.robots.arm.command_filter import Filter
from softgym_mj.robots.arm.joint_action import FASTEST_AS, JointAction
from softgym_mj.robots.arm.joint_servos import SOLVE_EVERY
from softgym_mj.robots.arm.models import Arm
from softgym_mj.robots.arm.pose_action import MAX_TILT, MAX_TURN, TURNS_AS, PoseAction
from softgym_mj.robots.arm.position_action import PositionAction
from softgym_mj.robots.arm_batch import chain, commands, hands, inverse_kinematics, rotations
from softgym_mj.robots.arm_batch.inverse_kinematics import Kinematics, Reference
from softgym_mj.robots.arm_batch.state import ArmState
from softgym_mj.robots.base import SIM_STEP
from softgym_mj.robots.gripper import MAX_DISPLACEMENT

AHEAD = SOLVE_EVERY - 1  # Sim steps by which solutions extrapolate the filter.


class ActionSpace(Protocol):
    """Action space of n arms: `ArmAction` as functions."""

    def advance(self, state: ArmState, entries: jax.Array) -> ArmState:
        """Starts a sim step: moves the command, and the filter behind it.

        Args:
            state: state of the arms.
            entries: entries of the action without grips (n, k).
        """

    def solve(self, state: ArmState) -> Reference:
        """Moves the reference to the extrapolated filter."""

    def commanded(self, state: ArmState) -> jax.Array:
        """Returns commanded tool points (n, 3) [m]."""

    def remembered(self, state: ArmState) -> jax.Array:
        """Returns `ArmAction.remembered` (k,)."""


class PositionActionSpace(ActionSpace):
    """`PositionAction`: displacements of the tool points."""

    def __init__(self, arm: Arm, arms: Kinematics):
        """Prepares the action space for a kind of arm."""
        self._arm, self._arms = arm, arms

    def advance(self, state: ArmState, entries: jax.Array) -> ArmState:
        assert state.limits is not None
        wanted = state.filter.commanded + MAX_DISPLACEMENT * entries[:, :3]
        wanted = commands.within_reach(self._arm, self._arms, wanted, state.limits)
        return state._replace(filter=commands.advance(state.filter, wanted, state.reference_points))

    def solve(self, state: ArmState) -> Reference:
        ahead = state.filter.points + AHEAD * state.filter.step
        return inverse_kinematics.follow_points(self._arms, state.reference, ahead)

    def commanded(self, state: ArmState) -> jax.Array:
        return state.filter.commanded

    def remembered(self, state: ArmState) -> jax.Array:
        return state.filter.commanded.ravel()


class PoseActionSpace(PositionActionSpace):
    """`PoseAction`: displacements and rotations of the tools."""

    def advance(self, state: ArmState, entries: jax.Array) -> ArmState:
        state = super().advance(state, entries)
        assert state.turns is not None
        turn = rotations.quaternions(MAX_TURN * entries[:, 3:])
        wanted = rotations.compose(turn, _turned(state, state.turns.commanded))
        wanted = _about(state, rotations.upright(wanted, MAX_TILT))
        reference = hands.quaternions(
            inverse_kinematics.tool_rotations(self._arms, state.reference)
        )
        turns = commands.advance(state.turns, wanted, _about(state, reference))
        commanded = _turned(state, turns.commanded)
        state = state._replace(oriented=_turned(state, turns.points))
        zero = jnp.zeros_like(turns.points)
        return state._replace(turns=Filter(_about(state, commanded), zero, turns.step))

    def solve(self, state: ArmState) -> Reference:
        assert state.turns is not None
        ahead = state.filter.points + AHEAD * state.filter.step
        turned = rotations.matrices(_turned(state, AHEAD * state.turns.step))
        own = chain.product(self._arms.yaw.transpose(0, 2, 1), turned)
        return inverse_kinematics.follow_points(self._arms, state.reference, ahead, own)

    def remembered(self, state: ArmState) -> jax.Array:
        assert state.turns is not None
        turned = _turned(state, state.turns.commanded)
        return jnp.concatenate([super().remembered(state), turned.ravel()])


def _turned(state: ArmState, ways: jax.Array) -> jax.Array:
    """Returns the filter's orientations, rotated by `ways` (n, 3) [m]: (n, 4)."""
    return rotations.compose(rotations.quaternions(ways / TURNS_AS), state.oriented)


def _about(state: ArmState, orientations: jax.Array) -> jax.Array:
    """Returns rotations (n, 3) [m] from the filter's orientations to others (n, 4)."""
    return TURNS_AS * rotations.between(state.oriented, orientations)


class JointActionSpace(ActionSpace):
    """`JointAction`: rotations of the joints."""

    def __init__(self, arm: Arm, arms: Kinematics):
        """Prepares the action space for a kind of arm."""
        self._arms = arms
        self._scale = FASTEST_AS / arms.speed  # [m/rad] (m,)

    def advance(self, state: ArmState, entries: jax.Array) -> ArmState:
        arms, margin = self._arms, cartesian.LIMIT_MARGIN
        wanted = self._angles(state.filter.commanded) + SIM_STEP * arms.speed * entries
        wanted = self._scaled(jnp.clip(wanted, arms.low + margin, arms.high - margin))
        reference = self._scaled(state.reference)
        return state._replace(filter=commands.advance(state.filter, wanted, reference))

    def solve(self, state: ArmState) -> Reference:
        ahead = self._angles(state.filter.points + AHEAD * state.filter.step)
        return inverse_kinematics.follow_joints(self._arms, state.reference, ahead)

    def commanded(self, state: ArmState) -> jax.Array:
        return inverse_kinematics.tools(self._arms, self._angles(state.filter.commanded))

    def remembered(self, state: ArmState) -> jax.Array:
        return self._angles(state.filter.commanded).ravel()

    def _scaled(self, angles: jax.Array) -> jax.Array:
        return (angles * self._scale).reshape(-1, 1)

    def _angles(self, points: jax.Array) -> jax.Array:
        return points.reshape(-1, len(self._scale)) / self._scale


ACTION_SPACES: dict[str, Callable[[Arm, Kinematics], ActionSpace]] = {
    PositionAction.name: PositionActionSpace,
    PoseAction.name: PoseActionSpace,
    JointAction.name: JointActionSpace,
}
