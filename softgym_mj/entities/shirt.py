"""`Shirt`: a shirt or dress of two layers, front and back, drawn from the measures of a cut."""

import dataclasses
import functools
import math

import numpy as np

from softgym_mj.entities.cloth import FIDELITIES
from softgym_mj.entities.fabric import Fabric
from softgym_mj.entities.flex import Color
from softgym_mj.entities.garment import MeshSheet
from softgym_mj.entities.sheet import BACK_COLOR, FRONT_COLOR
from softgym_mj.exceptions import check_name
from softgym_mj.validation import typed

# Density and bending of RGBench's T-shirt (`cloth.fabrics`). It is three times as thick as a real
# one [m]: thinner layers cross each other more often, and folds of thicker ones spring open.
FABRIC = Fabric(density=0.22, bend_stiffness=1e-6, thickness=0.003)
GAP = 1.3  # Distance of layers in the pattern, in thicknesses: they settle without touching.
# Key points, from the left of the wearer to the right, such that the reversed order is a mirror
# image: below the collar, at the front, and at seams.
KEYS = (
    "left hem", "left cuff, inner end", "left cuff, outer end", "left armpit", "left shoulder",
    "collar",
    "right shoulder", "right armpit", "right cuff, outer end", "right cuff, inner end", "right hem",
)  # fmt: skip


@dataclasses.dataclass(frozen=True)
class Cut:
    """Measures of a shirt that lies flat; the defaults are a T-shirt.

    Attributes:
        chest: half the width from armpit to armpit [m].
        length: height of the shoulders at the neck above the hem [m].
        flare: width of the hem over that of the chest.
        waist: share by which the body is narrower halfway between hem and armpits.
        neck: half the width of the neck [m].
        neck_front, neck_back: depths of the neckline in front and behind [m].
        shoulder_drop: height of the neck's sides above the ends of the shoulders [m].
        armhole: width of a sleeve at the body [m].
        sleeve: length of a sleeve [m].
        sleeve_angle: its angle below the horizontal [rad].
        cuff: width of its end [m].
    """

    chest: float = 0.21
    length: float = 0.54
    flare: float = 1.0
    waist: float = 0.04
    neck: float = 0.085
    neck_front: float = 0.065
    neck_back: float = 0.02
    shoulder_drop: float = 0.04
    armhole: float = 0.16
    sleeve: float = 0.16
    sleeve_angle: float = 0.5
    cuff: float = 0.14

    @property
    def armpit(self) -> float:
        """Height [m] of the armpits above the hem."""
        return self.length - self.shoulder_drop - self.armhole


class _Pattern:
    """Two layers of a cut as a mesh: a grid of the body, and one of each sleeve.

    Columns count from the middle, rows from the hem. Nodes are a spacing apart, more or less.
    """

    def __init__(self, cut: Cut, spacing: float):
        self.cut = cut
        count = functools.partial(_count, spacing=spacing)
        self.neck = count(cut.neck)
        self.body = self.neck + count(cut.chest - cut.neck)
        self.armpit, self.top = count(cut.armpit), count(cut.armpit) + count(cut.armhole)
        self.end = self.body + count(cut.sleeve)

    @property
    def num_vertices(self) -> int:
        """Number of nodes in two layers, of which those at seams are one."""
        sleeve = self.end - self.body
        nodes = (2 * self.body + 1) * (self.top + 1) + 2 * sleeve * (self.top - self.armpit + 1)
        sewn = 2 * (self.armpit + 1 + self.end - self.neck + 1 + sleeve)
        return 2 * nodes - sewn

    def is_sewn(self, column: int, row: int) -> bool:
        """Returns whether the layers are sewn together at a node: at sides, shoulders, sleeves."""
        side = abs(column) == self.body and row <= self.armpit
        shoulder = row == self.top and abs(column) >= self.neck
        return side or shoulder or (row == self.armpit and abs(column) >= self.body)

    def place(self, column: int, row: int, side: int) -> tuple[float, float]:
        """Returns the place [m] of a node of the front (side 1) or the back (-1) from the hem."""
        cut, sign, column = self.cut, math.copysign(1.0, column), abs(column)
        if column > self.body:
            x, y = self._sleeve(column, row)
        elif row <= self.armpit:
            share = row / self.armpit
            width = 1.0 + (cut.flare - 1.0) * (1.0 - share) - cut.waist * math.sin(math.pi * share)
            x, y = width * self._across(column), share * cut.armpit
        else:
            share = (row - self.armpit) / (self.top - self.armpit)
            x, y = self._across(column), cut.armpit + share * (self._height(column, side))
        return sign * x, y

    def _across(self, column: int) -> float:
        """Returns the distance [m] of a column of the body from its middle."""
        if column <= self.neck:
            return column / self.neck * self.cut.neck
        beyond = (column - self.neck) / (self.body - self.neck)
        return self.cut.neck + beyond * (self.cut.chest - self.cut.neck)

    def _height(self, column: int, side: int) -> float:
        """Returns the height [m] of the upper edge of a layer above the armpits."""
        cut, highest = self.cut, self.cut.armhole + self.cut.shoulder_drop
        if column >= self.neck:
            beyond = (column - self.neck) / (self.body - self.neck)
            return highest - beyond * cut.shoulder_drop
        depth = cut.neck_front if side > 0 else cut.neck_back
        return highest - depth * (1.0 - (column / self.neck) ** 2)

    def _sleeve(self, column: int, row: int) -> tuple[float, float]:
        cut = self.cut
        along = (column - self.body) / (self.end - self.body)
        across = (row - self.armpit) / (self.top - self.armpit)
        sine, cosine = math.sin(cut.sleeve_angle), math.cos(cut.sleeve_angle)
        aside = cut.cuff * (across - 0.5)  # From the middle of the cuff, outwards.
        x = cut.chest + along * (cut.sleeve * cosine + aside * sine)
        start, middle = cut.armpit + across * cut.armhole, cut.armpit + cut.armhole / 2
        end = middle - cut.sleeve * sine + aside * cosine
        return x, start + along * (end - start)

    def cells(self) -> list[tuple[int, int]]:
        """Returns columns and rows of the lower left nodes of all cells."""
        columns, rows = range(-self.end, self.end), range(self.top)
        is_body = {column: -self.body <= column < self.body for column in columns}
        return [(c, r) for r in rows for c in columns if is_body[c] or r >= self.armpit]

    def mesh(self, gap: float) -> tuple[np.ndarray, np.ndarray, dict[tuple[int, int, int], int]]:
        """Returns vertices (n, 3) [m], triangles (m, 3) and vertices by (column, row, side).

        Triangles are counter-clockwise from outside; the front is above. The side of seams is 0.

        Args:
            gap: distance of the layers [m].
        """
        points: list[tuple[float, float, float]] = []
        index: dict[tuple[int, int, int], int] = {}
        triangles: list[tuple[int, ...]] = []

        def vertex(column: int, row: int, side: int) -> int:
            key = (column, row, 0 if self.is_sewn(column, row) else side)
            if key not in index:
                index[key] = len(points)
                points.append((*self.place(column, row, side), key[2] * gap / 2))
            return index[key]

        for side in (-1, 1):
            for column, row in self.cells():
                right, upper = column + 1, row + 1
                a, b = vertex(column, row, side), vertex(right, row, side)
                c, d = vertex(right, upper, side), vertex(column, upper, side)
                # Diagonals alternate, so that no direction bends easier, mirrored in the middle.
                rises = (row + (column if column >= 0 else -1 - column)) % 2 == (column >= 0)
                faces = [(a, b, c), (a, c, d)] if rises else [(a, b, d), (b, c, d)]
                triangles += faces if side > 0 else [face[::-1] for face in faces]
        return np.array(points), np.array(triangles), index

    def key_nodes(self) -> list[tuple[int, int, int]]:
        """Returns column, row and side of the key points, in the order of `KEYS`."""
        half = [
            (self.body, 0), (self.end, self.armpit), (self.end, self.top),
            (self.body, self.armpit), (self.body, self.top),
        ]  # fmt: skip
        # The wearer's left is on the right when the front is seen.
        left, right = ([(sign * column, row, 0) for column, row in half] for sign in (1, -1))
        return [*left, (0, self.top, 1), *right[::-1]]


