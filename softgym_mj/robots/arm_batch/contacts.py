"""`contacts`: hands that touch fixed solids, such as a bar or a box: friction pyramids.

Parameters of pairs are MuJoCo's (https://mujoco.readthedocs.io, "Computation"), and so are contact
points with boxes. A box touches the cap of a fixed cylinder at up to four points. Other pairs of
solids touch at one point, the nearest one; edges of fixed cylinders are round.
"""

import functools
from collections.abc import Callable, Mapping, Sequence
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import mujoco
import numpy as np

from softgym_mj.robots.arm_batch import boxes, clearance, cylinders
from softgym_mj.robots.arm_batch import chain as chains
from softgym_mj.robots.arm_batch.chain import Chain, Pose
from softgym_mj.robots.arm_batch.clearance import Shapes
from softgym_mj.robots.arm_batch.constraints import Contacts

KINDS = mujoco.mjtGeom
# Types of fixed solids that hands touch, by kind; a sphere is a capsule without length.
TYPES = {
    "capsule": (int(KINDS.mjGEOM_SPHERE), int(KINDS.mjGEOM_CAPSULE)),
    "cylinder": (int(KINDS.mjGEOM_CYLINDER),),
    "box": (int(KINDS.mjGEOM_BOX),),
}
KNOWN = tuple(kind for kinds in TYPES.values() for kind in kinds)
# Radius of the edges of fixed cylinders by their smallest half size. Normals of hands that overlap
# by more are approximate.
ROUNDED = 0.5


class Fixed(NamedTuple):
    """Fixed solids of one kind in an environment, s in number, and contact with a hand's k solids.

    Attributes:
        position, rotation: poses of the solids in the world (s, 3) [m], (s, 3, 3).
        core, radius, is_round: as in `Shapes` (s, 3), (s,), (s,).
        friction: friction coefficients (k, s).
        order: 1 where the solid is the first of MuJoCo's pair, -1 where it is the second (k, s).
        inverse, time, ratio, impedance: as in `Contacts` (k, s), (k, s), (k, s), (k, s, 5).
    """

    position: jax.Array
    rotation: jax.Array
    core: jax.Array
    radius: jax.Array
    is_round: jax.Array
    friction: jax.Array
    order: jax.Array
    inverse: jax.Array
    time: jax.Array
    ratio: jax.Array
    impedance: jax.Array


def _rounded(shapes: Shapes) -> Shapes:
    by = ROUNDED * shapes.core.min(1)
    return shapes._replace(core=shapes.core - by[:, None], radius=shapes.radius + by)


def read_fixed(
    model: mujoco.MjModel, data: mujoco.MjData, hand: Sequence[int], solids: Sequence[int]
) -> dict[str, dict[str, np.ndarray]]:
    """Returns rows of `Fixed` by name from a scene, for each kind of `TYPES` that it has.

    Args:
        model, data: the scene, with current poses.
        hand: geoms of a hand (k,).
        solids: geoms of the fixed solids, of the types `KNOWN`.
    """
    own = {kind: [i for i in solids if model.geom_type[i] in TYPES[kind]] for kind in TYPES}
    return {kind: _read(model, data, hand, ids) for kind, ids in own.items() if ids}


def _read(
    model: mujoco.MjModel, data: mujoco.MjData, hand: Sequence[int], solids: list[int]
) -> dict[str, np.ndarray]:
    shapes = clearance.shapes_of(model, solids)
    shapes = _rounded(shapes) if shapes.is_round.any() else shapes
    pairs = [[_pair(model, own, other) for other in solids] for own in hand]
    names = "friction", "order", "inverse", "time", "ratio", "impedance"
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
    model: mujoco.MjModel, own: int, other: int
) -> tuple[float, float, float, float, float, np.ndarray]:
    """Returns friction, order, inverse, time, ratio and impedance of a hand's geom and another."""
    ends = [own, other]
    order = 1.0 if (model.geom_type[other], other) < (model.geom_type[own], own) else -1.0
    priority, mix = model.geom_priority[ends], model.geom_solmix[ends]
    weights = mix / mix.sum() if priority[0] == priority[1] else (priority == priority.max()) * 1.0
    friction = float(model.geom_friction[ends, 0][weights > 0.0].max())
    mobility = model.body_invweight0[model.geom_bodyid[ends], 0].sum()
    # MuJoCo's regularization of an edge of a pyramid.
    inverse = 2.0 * friction**2 * (1.0 + friction**2) * mobility
    time, ratio = weights @ model.geom_solref[ends]
    return friction, order, inverse, time, ratio, weights @ model.geom_solimp[ends]


