"""`step`: physics step of one arm, as by MuJoCo's integrator "discrete", without contacts.

Over a step h, the servos' stiffness K and the damping D of servos and joints are implicit: with the
mass matrix M and forces f, the acceleration a solves (M + h D + h^2 K) a = f - h K v. The soft
constraints are the coupling of the fingers and the limits of joints (https://mujoco.readthedocs.io,
"Computation"); `constraints.py` has their parameters.
"""

from typing import NamedTuple

import jax
import jax.numpy as jnp
import mujoco
import numpy as np

from softgym_mj.robots.arm import turns
from softgym_mj.robots.arm_batch import chain as chains
from softgym_mj.robots.arm_batch import constraints
from softgym_mj.robots.arm_batch.chain import Chain, Pose

# Solutions in a step, each with the joint limits that push in the one before. With random motions
# the set of limits changed at most three times.
SOLUTIONS = 5


class Servos(NamedTuple):
    """Position servos, one for each of m joints.

    Attributes:
        stiffness, damping: gains (m,) [N m/rad, N m s/rad], or of slides [N/m, N s/m].
        low, high: limits of the commanded position (m,) [rad or m].
        weakest, strongest: limits of the force (m,) [N m or N].
    """

    stiffness: np.ndarray
    damping: np.ndarray
    low: np.ndarray
    high: np.ndarray
    weakest: np.ndarray
    strongest: np.ndarray


class Dynamics(NamedTuple):
    """Arm with n bodies and m joints.

    Attributes:
        chain: links and joints.
        timestep: physics step [s].
        mass: masses of bodies (n,) [kg].
        center: centers of mass in the bodies (n, 3) [m].
        inertia: inertias about them in the bodies' axes (n, 3, 3) [kg m^2].
        armature, damping: armature [kg m^2 or kg] and damping [N m s/rad or N s/m] of joints (m,).
        servos: servos in the order of the joints.
        rows: constraints.
    """

    chain: Chain
    timestep: float
    mass: np.ndarray
    center: np.ndarray
    inertia: np.ndarray
    armature: np.ndarray
    damping: np.ndarray
    servos: Servos
    rows: constraints.Rows


def dynamics_of(model: mujoco.MjModel) -> Dynamics:
    """Returns the dynamics of a model of one arm with a servo for each joint.

    Gravity is left out: it must be compensated.
    """
    moving = model.jnt_bodyid.min()
    assert model.nu == model.njnt and np.all(model.body_gravcomp[moving:] == 1.0)
    motors = np.argsort(model.actuator_trnid[:, 0])
    turned = turns.matrices(model.body_iquat)
    inertia = turned * model.body_inertia[:, None] @ turned.transpose(0, 2, 1)
    low, high = model.actuator_ctrlrange[motors].T
    weakest, strongest = model.actuator_forcerange[motors].T
    servos = Servos(
        model.actuator_gainprm[motors, 0], -model.actuator_biasprm[motors, 2],
        low, high, weakest, strongest,
    )  # fmt: skip
    return Dynamics(
        chain=chains.chain_of(model),
        timestep=model.opt.timestep,
        mass=model.body_mass.copy(),
        center=model.body_ipos.copy(),
        inertia=inertia,
        armature=model.dof_armature.copy(),
        damping=model.dof_damping.copy(),
        servos=servos,
        rows=constraints.rows_of(model),
    )


def mass_and_bias(arm: Dynamics, pose: Pose, speeds: jax.Array) -> tuple[jax.Array, jax.Array]:
    """Returns the mass matrix (m, m) and the forces of Coriolis and centrifugal effects (m,)."""
    chain = arm.chain
    centers = pose.position + chains.apply(pose.rotation, arm.center)
    bodies = np.arange(len(arm.mass))
    linear, angular = chains.jacobians(chain, pose, centers, bodies)
    at_anchor, _ = chains.jacobians(chain, pose, pose.anchor, chain.body)
    inertia = chains.product(
        chains.product(pose.rotation, arm.inertia), pose.rotation.swapaxes(1, 2)
    )
    momentum = chains.product(inertia, angular)
    heavy = arm.mass[:, None, None] * linear
    matrix = (heavy[..., :, None] * linear[..., None, :]).sum((0, 1))
    matrix += (angular[..., :, None] * momentum[..., None, :]).sum((0, 1)) + np.diag(arm.armature)

    spins = chains.apply(angular, speeds)
    turning = jnp.cross(spins[chain.body], pose.axis)  # Rate of the axes (m, 3).
    swept = jnp.cross(turning, centers[:, None] - pose.anchor)
    drift = chains.apply(linear, speeds)[:, None] - chains.apply(at_anchor, speeds)
    swept += jnp.cross(pose.axis, drift)
    slides = chain.slides[chain.body][:, None]
    share = chain.moves[..., None] * speeds[:, None]
    acceleration = (jnp.where(slides, turning, swept) * share).sum(1)
    rolling = (jnp.where(slides, 0.0, turning) * share).sum(1)
    torque = chains.apply(inertia, rolling)
    torque += jnp.cross(spins, chains.apply(inertia, spins))
    bias = (heavy * acceleration[..., None]).sum((0, 1))
    return matrix, bias + (angular * torque[..., None]).sum((0, 1))


def step(
    arm: Dynamics,
    pose: Pose,
    angles: jax.Array,
    speeds: jax.Array,
    commands: jax.Array,
    push: jax.Array | float = 0.0,
    contacts: constraints.Contacts | None = None,
) -> tuple[jax.Array, jax.Array, jax.Array]:
    """Returns joint positions and speeds after a physics step, and the inertia (m, m) in it.

    The inertia, also for impulses, has the implicit terms of servos and damping.

    Args:
        arm: the arm.
        pose: its pose at `angles`.
        angles, speeds: positions (m,) [rad or m] and speeds (m,) of the joints.
        commands: commanded positions (m,) [rad or m].
        push: further forces (m,) [N m or N].
        contacts: contacts with fixed solids.
    """
    h, servos = arm.timestep, arm.servos
    mass, bias = mass_and_bias(arm, pose, speeds)
    gap = jnp.clip(commands, servos.low, servos.high) - angles
    force = servos.stiffness * gap - servos.damping * speeds
    free = (servos.weakest < force) & (force < servos.strongest)
    force = jnp.clip(force, servos.weakest, servos.strongest)
    implicit = jnp.where(free, h * servos.damping + h**2 * servos.stiffness, 0.0)
    metric = mass + jnp.diag(implicit + h * arm.damping)
    force -= bias + arm.damping * speeds + jnp.where(free, h * servos.stiffness, 0.0) * speeds
    force += push
    diagonals = jnp.diag(mass), jnp.diag(metric)
    rows = constraints.evaluate(arm.rows, h, angles, speeds, *diagonals, contacts)

    def change(_, found):
        acting = constraints.pushes(rows, found)
        matrix = metric + constraints.stiffness(rows, acting)
        factor = jax.scipy.linalg.cho_factor(matrix, lower=True)
        return jax.scipy.linalg.cho_solve(factor, force + constraints.force(rows, acting))

    acceleration = jax.lax.fori_loop(0, SOLUTIONS, change, jnp.zeros_like(speeds))
    speeds = speeds + h * acceleration
    return angles + h * speeds, speeds, metric
