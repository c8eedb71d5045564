"""`CupArms`: an arm with a cup in each environment of a batch, with the control of `CupArm`."""

from typing import NamedTuple

import jax
import jax.numpy as jnp
import mujoco
import numpy as np

from softgym_mj.entities.cup import GRIP
from softgym_mj.robots.arm import turns
from softgym_mj.robots.arm.command_filter import clipped
from softgym_mj.robots.arm.cup_arm import ORIENTATION_COST, ORIENTED, TURNS_AS, UPRIGHT, CupArm
from softgym_mj.robots.arm.models import Arm
from softgym_mj.robots.arm.mounts import Mount
from softgym_mj.robots.arm_batch import chain as chains
from softgym_mj.robots.arm_batch import (
    commands,
    constraints,
    dynamics,
    hands,
    inverse_kinematics,
    models,
)
from softgym_mj.robots.arm_batch.action_spaces import AHEAD, ActionSpace
from softgym_mj.robots.arm_batch.chain import Pose
from softgym_mj.robots.arm_batch.controlled_arms import ControlledArms
from softgym_mj.robots.arm_batch.inverse_kinematics import Kinematics, Reference
from softgym_mj.robots.arm_batch.state import ArmState
from softgym_mj.robots.base import SIM_STEP


class Load(NamedTuple):
    """Numbers of an arm with n bodies and m joints that depend on the cup in its hand.

    Attributes:
        mass, center, inertia: as in `Dynamics`, with the cup as a part of the hand (n,), (n, 3),
            (n, 3, 3).
        weakest, strongest: as in `Servos` (m,).
        inverse: as in `constraints.Rows` (m + 1,).
        cup_center: center of mass of the cup in its frame (3,) [m].
    """

    mass: jax.Array
    center: jax.Array
    inertia: jax.Array
    weakest: jax.Array
    strongest: jax.Array
    inverse: jax.Array
    cup_center: jax.Array


class HeldCup(NamedTuple):
    """The cup after a sim step.

    Attributes:
        pose: position [m], quaternion (w, x, y, z) and theta [rad] (num_envs, 8).
        mobility: as in `FluidBatchSolver.step` (num_envs, 2).
        commanded: commanded x, z [m] and theta [rad] (num_envs, 3).
    """

    pose: jax.Array
    mobility: jax.Array
    commanded: jax.Array


class Ended(NamedTuple):
    """Arms at the end of an env step.

    Attributes:
        sensed: as `JointServos.sensed` (num_envs, 8 + 2 m).
        remembered: as `CupArm.remembered` (num_envs, 3).
        poses: positions [m] and quaternions of the moving bodies (num_envs, bodies, 7).
    """

    sensed: jax.Array
    remembered: jax.Array
    poses: jax.Array


def read_load(actor: CupArm, model: mujoco.MjModel) -> dict[str, np.ndarray]:
    """Returns a row of `Load` by name, from a compiled scene."""
    alone, _ = models.dynamic_model(actor.arm, SIM_STEP)
    root = actor.mjcf_model.model
    own = {model.body(f"{root}/{alone.body(i).name}").id: i for i in range(1, alone.nbody)}
    mass, first = np.zeros(alone.nbody), np.zeros((alone.nbody, 3))
    second = np.zeros((alone.nbody, 3, 3))  # Moments of mass about the bodies' origins.
    for body in range(1, model.nbody):
        frame = _within(own, model, body)
        if frame is None:
            continue
        i, position, rotation = frame
        mass[i] += model.body_mass[body]
        first[i] += model.body_mass[body] * position
        second[i] += _about_origin(model.body_mass[body], position)
        second[i] += rotation * model.body_inertia[body] @ rotation.T
    center = first / np.where(mass > 0.0, mass, 1.0)[:, None]
    about = np.stack([_about_origin(m, c) for m, c in zip(mass, center, strict=True)])
    joints = [model.joint(f"{root}/{alone.joint(i).name}").id for i in range(alone.njnt)]
    motors = [np.flatnonzero(model.actuator_trnid[:, 0] == joint)[0] for joint in joints]
    weakest, strongest = model.actuator_forcerange[motors].T
    inverse = model.dof_invweight0[model.jnt_dofadr[joints]]
    cup = model.body(actor.cup.body.full_identifier).id
    return {
        "mass": mass,
        "center": center,
        "inertia": second - about,
        "weakest": weakest.copy(),
        "strongest": strongest.copy(),
        "inverse": constraints.with_coupling(alone, inverse),
        "cup_center": model.body_ipos[cup].copy(),
    }


