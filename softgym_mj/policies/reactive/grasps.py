"""Grasps of the ends of a cloth's middle column, for the reactive expert of FoldCrumpledCloth."""

import math
from typing import NamedTuple

import numpy as np
from array_api_compat import device

from softgym_mj.metrics import Array, constant, lengths, namespace, taken
from softgym_mj.policies.reactive.hands import Hands, found_hands

FLOOR, TOP = 0.05, 0.45  # [m] Lowest and highest picker centers of the workspace.
EDGE = 0.8  # [m] Farthest picker centers along X and Y.
RESTING = 0.006  # [m] Height below which floor holds up a held vertex.
REACH, LIMIT = 0.058, 0.0605  # [m] Grasp distance, and largest distance of a grasp.
CLEAR = 0.004  # [m] Clearance from which a vertex counts as fully exposed.
HIDDEN = 0.0005  # [m] Clearance up to which another vertex may be grasped.
SIDEWAYS = 2.0  # Distance along the columns that costs as much as a distance of 1 beside them.
# Weights of a grasp: [1/m] cost, clearance, distance from the picker; direction upwards, away from
# the cloth along Y, along X where the cloth will lie, and towards the picker.
COST, CLEARANCE, WAY = 0.5, 3.0, 0.06
UPWARDS, OUTSIDE, INSIDE, FACING = 0.02, 0.02, 0.03, 0.03
# Vertices that may be grasped: rows from an end, columns from the middle; then fractions of the
# half sheet.
NEAR = [(row, column) for row in range(4) for column in (-1, 0, 1)]
FAR = [(row, column) for row in (0.0, 0.3, 0.7) for column in (-1.0, -0.7, -0.35, 0.35, 0.7, 1.0)]
AWAY = 1e3  # [m] Coordinates of padding.


class Sheet(NamedTuple):
    """Cloth, with padding far away.

    Attributes:
        points: (..., n, 3) [m].
        present: whether each is a vertex of the cloth (..., n).
        rows, columns: numbers of vertices (...).
        flat: positions in the flat cloth at the origin (..., n, 2) [m].
        size: lengths along X and Y (..., 2) [m].
        costs: distance of each vertex from either end of the middle column, the one of row 0
            first, where columns count `SIDEWAYS` (..., 2, n) [m].
    """

    points: Array
    present: Array
    rows: Array
    columns: Array
    flat: Array
    size: Array
    costs: Array


class Grasps(NamedTuple):
    """Grasps of vertices for either end, the one of row 0 first.

    Attributes:
        centers: of pickers (..., 2, m, 3) [m].
        directions: from the vertices to them (m, 3).
        costs: of the vertices (..., 2, m) [m].
        values: for each picker (..., 2 pickers, 2 ends, m).
    """

    centers: Array
    directions: Array
    costs: Array
    values: Array


def _directions() -> np.ndarray:
    """Returns unit vectors (n, 3) over the upper half-sphere, the vertical first."""
    rings = enumerate([(90, 1), (55, 6), (25, 6), (0, 6)])  # Elevation [deg], number.
    angles = [
        (math.radians(elevation), 2 * math.pi * (k + 0.5 * (ring % 2)) / number)
        for ring, (elevation, number) in rings
        for k in range(number)
    ]
    sin, cos = math.sin, math.cos
    return np.array([(cos(e) * cos(a), cos(e) * sin(a), sin(e)) for e, a in angles])


DIRECTIONS = _directions()