def contacts(
    chain: Chain,
    hand: Shapes,
    fixed: Mapping[str, Fixed],
    pose: Pose,
    mount: tuple[jax.Array, jax.Array],
    touches: jax.Array,
) -> Contacts:
    """Returns the contacts of one arm.

    Args:
        chain: the arm.
        hand: solids of its hand (k,), boxes and capsules.
        fixed: fixed solids by kind, as in `read_fixed`.
        pose: pose of the arm.
        mount: position (3,) [m] and rotation (3, 3) of its mount.
        touches: which solids of the hand touch anything (k,) bool.
    """
    base, yaw = mount
    own, met = clearance.placed(hand, pose), []
    is_box = hand.radius == 0.0
    for kind, solids in fixed.items():
        position = chains.apply(yaw.T, solids.position - base)
        place = position, chains.product(yaw.T, solids.rotation)
        for those, meet in ((is_box, _OF_BOXES[kind]), (~is_box, _OF_CAPSULES[kind])):
            part, at = Shapes(*(each[those] for each in hand)), [each[those] for each in own]
            found = meet(part, at, solids, place)
            met.append(_flat(np.flatnonzero(those), hand, solids, touches, found))
    bodies, *others = zip(*met, strict=True)
    return _pyramids(chain, pose, yaw, np.concatenate(bodies), *map(jnp.concatenate, others))


def _box_capsule(first: boxes.Solid, second: boxes.Solid) -> boxes.Manifold:
    found = boxes.capsule_box(second, first)
    return found._replace(normal=-found.normal)


def _sizes(solids: Shapes | Fixed) -> jax.Array:
    """Returns the sizes (k, 3) [m] of boxes, capsules and spheres, as in `boxes.Solid`.

    Those of cylinders are (radius, radius, half length), without the rounded edges.
    """
    radius, core = jnp.asarray(solids.radius)[:, None], solids.core
    capsules = jnp.concatenate([radius, core[:, 2:], radius], axis=1)
    return jnp.where((radius == 0.0) | solids.is_round[:, None], core + radius, capsules)


def _pairs(
    meet: Callable[[boxes.Solid, boxes.Solid], boxes.Manifold],
    hand: Shapes,
    own: Sequence[jax.Array],
    solids: Fixed,
    place: tuple[jax.Array, jax.Array],
) -> boxes.Manifold:
    """Returns the contacts (k, s, n) that a function of two solids finds between all of them."""
    each = jax.vmap(jax.vmap(meet, (None, 0)), (0, None))
    return each((*own, _sizes(hand)), (*place, _sizes(solids)))


def _nearest(
    hand: Shapes, own: Sequence[jax.Array], solids: Fixed, place: tuple[jax.Array, jax.Array]
) -> boxes.Manifold:
    """Returns contacts (k, s, 1) at the nearest points of solids of a hand and fixed ones."""
    shapes = Shapes(
        np.zeros(len(solids.radius), int), solids.position, solids.rotation,
        solids.core, solids.radius, solids.is_round,
    )  # fmt: skip
    ends = clearance.nearest(hand, (own[0], own[1]), shapes, place)
    # Overlapping cores have no nearest points; their normal leads from center to center.
    middles = place[0] - own[0][:, None]
    middles /= jnp.maximum(jnp.sqrt((middles**2).sum(-1, keepdims=True)), 1e-9)
    normal = jnp.where((ends.normal != 0.0).any(-1, keepdims=True), ends.normal, middles)
    points = 0.5 * (ends.first + ends.second)
    return boxes.Manifold(*(each[:, :, None] for each in (points, normal, ends.distance)))


