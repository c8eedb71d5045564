"""Grasps of the corners and sides of a cloth, for the reactive expert of SpreadCloth."""

from typing import NamedTuple

from array_api_compat import device

from softgym_mj.metrics import Array, constant, lengths, namespace, taken
from softgym_mj.policies.reactive.grasps import (
    CLEARANCE,
    COST,
    DIRECTIONS,
    FACING,
    HIDDEN,
    UPWARDS,
    WAY,
    Sheet,
    clearances,
    entries,
    facings,
)
from softgym_mj.policies.reactive.hands import Hands, point_at

EDGES = 0.65, 0.35  # [m] Farthest picker centers along X and Y.
CORNER = 0.12  # [m] Distance from a corner in the cloth up to which a vertex stands for it.
EXPOSED = -0.5  # Least value of a grasp of an exposed vertex.
# Vertices that may be grasped for a corner: steps from it along both sides.
AROUND = (0, 0), (0, 1), (1, 0), (0, 2), (2, 0), (0, 3), (3, 0), (1, 1)


class Grips(NamedTuple):
    """Grasps by two pickers, k each.

    Attributes:
        values: higher is better (..., 2, k).
        centers: of the pickers (..., 2, k, 3) [m].
        directions: from the vertices to them (..., 2, k, 3).
    """

    values: Array
    centers: Array
    directions: Array

    def best(self, picker: int, index: Array) -> tuple[Array, Array]:
        """Returns the center and the direction (..., 3) of a picker's grasp by its index (...)."""
        centers, directions = (each[..., picker, :, :] for each in self[1:])
        return point_at(centers, index), point_at(directions, index)


def corners_of(sheet: Sheet) -> Array:
    """Returns the corners (..., 4): 0 and 3, and 1 and 2, are opposite."""
    columns, last = sheet.columns, (sheet.rows - 1) * sheet.columns
    return namespace(last).stack([0 * last, columns - 1, last, last + columns - 1], axis=-1)


def of_a_side(first: Array, second: Array) -> Array:
    """Returns whether corners (...), 0 to 3, or -1 for none, are those of a side (...)."""
    return (first >= 0) & (second >= 0) & (first != second) & (first + second != 3)


def marks_of(sheet: Sheet) -> Array:
    """Returns the corners and the middles of sides (..., 8)."""
    xp, columns = namespace(sheet.columns), sheet.columns
    last, half = (sheet.rows - 1) * columns, (sheet.rows // 2) * columns
    middles = [columns // 2, last + columns // 2, half, half + columns - 1]
    return xp.concat([corners_of(sheet), xp.stack(middles, axis=-1)], axis=-1)


def grips(sheet: Sheet, hands: Hands, vertices: Array) -> Grips:
    """Returns the best grasp of each vertex (..., k)."""
    xp, places = namespace(sheet.points), taken(sheet.points, vertices)
    centers, clear = clearances(sheet, vertices, EDGES, steps=1)
    directions = constant(DIRECTIONS, places)
    value = CLEARANCE * clear + UPWARDS * directions[:, 2]
    value = value - xp.astype(clear < HIDDEN, clear.dtype)
    values = value[..., None, :, :] + FACING * facings(hands, places)
    index = xp.argmax(values, axis=-1)
    chosen = [_along(centers, index[..., i, :]) for i in range(2)]
    return Grips(xp.max(values, axis=-1), xp.stack(chosen, axis=-3), directions[index])


def corner_grips(sheet: Sheet, hands: Hands) -> Grips:
    """Returns each picker's best grasp for each corner (k = 4), of it or of a vertex around it."""
    xp, corners, number = namespace(sheet.points), corners_of(sheet), len(AROUND)
    around = [
        corners[..., k] + (1 - 2 * (k // 2)) * row * sheet.columns + (1 - 2 * (k % 2)) * column
        for k in range(4)
        for row, column in AROUND
    ]
    vertices = xp.stack(around, axis=-1)
    found = grips(sheet, hands, vertices)
    ways = lengths(found.centers - hands.centers[..., :, None, :])
    flat = taken(sheet.flat, vertices).reshape((*vertices.shape[:-1], 4, number, 2))
    costs = lengths(flat - flat[..., :1, :]).reshape(vertices.shape)
    values = found.values - WAY * ways - COST * costs[..., None, :]
    best = xp.argmax(values.reshape((*values.shape[:-1], 4, number)), axis=-1)
    best = best + number * xp.arange(4, device=device(values))
    centers, directions = (taken(each, best) for each in found[1:])
    return Grips(entries(values, best), centers, directions)


def held_corners(sheet: Sheet, hands: Hands) -> Array:
    """Returns the corner that each picker holds, or whose vicinity, or -1 (..., 2)."""
    xp, corners = namespace(sheet.points), taken(sheet.flat, corners_of(sheet))
    ways = lengths(taken(sheet.flat, hands.held)[..., :, None, :] - corners[..., None, :, :])
    holds = hands.holds & (xp.min(ways, axis=-1) < CORNER)
    return xp.where(holds, xp.argmin(ways, axis=-1), -xp.ones_like(hands.held))


def _along(centers: Array, index: Array) -> Array:
    """Returns centers (..., k, 3) out of (..., k, d, 3) by their indices (..., k)."""
    return namespace(centers).take_along_axis(centers, index[..., None, None], axis=-2)[..., 0, :]