def parsed(observation: Array) -> tuple[Sheet, Hands]:
    """Returns cloth and pickers of the observation "full", followed by "markov" (..., 3 n + 32).

    The corners in "markov" show the number of rows and columns, mean lengths of edges the size.
    """
    xp, lead = namespace(observation), observation.shape[:-1]
    number = (observation.shape[-1] - 32) // 3
    points = observation[..., : 3 * number].reshape((*lead, number, 3))
    markov = observation[..., 3 * number + 6 :]
    corners = markov[..., :12].reshape((*lead, 4, 3))
    right, last = (xp.argmin(lengths(points - corners[..., k : k + 1, :]), axis=-1) for k in (2, 3))
    columns = right + 1
    rows = (last + 1) // columns
    index = xp.arange(number, device=device(points))
    present = index <= last[..., None]
    row, column = index // columns[..., None], index % columns[..., None]
    spacings = []
    for place, count, step in (column, columns, 1 + 0 * columns), (row, rows, columns):
        inner = present & (place < count[..., None] - 1)
        following = taken(points, xp.where(inner, index + step[..., None], index))
        edges = xp.sum(lengths(following - points), axis=-1)
        spacings.append(edges / xp.sum(xp.astype(inner, points.dtype), axis=-1))
    across, along = spacings
    flat_x = (column - (columns[..., None] - 1) / 2) * across[..., None]
    flat_y = ((rows[..., None] - 1) / 2 - row) * along[..., None]
    size = xp.stack([across * (columns - 1), along * (rows - 1)], axis=-1)
    half = size[..., 1:] / 2
    costs = [SIDEWAYS * xp.abs(flat_x) + xp.abs(flat_y - end) for end in (half, -half)]
    flat = xp.stack([flat_x, flat_y], axis=-1)
    points = xp.where(present[..., None], points, xp.full_like(points, AWAY))
    sheet = Sheet(points, present, rows, columns, flat, size, xp.stack(costs, axis=-2))
    return sheet, found_hands(markov[..., 12:], points, RESTING)


def find_grasps(sheet: Sheet, hands: Hands) -> Grasps:
    """Returns grasps of vertices near the ends, and of some others."""
    xp, points = namespace(sheet.points), sheet.points
    lead, number = points.shape[:-2], len(NEAR) + len(FAR)
    vertices = _candidates(sheet)
    chosen = taken(points, vertices)
    directions = constant(DIRECTIONS, points)
    centers, clear = clearances(sheet, vertices, (EDGE, EDGE))
    costs = [entries(sheet.costs[..., e, :], v) for e, v in enumerate(_halves(vertices))]
    cost = xp.concat(costs, axis=-1)[..., :, None]
    outside = OUTSIDE * directions[:, 1] * _signs(points, number)
    inside = INSIDE * xp.clip(directions[:, 0], 0.0, None)
    value = CLEARANCE * clear - COST * cost + UPWARDS * directions[:, 2] + outside - inside
    value = value - xp.astype(clear < HIDDEN, points.dtype)
    ways = lengths(centers[..., None, :, :, :] - hands.centers[..., :, None, None, :])
    facing = facings(hands, chosen)
    beside = xp.astype(_beside(sheet, hands, vertices), points.dtype)
    values = value[..., None, :, :] - WAY * ways + FACING * facing - beside[..., None]
    size = number * len(DIRECTIONS)
    tiled = xp.reshape(directions + xp.zeros_like(centers), (*lead, 2, size, 3))
    return Grasps(
        centers.reshape((*lead, 2, size, 3)), tiled,
        (cost + xp.zeros_like(clear)).reshape((*lead, 2, size)),
        values.reshape((*lead, 2, 2, size)),
    )  # fmt: skip


def middle(sheet: Sheet, chosen: Array) -> Array:
    """Returns the mean position (..., 3) [m] of chosen vertices (..., n)."""
    xp = namespace(sheet.points)
    counts = xp.astype(sheet.present & chosen, sheet.points.dtype)
    return xp.sum(sheet.points * counts[..., None], axis=-2) / xp.sum(counts, axis=-1)[..., None]


def _candidates(sheet: Sheet) -> Array:
    """Returns vertices (..., 2 k): k for the end in row 0, then k for the other one."""
    xp = namespace(sheet.points)
    middle, half = (sheet.columns - 1) // 2, (sheet.rows - 1) // 2
    places = [(row + 0 * half, middle + column) for row, column in NEAR]
    for row, column in FAR:
        rounded = [
            xp.round(f * xp.astype(n, xp.float64)) for f, n in ((row, half), (column, middle))
        ]
        down, across = (xp.astype(each, half.dtype) for each in rounded)
        places.append((down, middle + across))
    first = [row * sheet.columns + column for row, column in places]
    last = [(sheet.rows - 1 - row) * sheet.columns + column for row, column in places]
    return xp.stack([*first, *last], axis=-1)


def _signs(like: Array, number: int) -> Array:
    """Returns the sign of Y (2 k, 1) at the ends of k candidates each."""
    return constant(np.repeat([1.0, -1.0], number)[:, None], like)


def _halves(values: Array) -> tuple[Array, Array]:
    """Returns the halves (..., k) of values (..., 2 k)."""
    number = values.shape[-1] // 2
    return values[..., :number], values[..., number:]