def _count(length: float, spacing: float) -> int:
    return max(round(length / spacing), 2)


def num_vertices(cut: Cut, fidelity: str) -> int:
    """Returns the number of vertices of a shirt."""
    return _Pattern(cut, FIDELITIES[fidelity]).num_vertices


class Shirt(MeshSheet):
    """Shirt or dress that is open at hem, neck and cuffs, and sewn elsewhere.

    Attributes:
        cut: its measures.
        keys: vertices (11,) of the key points, in the order of `KEYS`.
        arrays: arrays that depend on the cut, by name: `keys`; `triangles` (m, 3); the shares of
            vertices in the area, `body` and `sleeves` (num_points,), that add up to 1 together;
            whether vertices are left of the middle, `is_left` (num_points,).
    """

    @typed
    def _build(
        self,
        cut: Cut | None = None,
        *,
        fidelity: str = "default",
        fabric: Fabric | None = None,
        colors: tuple[Color, Color] = (FRONT_COLOR, BACK_COLOR),
        name: str = "shirt",
    ):
        """Builds the shirt.

        Args:
            cut: its measures; None for a T-shirt.
            fidelity: "fast", "default" or "accurate": vertices about 4, 3 or 2 cm apart.
            fabric: fabric; None for a knit of 3 mm.
            colors: (r, g, b, a) in 0..1 of the outside and the inside.
            name: model name.

        Raises:
            InvalidArgumentError: for a bad fidelity.
        """
        check_name("fidelity", fidelity, FIDELITIES)
        self._fidelity = fidelity
        self._start_sheet(name, FABRIC if fabric is None else fabric, colors)
        self._thickness = self._values["thickness"]
        self.cut: Cut | None = None
        self.resize(Cut() if cut is None else cut)

    def resize(self, cut: Cut) -> bool:
        """Changes the cut; returns True if the model changed and must be recompiled."""
        if cut == self.cut:
            return False
        self.cut = cut
        pattern = _Pattern(cut, FIDELITIES[self._fidelity])
        points, triangles, index = pattern.mesh(GAP * self._thickness)
        self._set_shape(points, triangles)
        self.keys = np.array([index[key] for key in pattern.key_nodes()])
        columns = np.zeros(len(points), int)
        columns[list(index.values())] = [column for column, _, _ in index]
        away = abs(columns)
        is_sleeve = (away[triangles] > pattern.body).any(axis=1)
        self.arrays = {
            "keys": self.keys,
            "triangles": triangles,
            "body": self._shares(points, ~is_sleeve),
            "sleeves": self._shares(points, is_sleeve),
            "is_left": columns > 0,
        }
        return True

    def _shares(self, points: np.ndarray, is_own: np.ndarray) -> np.ndarray:
        """Returns the share (n,) of the shirt's area that each vertex has in own triangles (m,)."""
        a, b, c = (points[self.triangles[:, k], :2] for k in range(3))
        sides = b - a, c - a
        areas = np.abs(sides[0][:, 0] * sides[1][:, 1] - sides[0][:, 1] * sides[1][:, 0])
        shares = np.zeros(len(points))
        for k in range(3):
            np.add.at(shares, self.triangles[is_own, k], areas[is_own])
        return shares / (3.0 * areas.sum())