def _boxes_cylinders(
    hand: Shapes, own: Sequence[jax.Array], solids: Fixed, place: tuple[jax.Array, jax.Array]
) -> boxes.Manifold:
    """Returns contacts (k, s, 4) with caps or, of pairs without these, at the nearest points."""
    caps = _pairs(cylinders.box_cap, hand, own, solids, place)
    sides = _nearest(hand, own, solids, place)
    alone = ~jnp.isfinite(caps.distance).any(-1, keepdims=True)
    alone &= np.arange(caps.distance.shape[-1]) == 0
    return boxes.Manifold(
        jnp.where(alone[..., None], sides.points, caps.points),
        jnp.where(alone[..., None], sides.normal, caps.normal),
        jnp.where(alone, sides.distance, caps.distance),
    )


# Functions for the contacts of boxes and of capsules of a hand with a kind of fixed solids.
_OF_BOXES: dict[str, Callable[..., boxes.Manifold]] = {
    "capsule": functools.partial(_pairs, _box_capsule),
    "cylinder": _boxes_cylinders,
    "box": functools.partial(_pairs, boxes.box_box),
}
_OF_CAPSULES: dict[str, Callable[..., boxes.Manifold]] = {
    "capsule": _nearest,
    "cylinder": _nearest,
    "box": functools.partial(_pairs, boxes.capsule_box),
}


def _flat(
    which: np.ndarray, hand: Shapes, solids: Fixed, touches: jax.Array, met: boxes.Manifold
) -> tuple[Any, ...]:
    """Returns arguments of `_pyramids` for r contacts.

    Args:
        which: indices of k solids of the hand.
        hand: solids of the hand.
        solids: fixed solids.
        touches: as in `contacts`.
        met: contacts of these solids (k, s, n).
    """
    pairs, number = met.distance.shape[:2], met.distance.shape[2]
    gap = jnp.where(touches[which, None, None], met.distance, jnp.inf).ravel()
    own = solids.friction, solids.order, solids.inverse, solids.time, solids.ratio, solids.impedance
    soft = (
        jnp.repeat(a[which].reshape(pairs[0] * pairs[1], *a.shape[2:]), number, axis=0) for a in own
    )
    bodies = np.repeat(hand.body[which], pairs[1] * number)
    return bodies, met.points.reshape(-1, 3), -met.normal.reshape(-1, 3), gap, *soft


def _pyramids(
    chain: Chain,
    pose: Pose,
    yaw: jax.Array,
    bodies: np.ndarray,
    points: jax.Array,
    normal: jax.Array,
    gap: jax.Array,
    friction: jax.Array,
    order: jax.Array,
    *soft: jax.Array,
) -> Contacts:
    """Returns the edges of the friction pyramids of r contacts.

    Args:
        chain: the arm.
        pose: its pose.
        yaw: rotation (3, 3) of its mount.
        bodies: bodies of the hand's solids (r,).
        points: contact points (r, 3) [m].
        normal: directions in which fixed solids push (r, 3).
        gap: distances (r,) [m].
        friction, order: as in `Fixed` (r,).
        *soft: the further parameters of `Contacts`.
    """
    # The axes of friction are MuJoCo's (`mju_makeFrame`): one is next to the world's Y or Z.
    _, y, z = yaw
    first = jnp.where(jnp.abs((normal * y).sum(-1, keepdims=True)) < 0.5, y, z)
    first -= (first * normal).sum(-1, keepdims=True) * normal
    first *= (order / jnp.sqrt((first**2).sum(-1)))[:, None]
    second = jnp.cross(normal, first)
    linear, _ = chains.jacobians(chain, pose, points, bodies)
    edges = [
        normal + sign * friction[:, None] * side for side in (first, second) for sign in (1.0, -1.0)
    ]
    jacobian = jnp.concatenate([(edge[..., None] * linear).sum(1) for edge in edges])
    return Contacts(jacobian, *(jnp.concatenate([a] * len(edges)) for a in (gap, *soft)))
