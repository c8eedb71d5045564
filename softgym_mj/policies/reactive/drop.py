"""Reactive expert of DropFoldCloth: swings the cloth on its way down and releases it.

Pickers carry the upper edge over the beginning of a curve in the X-Z plane and wait there until the
cloth hangs still. Then they follow the curve downwards, so that the height is the clock of the
swing, and release the cloth at its end. The curves come from CMA-ES (Hansen and Ostermeier, 2001)
on training variations with noise on actions.
"""

from collections.abc import Sequence
from typing import NamedTuple

from softgym_mj.metrics import Array, lengths, namespace
from softgym_mj.policies.reactive.hands import Hands, found_hands
from softgym_mj.policies.reactive.motions import STRIDE, Motion, actions, at

Table = tuple[Sequence[float], Sequence[float]]


class Swing(NamedTuple):
    """Curve of the pickers for a band of widths; numbers at its middle, then changes per `RANGE`.

    Attributes:
        middle: middle of the band [m].
        across: X at equal shares of the way down [m].
        ends: Z of the beginning and the end [m].
        down: speeds downwards at equal shares of the way down, as fractions of full speed.
    """

    middle: float
    across: Table
    ends: Table
    down: Table


NARROW, WIDE = (
    Swing(
        0.46,
        (
            (0.32, 0.202, 0.551, 0.501, 0.208, -0.359, 0.586),
            (0.0, -0.011, -0.13, 0.12, -0.132, 0.163, 0.246),
        ),
        ((0.78, 0.532), (0.0, 0.035)),
        ((0.932, 0.484, 0.39, 0.598), (-0.06, 0.077, -0.031, -0.034)),
    ),
    Swing(
        0.66,
        (
            (0.34, 0.457, 0.991, 1.046, 0.536, -0.125, 1.418),
            (0.0, 0.198, -0.049, 0.128, -0.168, 0.217, 0.185),
        ),
        ((0.98, 0.584), (0.1, -0.055)),
        ((0.898, 0.391, 0.687, 0.507), (0.194, -0.029, -0.087, 0.122)),
    ),
)
BORDER, RANGE = 0.56, 0.1  # [m] Width between the two bands, and half range of either.
SLOWEST, LOWEST = 0.1, 0.56  # Fraction of full speed downwards and Z [m] that limit the curve.
HOVER, OVER = 0.04, 0.06  # [m] Heights over the curve of waiting pickers, and of its first step.
STARTS = 0.12  # [m] X up to which pickers are at first: there they rise.
RISING = 0.1  # [m] Height below that of waiting pickers from which they move across, too.
NEAR, STILL = 0.03, 0.02  # [m] Distance of the pickers, and lag of the lower edge, of a beginning.
# Shares per env step of the distance along X, of the lower edge's lag and of the distance along Y.
APPROACH, FOLLOW, SPREAD = 0.5, 0.8, 0.5
CARRYING, LIFTING = 0.8, 0.6  # Fractions of full speed along X and Z before the swing.
RISE, RISEN = 0.3, 1.0  # Fraction of full speed and height [m] of pickers out of the way.
SIDE = 8  # Number of key points in a row, and of rows.


class Hanging(NamedTuple):
    """Cloth that hangs from pickers.

    Attributes:
        x, z: mean position of the pickers [m] (...).
        lag: distance along X by which the lower edge is ahead of them [m] (...).
        width: mean length of the outer rows, which hang down [m] (...).
        depth: distance of the lower corners [m] (...).
    """

    x: Array
    z: Array
    lag: Array
    width: Array
    depth: Array