def clearances(
    sheet: Sheet, vertices: Array, edges: tuple[float, float], steps: int = 0
) -> tuple[Array, Array]:
    """Returns centers (..., k, d, 3) [m] of pickers in d `DIRECTIONS`, and their clearances [m].

    A clearance (..., k, d) is the distance of the nearest other vertex minus that of the own one,
    at most `CLEAR`; it is -1 if the workspace keeps the picker out of reach.

    Args:
        sheet: the cloth.
        vertices: (..., k).
        edges: farthest picker centers along X and Y [m].
        steps: steps in the grid up to which vertices do not count as others.
    """
    points, directions = sheet.points, constant(DIRECTIONS, sheet.points)
    xp, chosen = namespace(points), taken(points, vertices)[..., None, :]
    centers = bounded(chosen + REACH * directions, edges)
    distance = lengths(centers - chosen)
    clear = xp.clip(_nearest(sheet, vertices, centers, steps) - distance, None, CLEAR)
    return centers, xp.where(distance > LIMIT, xp.full_like(clear, -1.0), clear)


def bounded(centers: Array, edges: tuple[float, float]) -> Array:
    """Returns picker centers (..., 3) [m] within the workspace.

    Args:
        centers: (..., 3) [m].
        edges: farthest ones along X and Y [m].
    """
    xp, (x, y) = namespace(centers), edges
    low, high = (constant(end, centers) for end in ([-x, -y, FLOOR], [x, y, TOP]))
    return xp.maximum(xp.minimum(centers, high), low)


def facings(hands: Hands, places: Array) -> Array:
    """Returns how much `DIRECTIONS` point from places (..., k, 3) [m] to hands: (..., 2, k, d)."""
    toward = hands.centers[..., :, None, :] - places[..., None, :, :]
    toward = toward / (lengths(toward)[..., None] + 0.05)
    directions = constant(DIRECTIONS, places)
    return namespace(places).sum(toward[..., None, :] * directions, axis=-1)


def _nearest(sheet: Sheet, vertices: Array, centers: Array, steps: int) -> Array:
    """Returns the distances (..., k, d) [m] of centers from the nearest other vertex.

    Args:
        sheet: the cloth.
        vertices: own vertices (..., k).
        centers: (..., k, d, 3) [m].
        steps: steps in the grid up to which vertices do not count as others.
    """
    xp, points = namespace(centers), sheet.points
    # |c - p|^2 = |c|^2 + (c, 1) (-2 p, |p|^2).
    rows = xp.concat([centers, xp.ones_like(centers[..., :1])], axis=-1)
    squares = xp.sum(points * points, axis=-1)[..., None]
    terms = xp.concat([-2.0 * points, squares], axis=-1)
    number = points.shape[-2]
    lead, (many, each) = points.shape[:-2], centers.shape[-3:-1]
    products = xp.matmul(rows.reshape((*lead, many * each, 4)), xp.moveaxis(terms, -1, -2))
    index = xp.arange(number, device=device(points))
    own = AWAY**2 * xp.astype(within(sheet, vertices, index, steps), points.dtype)
    least = xp.min(products.reshape((*lead, many, each, number)) + own[..., None, :], axis=-1)
    return xp.sqrt(xp.clip(least + xp.sum(centers * centers, axis=-1), 0.0, None))


def within(sheet: Sheet, first: Array, second: Array, steps: int) -> Array:
    """Returns whether vertices (..., k) and (..., m) are within grid steps: (..., k, m)."""
    xp, columns = namespace(sheet.points), sheet.columns[..., None, None]
    first, second = first[..., :, None], second[..., None, :]
    near = xp.abs(first // columns - second // columns) <= steps
    return near & (xp.abs(first % columns - second % columns) <= steps)


def _beside(sheet: Sheet, hands: Hands, vertices: Array) -> Array:
    """Returns whether the other picker holds each vertex (..., k), or a neighbor: (..., 2, k)."""
    xp = namespace(vertices)
    near = within(sheet, xp.flip(hands.held, axis=-1), vertices, 1)
    return near & xp.flip(hands.holds, axis=-1)[..., None]


def entries(values: Array, indices: Array) -> Array:
    """Returns values (..., k) out of values (..., n) by their indices (..., k)."""
    return namespace(values).take_along_axis(values, indices, axis=-1)


def entry(values: Array, index: Array) -> Array:
    """Returns a value (...) out of values (..., n) by its index (...)."""
    return entries(values, index[..., None])[..., 0]