def _within(
    own: dict[int, int], model: mujoco.MjModel, body: int
) -> tuple[int, np.ndarray, np.ndarray] | None:
    """Returns the body of `own` that a body is fixed to, and where its principal axes are in it."""
    position = model.body_ipos[body]
    rotation = turns.matrices(model.body_iquat[body][None])[0]
    while body not in own:
        if body == 0:
            return None
        turn = turns.matrices(model.body_quat[body][None])[0]
        position, rotation = model.body_pos[body] + turn @ position, turn @ rotation
        body = model.body_parentid[body]
    return own[body], position, rotation


def _about_origin(mass: float, point: np.ndarray) -> np.ndarray:
    """Returns the inertia (3, 3) about the origin of a mass [kg] at a point (3,) [m]."""
    return mass * ((point**2).sum() * np.eye(3) - np.outer(point, point))


def turned(theta: jax.Array) -> jax.Array:
    """Returns a rotation matrix (3, 3) about +Y by an angle [rad]."""
    cosine, sine, zero = jnp.cos(theta), jnp.sin(theta), jnp.zeros_like(theta)
    rows = [cosine, zero, sine], [zero, zero + 1.0, zero], [-sine, zero, cosine]
    return jnp.array(rows)


class CupActionSpace(ActionSpace):
    """`CupArm`'s command: poses (1, 3) of the cup in the hand."""

    def __init__(self, arms: Kinematics):
        """Prepares the action space for the kinematics of an arm."""
        self._arms = arms

    def advance(self, state: ArmState, entries: jax.Array) -> ArmState:
        reference = TURNS_AS * self._reference(state.reference)
        filtered = commands.advance(state.filter, TURNS_AS * entries, reference, clipped)
        return state._replace(filter=filtered)

    def solve(self, state: ArmState) -> Reference:
        x, z, theta = (state.filter.points + AHEAD * state.filter.step)[0] / TURNS_AS
        turn = turned(theta)
        tool = jnp.stack([x, jnp.zeros_like(x), z]) + chains.apply(turn, np.array(GRIP))
        own = chains.product(self._arms.yaw[0].T, chains.product(turn, UPRIGHT))
        return inverse_kinematics.follow_points(self._arms, state.reference, tool[None], own[None])

    def commanded(self, state: ArmState) -> jax.Array:
        return state.filter.commanded / TURNS_AS

    def remembered(self, state: ArmState) -> jax.Array:
        return self.commanded(state).ravel()

    def _reference(self, angles: jax.Array) -> jax.Array:
        """Returns `CupArm.reference_pose` (1, 3) for joint angles (1, m) [rad]."""
        (point,) = inverse_kinematics.tools(self._arms, angles)
        (rotation,) = inverse_kinematics.tool_rotations(self._arms, angles)
        turn = chains.product(rotation, UPRIGHT.T)
        theta = jnp.arctan2(turn[0, 2], turn[0, 0])
        x, _, z = point - chains.apply(turned(theta), np.array(GRIP))
        return jnp.stack([x, z, theta])[None]


