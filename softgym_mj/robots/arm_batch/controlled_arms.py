"""`ControlledArms`: control of the arms of one environment, from commands to joints."""

import functools

import jax
import jax.numpy as jnp
import numpy as np

from softgym_mj.robots.arm.joint_servos import SOLVE_EVERY
from softgym_mj.robots.arm.models import Arm
from softgym_mj.robots.arm_batch import chain as chains
from softgym_mj.robots.arm_batch import dynamics, hands, inverse_kinematics, models
from softgym_mj.robots.arm_batch.action_spaces import ActionSpace
from softgym_mj.robots.arm_batch.chain import Pose
from softgym_mj.robots.arm_batch.inverse_kinematics import Kinematics
from softgym_mj.robots.arm_batch.state import ArmState
from softgym_mj.robots.base import SIM_STEP


class ControlledArms:
    """Arms whose joints follow an action space; methods are for one environment.

    Attributes:
        kinematics: kinematics of the arms of an environment.
    """

    def __init__(self, arm: Arm, kinematics: Kinematics, action: ActionSpace):
        """Prepares the arms.

        Args:
            arm: kind of arm.
            kinematics: the arms.
            action: action space, whose commands the joints follow.
        """
        self._arm, self._joints, self.kinematics = arm, len(arm.joints), kinematics
        model, self._lags = models.dynamic_model(arm, SIM_STEP)
        self._dynamics, self._action = dynamics.dynamics_of(model), action

    def _solve(self, state: ArmState, entries: jax.Array) -> ArmState:
        """Starts a sim step with a solution of the inverse kinematics."""
        state = self._advance_command(state, entries, True)
        solved = self._action.solve(state)
        return state._replace(
            reference=solved.angles,
            rates=solved.speeds,
            start=state.goal,
            goal=solved.angles + self._lags * solved.speeds,
            reference_points=inverse_kinematics.tools(self.kinematics, solved.angles),
            failures=state.failures + solved.failed.astype(jnp.int32),
        )

    def _advance_command(
        self, state: ArmState, entries: jax.Array, moves: jax.Array | bool
    ) -> ArmState:
        """Returns the state with the command moved by a sim step, if it `moves`."""
        later = self._action.advance(state, entries)
        return jax.tree.map(lambda old, new: jnp.where(moves, new, old), state, later)

    def _poses(self, positions: jax.Array) -> Pose:
        return jax.vmap(functools.partial(chains.poses, self._dynamics.chain))(positions)

    def _commands(self, state: ArmState, phase: jax.Array) -> jax.Array:
        """Returns commanded positions (n, m + 2) of joints and fingers [rad or m].

        Args:
            state: state of the arms.
            phase: sim steps from the last solution to the end of the physics step.
        """
        way = phase / SOLVE_EVERY
        return jnp.concatenate(
            [(1.0 - way) * state.start + way * state.goal, state.fingers], axis=1
        )

    def _sensed(self, state: ArmState, pose: Pose) -> jax.Array:
        """Returns the proprioception, as `JointServos.sensed`."""
        chain = self._dynamics.chain
        points, rotations, _ = inverse_kinematics.hands(self.kinematics, chain, pose, state.speeds)
        joints, fingers = jnp.split(state.positions, [self._joints], axis=1)
        turns, oriented = hands.quaternions(rotations), self.kinematics.oriented
        nearer = jnp.where((turns * oriented).sum(-1, keepdims=True) < 0.0, -turns, turns)
        own = (
            nearer, fingers.sum(1, keepdims=True),
            joints, state.speeds[:, : self._joints],
        )  # fmt: skip
        return jnp.concatenate([points.ravel(), jnp.concatenate(own, axis=1).ravel()])

    def _placed(self, pose: Pose) -> jax.Array:
        """Returns positions [m] and quaternions of the moving bodies (n bodies, 7)."""
        arms, moving = self.kinematics, np.flatnonzero(self._dynamics.chain.moves.any(1))
        places = arms.base[:, None] + chains.apply(arms.yaw[:, None], pose.position[:, moving])
        turns = hands.quaternions(chains.product(arms.yaw[:, None], pose.rotation[:, moving]))
        return jnp.concatenate([places, turns], axis=-1).reshape(-1, 7)