def drop_fold_cloth(observation: Array) -> Array:
    """Returns actions (..., 8) of DropFoldCloth for "key_points", followed by "markov" (..., 224).

    Pickers that do not both hold the cloth open and move away.
    """
    xp, lead = namespace(observation), observation.shape[:-1]
    points = observation[..., : 3 * SIDE**2].reshape((*lead, SIDE, SIDE, 3))
    markov = observation[..., 3 * SIDE**2 + 6 :]
    corners = markov[..., :12].reshape((*lead, 4, 3))
    hands = found_hands(markov[..., 12:], corners)
    cloth = _hanging(points, corners, hands)
    plans = [_plan(cloth, swing) for swing in (WIDE, NARROW)]
    x, z, ends = (xp.where(cloth.width >= BORDER, *each) for each in zip(*plans, strict=True))
    leaves = ends | ~(hands.holds[..., 0] & hands.holds[..., 1])
    motions = []
    for i, side in enumerate((0.5, -0.5)):
        center = hands.centers[..., i, :]
        y = center[..., 1] + SPREAD * (side * cloth.depth - center[..., 1])
        # Along each axis on its own: what one lacks does not slow down the others.
        goal = center + xp.clip(xp.stack([x, y, z], axis=-1) - center, -STRIDE, STRIDE)
        away = at(center[..., :2], xp.full_like(y, RISEN))
        full = xp.ones_like(y)
        speed = xp.where(leaves, RISE * full, full)
        motions.append(Motion(xp.where(leaves[..., None], away, goal), ~leaves, speed))
    return actions(hands.centers, motions)


def _hanging(points: Array, corners: Array, hands: Hands) -> Hanging:
    """Returns the cloth of key points (..., 8, 8, 3) [m] and corners (..., 4, 3) [m]."""
    xp = namespace(points)
    x, z = _middle(hands.centers, 0), _middle(hands.centers, 2)
    sides = points[..., [0, -1], :, :]
    steps = lengths(sides[..., 1:, :] - sides[..., :-1, :])
    width = sum(steps[..., i, k] for i in range(2) for k in range(SIDE - 1)) / 2
    depth = lengths(corners[..., 2, :] - corners[..., 3, :])
    return Hanging(x, z, _middle(corners[..., 2:, :], 0) - x, xp.asarray(width), depth)


def _middle(pair: Array, axis: int) -> Array:
    """Returns a coordinate (...) of the middle between two points (..., 2, 3)."""
    return (pair[..., 0, axis] + pair[..., 1, axis]) / 2


def _plan(cloth: Hanging, swing: Swing) -> tuple[Array, Array, Array]:
    """Returns X and Z [m] of the next step (...), and whether the swing has ended (...)."""
    xp, share = namespace(cloth.x), (cloth.width - swing.middle) / RANGE
    begin, top = (_at(table, share, 0.0 * share) for table in (swing.across, swing.ends))
    end = xp.clip(_at(swing.ends, share, 1.0 + 0.0 * share), LOWEST, None)
    way = top - end
    phase = (top - cloth.z) / way
    ready = (xp.abs(cloth.lag) < STILL) & (xp.abs(cloth.x - begin) < NEAR)
    ready = ready & (cloth.z < top + OVER)
    before = (cloth.x < STARTS) | ((phase <= 0.0) & ~ready)
    phase = xp.clip(phase, 0.0, 1.0)
    down = STRIDE * xp.clip(_at(swing.down, share, phase), SLOWEST, 1.0)
    swung = _at(swing.across, share, phase + down / way), cloth.z - down
    carried = _carried(cloth, begin, top + HOVER)
    x, z = (xp.where(before, *each) for each in zip(carried, swung, strict=True))
    return x, z, ~before & (phase >= 1.0)


def _carried(cloth: Hanging, begin: Array, hover: Array) -> tuple[Array, Array]:
    """Returns X and Z [m] of the next step (...) to the X `begin` at the Z `hover` (...) [m]."""
    xp, most = namespace(begin), CARRYING * STRIDE
    # Pickers follow the lower edge, which damps it.
    move = xp.clip(APPROACH * (begin - cloth.x), -most, most) + FOLLOW * cloth.lag
    share = xp.clip(1.0 - (hover - cloth.z) / RISING, 0.0, 1.0)
    climb = xp.clip(hover - cloth.z, -LIFTING * STRIDE, LIFTING * STRIDE)
    return cloth.x + share * move, cloth.z + climb


def _at(table: Table, share: Array, phase: Array) -> Array:
    """Returns numbers (...) of a table, linear between its entries.

    Args:
        table: numbers at equal shares of a way, and their changes.
        share: multiple of the changes (...).
        phase: share of the way (...); the last number counts beyond it.
    """
    xp, last = namespace(phase), len(table[0]) - 1
    place, result = xp.clip(phase, 0.0, 1.0) * last, xp.zeros_like(phase)
    for k, (middle, change) in enumerate(zip(*table, strict=True)):
        hat = xp.clip(1.0 - xp.abs(place - k), 0.0, None)
        result = result + hat * (middle + change * share)
    return result
