"""`contacts`: hands that touch fixed round solids, such as a bar: a friction pyramid for each pair.

Parameters of pairs are MuJoCo's (https://mujoco.readthedocs.io, "Computation"). A pair has one
contact, at the nearest points; edges of fixed cylinders are round.
"""

from collections.abc import Sequence
from typing import NamedTuple

import jax
import jax.numpy as jnp
import mujoco
import numpy as np

from softgym_mj.robots.arm_batch import chain as chains
from softgym_mj.robots.arm_batch import clearance
from softgym_mj.robots.arm_batch.chain import Chain, Pose
from softgym_mj.robots.arm_batch.clearance import Shapes
from softgym_mj.robots.arm_batch.constraints import Contacts

KINDS = mujoco.mjtGeom
# Fixed solids on which a hand rests at one point.
ROUND = tuple(map(int, (KINDS.mjGEOM_SPHERE, KINDS.mjGEOM_CAPSULE, KINDS.mjGEOM_CYLINDER)))
# Radius of the edges of fixed cylinders by their smallest half size. Normals of hands that overlap
# by more are approximate.
ROUNDED = 0.5


class Fixed(NamedTuple):
    """Fixed solids of an environment, s in number, and their contact with k solids of a hand.

    Attributes:
        position, rotation: poses of the solids in the world (s, 3) [m], (s, 3, 3).
        core, radius, is_round: as in `Shapes` (s, 3), (s,), (s,).
        friction: friction coefficients (k, s).
        inverse, time, ratio, impedance: as in `Contacts` (k, s), (k, s), (k, s), (k, s, 5).
    """

    position: jax.Array
    rotation: jax.Array
    core: jax.Array
    radius: jax.Array
    is_round: jax.Array
    friction: jax.Array
    inverse: jax.Array
    time: jax.Array
    ratio: jax.Array
    impedance: jax.Array


def _rounded(shapes: Shapes) -> Shapes:
    by = np.where(shapes.core[:, :2].max(1) > 0.0, ROUNDED * shapes.core.min(1), 0.0)
    return shapes._replace(core=shapes.core - by[:, None], radius=shapes.radius + by)


def read_fixed(
    model: mujoco.MjModel, data: mujoco.MjData, hand: Sequence[int], solids: Sequence[int]
) -> dict[str, np.ndarray]:
    """Returns a row of `Fixed` by name, from a scene.

    Args:
        model, data: the scene, with current poses.
        hand: geoms of a hand (k,).
        solids: geoms of the fixed solids (s,).
    """
    shapes = _rounded(clearance.shapes_of(model, list(solids)))
    pairs = [[_pair(model, own, other) for other in solids] for own in hand]
    names = "friction", "inverse", "time", "ratio", "impedance"
    found = {name: np.array([[pair[i] for pair in row] for row in pairs])
             for i, name in enumerate(names)}  # fmt: skip
    return {
        "position": data.geom_xpos[solids],
        "rotation": data.geom_xmat[solids].reshape(-1, 3, 3),
        "core": shapes.core,
        "radius": shapes.radius,
        "is_round": shapes.is_round,
        **found,
    }


def _pair(
    model: mujoco.MjModel, first: int, second: int
) -> tuple[float, float, float, float, np.ndarray]:
    """Returns friction, `Contacts.inverse`, time, ratio and impedance of a pair of geoms."""
    ends = [first, second]
    priority, mix = model.geom_priority[ends], model.geom_solmix[ends]
    weights = mix / mix.sum() if priority[0] == priority[1] else (priority == priority.max()) * 1.0
    friction = float(model.geom_friction[ends, 0][weights > 0.0].max())
    mobility = model.body_invweight0[model.geom_bodyid[ends], 0].sum()
    # MuJoCo's regularization of an edge of a pyramid.
    inverse = 2.0 * friction**2 * (1.0 + friction**2) * mobility
    time, ratio = weights @ model.geom_solref[ends]
    return friction, inverse, time, ratio, weights @ model.geom_solimp[ends]


def contacts(
    chain: Chain,
    hand: Shapes,
    fixed: Fixed,
    pose: Pose,
    mount: tuple[jax.Array, jax.Array],
    touches: jax.Array,
) -> Contacts:
    """Returns the contacts of one arm.

    Args:
        chain: the arm.
        hand: solids of its hand (k,).
        fixed: fixed solids.
        pose: pose of the arm.
        mount: position (3,) [m] and rotation (3, 3) of its mount.
        touches: which solids of the hand touch anything (k,) bool.
    """
    base, yaw = mount
    shapes = Shapes(
        np.zeros(len(fixed.radius), int), fixed.position, fixed.rotation,
        fixed.core, fixed.radius, fixed.is_round,
    )  # fmt: skip
    place = chains.apply(yaw.T, fixed.position - base), chains.product(yaw.T, fixed.rotation)
    own = clearance.placed(hand, pose)
    ends = clearance.nearest(hand, own, shapes, place)
    gap = jnp.where(touches[:, None], ends.distance, jnp.inf).ravel()
    # From the solid to the hand; of overlapping cores, without nearest points, by the centers.
    middles = (own[0][:, None] - place[0]).reshape(-1, 3)
    middles /= jnp.maximum(jnp.sqrt((middles**2).sum(-1, keepdims=True)), 1e-9)
    normal = -ends.normal.reshape(-1, 3)
    normal = jnp.where((normal != 0.0).any(-1, keepdims=True), normal, middles)
    first = jnp.cross(normal, _least(normal))
    first /= jnp.sqrt((first**2).sum(-1, keepdims=True))
    second = jnp.cross(normal, first)
    points = (0.5 * (ends.first + ends.second)).reshape(-1, 3)
    bodies = np.repeat(hand.body, len(fixed.radius))
    linear, _ = chains.jacobians(chain, pose, points, bodies)
    friction = fixed.friction.reshape(-1, 1)
    edges = [normal + sign * friction * side for side in (first, second) for sign in (1.0, -1.0)]
    jacobian = jnp.concatenate([(edge[..., None] * linear).sum(1) for edge in edges])

    def each(array: jax.Array) -> jax.Array:
        return jnp.concatenate([array.reshape(-1, *array.shape[2:])] * len(edges))

    soft = (each(array) for array in (fixed.inverse, fixed.time, fixed.ratio, fixed.impedance))
    return Contacts(jacobian, jnp.concatenate([gap] * len(edges)), *soft)


def _least(vectors: jax.Array) -> jax.Array:
    """Returns the axis (..., 3) that is most perpendicular to each vector (..., 3)."""
    return jax.nn.one_hot(jnp.argmin(jnp.abs(vectors), axis=-1), 3, dtype=vectors.dtype)
