"""Reference motions of `CartesianController`, for one environment with one or two arms.

The quadratic program is the same: tasks of the tools and the posture, limits of joints and speeds,
and distances from the floor and the other arm. Each arm is in the frame of its mount.
"""

from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np

from softgym_mj.robots.arm import bodies, cartesian, turns
from softgym_mj.robots.arm.models import Arm
from softgym_mj.robots.arm.mounts import Mount
from softgym_mj.robots.arm_batch import chain as chains
from softgym_mj.robots.arm_batch import clearance, quadratic, twists
from softgym_mj.robots.arm_batch.chain import Chain
from softgym_mj.robots.arm_batch.models import at_origin


class Kinematics(NamedTuple):
    """Arms of a kind and their mounts.

    Attributes:
        chain: links and joints of an arm, with its fingers open.
        tool: position of the tool in its body [m] (3,).
        tool_rotation: rotation of the tool in its body (3, 3).
        tool_body: body of the tool.
        upright: rotation of the tool at home in the mount's frame (3, 3).
        oriented: usual orientations of the tools, as quaternions (arms, 4).
        home: joint angles at home (m,) [rad].
        costs: costs of the tools' positions [1/m] and orientations [1/rad] (6,).
        low, high: limits of joints (m,) [rad].
        speed: limits of their speeds (m,) [rad/s].
        shapes: shapes that keep away from the floor and other arms.
        base: positions of the mounts (arms, 3) [m].
        yaw: rotations of the mounts (arms, 3, 3).
    """

    chain: Chain
    tool: np.ndarray
    tool_rotation: np.ndarray
    tool_body: int
    upright: np.ndarray
    oriented: np.ndarray
    home: np.ndarray
    costs: np.ndarray
    low: np.ndarray
    high: np.ndarray
    speed: np.ndarray
    shapes: clearance.Shapes
    base: np.ndarray
    yaw: np.ndarray


class Reference(NamedTuple):
    """Result of a solution.

    Attributes:
        angles: joint angles (arms, m) [rad].
        speeds: joint velocities of the motion to these angles (arms, m) [rad/s].
        failed: whether there was no solution; the arms then stand still.
    """

    angles: jax.Array
    speeds: jax.Array
    failed: jax.Array


def kinematics_of(
    arm: Arm,
    mounts: tuple[Mount, ...],
    tips: float = 0.0,
    home: np.ndarray | None = None,
    orientation_cost: float = cartesian.ORIENTATION_COST,
    oriented: np.ndarray | None = None,
) -> Kinematics:
    """Returns the kinematics of arms.

    Args:
        arm: kind of arm.
        mounts: bases of the arms.
        tips, orientation_cost, oriented: as in `JointServos`.
        home: joint angles at home (m,) [rad]; None for `bodies.home`.
    """
    home = bodies.home(arm) if home is None else home
    model = bodies.kinematic_model(arm, (at_origin(arm),), tips)
    (name,) = bodies.names(arm, 1)
    site, (geoms,) = model.site(f"{name}/{arm.tcp_site}"), bodies.outer_geoms(model, [name])
    chain = chains.chain_of(model)
    low, high = model.jnt_range.T
    turn = turns.matrices(site.quat[None])[0]
    pose = chains.poses(chain, jnp.asarray(home))
    cos, sin = np.array([[np.cos(m.yaw), np.sin(m.yaw)] for m in mounts]).T
    zero = np.zeros_like(cos)
    yaw = np.stack([cos, -sin, zero, sin, cos, zero, zero, zero, zero + 1.0], axis=1)
    body = int(site.bodyid[0])
    upright = np.asarray(pose.rotation[body]) @ turn
    if oriented is None:
        oriented = turns.at_mounts(upright, [mount.yaw for mount in mounts])
    return Kinematics(
        chain=chain,
        tool=site.pos.copy(),
        tool_rotation=turn,
        tool_body=body,
        upright=upright,
        oriented=oriented,
        home=home,
        costs=np.repeat([cartesian.POSITION_COST, orientation_cost], 3),
        low=low.copy(),
        high=high.copy(),
        speed=np.array(arm.velocity_limits),
        shapes=clearance.shapes_of(model, geoms),
        base=np.array([mount.base for mount in mounts]),
        yaw=yaw.reshape(-1, 3, 3),
    )


def to_world(arms: Kinematics, points: jax.Array) -> jax.Array:
    """Returns points (arms, 3) [m] of the mounts' frames in the world."""
    return arms.base + chains.apply(arms.yaw, points)