class CupArms(ControlledArms):
    """Arms whose sim steps are single physics steps, interleaved with those of the water.

    Call order in an env step: `solve` and `step`, then `step`, alternately; at the end `finish`.
    """

    def __init__(self, arm: Arm, mount: Mount):
        """Prepares an arm of a kind on a mount."""
        with jax.enable_x64(True):
            home = np.array(arm.home_cup)
            kinematics = inverse_kinematics.kinematics_of(
                arm, (mount,), home=home, orientation_cost=ORIENTATION_COST, oriented=ORIENTED
            )
            super().__init__(arm, kinematics, CupActionSpace(kinematics))
        self.solve = jax.jit(jax.vmap(self._solved))
        self.step = jax.jit(jax.vmap(self._stepped, (0, 0, 0, 0, None)))
        self.finish = jax.jit(jax.vmap(self._finished))

    # ------------------------------------------------------------------ one environment

    def _solved(self, state: ArmState, wanted: jax.Array) -> ArmState:
        return self._solve(state, wanted[None])

    def _stepped(
        self, state: ArmState, load: Load, wanted: jax.Array, forces: jax.Array, phase: jax.Array
    ) -> tuple[ArmState, HeldCup]:
        """Makes a sim step.

        Args:
            state: the arm.
            load: what it carries.
            wanted: desired pose of the cup (3,), used unless the step begins with a solution.
            forces: forces and torques of the water on the cup's walls about its center of mass
                (walls, 6) [N], [N m].
            phase: sim steps since the last solution.
        """
        state, arms = self._advance_command(state, wanted[None], phase > 0), self.kinematics
        arm, own = self._loaded(load), self._poses(state.positions)
        pose, angles, speeds = jax.tree.map(
            lambda each: each[0], (own, state.positions, state.speeds)
        )
        position, rotation = self._cup(state, own)
        center = inverse_kinematics.to_mounts(
            arms, (position + chains.apply(rotation, load.cup_center))[None]
        )
        parts = chains.jacobians(arm.chain, pose, center, np.array([arms.tool_body]))
        jacobian = jnp.concatenate([chains.product(arms.yaw[0], part[0]) for part in parts])
        mass, _ = dynamics.mass_and_bias(arm, pose, speeds)
        factor = jax.scipy.linalg.cho_factor(mass, lower=True)
        ease = (jacobian * jax.scipy.linalg.cho_solve(factor, jacobian.T).T).sum(-1)
        push = (jacobian * forces.sum(0)[:, None]).sum(0)
        command = self._commands(state, phase + 1.0)[0]
        angles, speeds, _ = dynamics.step(arm, pose, angles, speeds, command, push)
        state = state._replace(positions=angles[None], speeds=speeds[None])
        position, rotation = self._cup(state, self._poses(state.positions))
        turn = hands.quaternions(rotation)
        theta = 2.0 * jnp.arctan2(turn[2], turn[0])
        theta = (theta + np.pi) % (2.0 * np.pi) - np.pi
        return state, HeldCup(
            jnp.concatenate([position, turn, theta[None]]),
            ease.reshape(2, 3).max(1),
            self._action.remembered(state),
        )

    def _loaded(self, load: Load) -> dynamics.Dynamics:
        arm = self._dynamics
        return arm._replace(
            mass=load.mass,
            center=load.center,
            inertia=load.inertia,
            servos=arm.servos._replace(weakest=load.weakest, strongest=load.strongest),
            rows=arm.rows._replace(inverse=load.inverse),
        )

    def _cup(self, state: ArmState, pose: Pose) -> tuple[jax.Array, jax.Array]:
        """Returns position (3,) [m] and rotation (3, 3) of the cup."""
        (point,), (tool,), _ = inverse_kinematics.hands(
            self.kinematics, self._dynamics.chain, pose, state.speeds
        )
        rotation = chains.product(tool, UPRIGHT.T)
        return point - chains.apply(rotation, np.array(GRIP)), rotation

    def _finished(self, state: ArmState) -> Ended:
        pose = self._poses(state.positions)
        remembered = self._action.remembered(state)
        return Ended(self._sensed(state, pose), remembered, self._placed(pose))
