"""`CupSize`: dimensions of a cup, and its mesh."""

import dataclasses

import numpy as np

from softgym_mj.exceptions import InvalidArgumentError
from softgym_mj.validation import typed

# Radii relative to a wall's thickness: of rims and feet, and of the upright edges inside.
ROUNDING, INNER_ROUNDING = 0.45, 0.6
RIM_STEPS, CORNER_STEPS = 3, 6  # Segments of a quarter of a circle.


@typed
@dataclasses.dataclass(frozen=True)
class CupSize:
    """Dimensions of a cup [m].

    Attributes:
        length: inner length of the floor along X.
        width: inner width of the floor along Y.
        height: height of the walls above the middle of the floor slab, which is one wall thick.
        wall: thickness of walls and floor.
    """

    length: float
    width: float
    height: float
    wall: float

    def __post_init__(self):
        values = dataclasses.astuple(self)
        if min(values) <= 0.0 or self.height <= self.wall / 2:
            raise InvalidArgumentError("cup size", values, "positive lengths, height > wall / 2")

    @property
    def depth(self) -> float:
        """Height [m] of the rim above the upper side of the floor."""
        return self.height - self.wall / 2


def cup_mesh(size: CupSize) -> tuple[np.ndarray, np.ndarray]:
    """Returns a cup's closed surface with rounded edges: vertices (n, 3) [m], triangles (m, 3)."""
    sill, top, wall = -size.wall / 2, size.height, size.wall
    round_off = ROUNDING * wall
    # Sections from below outwards, up, over the rim, and down inside: their distance from the
    # inner walls, negative within, and their height [m].
    turn = np.linspace(0.0, np.pi / 2, RIM_STEPS + 1)
    out, up = round_off * (1.0 - np.sin(turn)), round_off * (1.0 - np.cos(turn))
    foot = zip(wall - out, sill + up, strict=True)
    lip = zip(wall - up, top - out, strict=True)
    inside = zip(up[::-1], (top - out)[::-1], strict=True)
    sections = [*foot, *lip, *inside, (0.0, -sill + round_off), (-round_off, -sill)]
    half = np.array([size.length, size.width]) / 2
    angles = np.linspace(0.0, np.pi / 2, CORNER_STEPS + 1)
    arc = np.column_stack([np.cos(angles), np.sin(angles)])
    corners = [arc @ np.array([[c, s], [-s, c]]) for c, s in ((1, 0), (0, 1), (-1, 0), (0, -1))]
    signs = ((1, 1), (-1, 1), (-1, -1), (1, -1))
    rings = []
    for distance, height in sections:
        # The inner edges have this radius, the outer ones follow them.
        radius = max(INNER_ROUNDING * wall + distance, 0.1 * round_off)
        ring = [
            (half + distance - radius) * sign + radius * corner
            for sign, corner in zip(signs, corners, strict=True)
        ]
        flat = np.concatenate(ring)
        rings.append(np.column_stack([flat, np.full(len(flat), height)]))
    number, around = len(rings), len(rings[0])
    points = np.concatenate([*rings, [[0.0, 0.0, sill], [0.0, 0.0, -sill]]])
    this = np.arange(around)
    following = np.roll(this, -1)
    first = around * np.arange(number - 1)[:, None]
    a, b = first + this, first + following
    faces = [
        np.stack(f, -1).reshape(-1, 3) for f in ((a, b, b + around), (a, b + around, a + around))
    ]
    last = around * (number - 1)
    bottom = np.stack([following, this, np.full(around, number * around)], -1)
    floor = np.stack([last + this, last + following, np.full(around, number * around + 1)], -1)
    return points, np.concatenate([*faces, bottom, floor])