def to_mounts(arms: Kinematics, points: jax.Array) -> jax.Array:
    """Returns points (arms, 3) [m] of the world in the mounts' frames."""
    return chains.apply(arms.yaw.transpose(0, 2, 1), points - arms.base)


def tools(arms: Kinematics, angles: jax.Array) -> jax.Array:
    """Returns positions [m] (arms, 3) of tools in the world for joint angles (arms, m) [rad]."""
    points, _ = jax.vmap(lambda own: _tool(arms, chains.poses(arms.chain, own)))(angles)
    return to_world(arms, points)


def hands(
    arms: Kinematics, chain: Chain, pose: chains.Pose, speeds: jax.Array
) -> tuple[jax.Array, jax.Array, jax.Array]:
    """Returns positions, rotations and velocities (arms, 3) [m/s] of tools in the world.

    Args:
        arms: the arms.
        chain: links and joints with the same bodies as those of `arms`.
        pose: poses of this chain, of all arms.
        speeds: speeds of its joints (arms, m) [rad/s or m/s].
    """

    def one(own, rates):
        point, rotation = _tool(arms, own)
        linear, _ = chains.jacobians(chain, own, point[None], np.array([arms.tool_body]))
        return point, rotation, chains.apply(linear[0], rates)

    points, rotations, velocities = jax.vmap(one)(pose, speeds)
    turned = chains.product(arms.yaw, rotations)
    return to_world(arms, points), turned, chains.apply(arms.yaw, velocities)


def _tool(arms: Kinematics, pose: chains.Pose) -> tuple[jax.Array, jax.Array]:
    frame = pose.rotation[arms.tool_body]
    point = pose.position[arms.tool_body] + chains.apply(frame, arms.tool)
    return point, chains.product(frame, arms.tool_rotation)


def tool_rotations(arms: Kinematics, angles: jax.Array) -> jax.Array:
    """Returns rotation matrices (arms, 3, 3) of tools in the world for angles (arms, m) [rad]."""
    _, turned = jax.vmap(lambda own: _tool(arms, chains.poses(arms.chain, own)))(angles)
    return chains.product(arms.yaw, turned)


def follow_points(
    arms: Kinematics,
    angles: jax.Array,
    goals: jax.Array,
    rotations: jax.Array | None = None,
    duration: float = cartesian.PERIOD,
) -> Reference:
    """Moves the reference for `duration` [s] so that its tools reach their goals.

    Args:
        arms: the arms.
        angles: joint angles (arms, m) [rad].
        goals: tool points in the world (arms, 3) [m].
        rotations: rotations of the tools in the mounts' frames (arms, 3, 3); None for those at
            home.
        duration: duration of the motion [s].
    """
    number, joints = angles.shape
    pose = jax.vmap(lambda own: chains.poses(arms.chain, own))(angles)
    turned = arms.upright * jnp.ones((number, 1, 1)) if rotations is None else rotations
    matrices, vectors, damping = jax.vmap(lambda *own: _task(arms, *own))(
        pose, to_mounts(arms, goals), turned
    )
    matrix = jax.scipy.linalg.block_diag(*matrices)
    stiff = cartesian.POSTURE_COST**2
    matrix += (damping.sum() + stiff + cartesian.DAMPING) * jnp.eye(number * joints)
    vector = vectors + stiff * cartesian.POSTURE_GAIN * (angles - arms.home)
    return _moved(arms, angles, pose, (matrix, vector.ravel()), duration)


def follow_joints(arms: Kinematics, angles: jax.Array, goals: jax.Array) -> Reference:
    """Moves the reference for a period so that its joints reach their goals.

    Args:
        arms: the arms.
        angles, goals: joint angles and their goals (arms, m) [rad].
    """
    pose = jax.vmap(lambda own: chains.poses(arms.chain, own))(angles)
    matrix = (1.0 + cartesian.DAMPING) * jnp.eye(angles.size)
    return _moved(arms, angles, pose, (matrix, (angles - goals).ravel()), cartesian.PERIOD)


def _moved(
    arms: Kinematics,
    angles: jax.Array,
    pose: chains.Pose,
    costs: tuple[jax.Array, jax.Array],
    duration: float,
) -> Reference:
    """Returns the displacement of least cost (a matrix and a vector) within the limits."""
    number, joints = angles.shape
    up = jnp.minimum(cartesian.LIMIT_GAIN * (arms.high - angles), duration * arms.speed)
    down = jnp.minimum(cartesian.LIMIT_GAIN * (angles - arms.low), duration * arms.speed)
    rows, bounds = _distances(arms, pose, duration)
    every = np.eye(number * joints)
    solution = quadratic.minimize(
        *costs,
        jnp.concatenate([every, -every, *rows]),
        jnp.concatenate([up.ravel(), down.ravel(), *bounds]),
    )
    moved = jnp.where(solution.found, solution.point, 0.0).reshape(number, joints)
    margin = cartesian.LIMIT_MARGIN
    after = jnp.clip(angles + moved, arms.low + margin, arms.high - margin)
    return Reference(after, moved / duration, ~solution.found)


def _task(
    arms: Kinematics, pose: chains.Pose, goal: jax.Array, goal_rotation: jax.Array
) -> tuple[jax.Array, jax.Array, jax.Array]:
    """Returns matrix (m, m), vector (m,) and damping of an arm's task.

    Args:
        arms: the arms.
        pose: pose of the arm.
        goal: goal of the tool point in the mount's frame (3,) [m].
        goal_rotation: goal of the tool's rotation in the mount's frame (3, 3).
    """
    point, rotation = _tool(arms, pose)
    linear, angular = chains.jacobians(arms.chain, pose, point[None], np.array([arms.tool_body]))
    back = rotation.T
    own = jnp.concatenate([chains.product(back, linear[0]), chains.product(back, angular[0])])
    error = twists.logarithm(chains.product(back, goal_rotation), chains.apply(back, goal - point))
    jacobian = -arms.costs[:, None] * chains.product(twists.inverse_jacobian(error), own)
    weighted = arms.costs * error
    matrix = (jacobian[:, :, None] * jacobian[:, None]).sum(0)
    vector = (jacobian * weighted[:, None]).sum(0)
    return matrix, vector, cartesian.TASK_DAMPING * (weighted**2).sum()


def _distances(
    arms: Kinematics, pose: chains.Pose, duration: float
) -> tuple[list[jax.Array], list[jax.Array]]:
    """Returns rows and bounds that keep shapes away from the floor and from the other arm."""
    shapes, number = arms.shapes, len(arms.base)
    positions, rotations = jax.vmap(lambda own: clearance.placed(shapes, own))(pose)
    share = cartesian.APPROACH * cartesian.PERIOD / duration
    low = jax.vmap(lambda *own: clearance.lowest(shapes, *own))(positions, rotations)
    approach = jax.vmap(
        lambda own, points: chains.jacobians(arms.chain, own, points, shapes.body)[0]
    )(pose, low)
    height = low[..., 2] + arms.base[:, 2:]
    rows = [jax.scipy.linalg.block_diag(*-approach[:, :, 2])]
    bounds = [_bounds(height, cartesian.FLOOR_CLEARANCE, share).ravel()]
    if number == 2:
        places = arms.base[:, None] + chains.apply(arms.yaw[:, None], positions)
        turned = chains.product(arms.yaw[:, None], rotations)
        ends = clearance.nearest(shapes, (places[0], turned[0]), shapes, (places[1], turned[1]))
        own = _rates(arms, pose, 0, ends.first, ends.normal)
        other = _rates(arms, pose, 1, *(end.swapaxes(0, 1) for end in (ends.second, -ends.normal)))
        both = jnp.concatenate([own, other.swapaxes(0, 1)], axis=-1)
        rows.append(both.reshape(-1, 2 * len(arms.home)))
        bounds.append(_bounds(ends.distance, cartesian.CLEARANCE, share).ravel())
    return rows, bounds


def _rates(
    arms: Kinematics, pose: chains.Pose, i: int, points: jax.Array, normals: jax.Array
) -> jax.Array:
    """Returns Jacobians (k, others, m) along normals of points (k, others, 3) of arm `i`."""
    back = arms.yaw[i].T
    local, along = chains.apply(back, points - arms.base[i]), chains.apply(back, normals)
    own = jax.tree.map(lambda array: array[i], pose)
    others = points.shape[1]
    linear, _ = chains.jacobians(
        arms.chain, own, local.reshape(-1, 3), np.repeat(arms.shapes.body, others)
    )
    found = (linear * along.reshape(-1, 3, 1)).sum(1)
    return found.reshape(-1, others, found.shape[-1])


def _bounds(distance: jax.Array, least: float, share: float) -> jax.Array:
    """Returns how far (...) [m] shapes may approach; infinite for distant ones."""
    allowed = share * jnp.maximum(distance - least, 0.0)
    return jnp.where(distance < least + cartesian.AWARE, allowed, jnp.inf)
