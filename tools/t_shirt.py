"""Draws the T-shirt that ships as a mesh: two layers sewn at the sides, the shoulders and sleeves.

python tools/t_shirt.py > softgym_mj/assets/garments/t_shirt.obj
"""

import numpy as np

PITCH = 0.03  # [m] Of the grid that it is cut from: the length of most edges.
# In grid nodes from the middle and from the hem: half the body's and the neck's width, to the end
# of a sleeve; where sleeves begin, the shoulders.
BODY, NECK, SLEEVE = 5, 2, 8
ARMPIT, SHOULDER = 9, 13
# Nodes by which the opening for the neck is lower than the shoulders, in front and behind; one
# less towards the shoulders.
FRONT_NECK, BACK_NECK = 3, 1
# [m] By which layers that are not sewn lie apart from the middle, more than the contact radius.
HALF_GAP = 0.0065
# How far shoulders and sleeves hang down per length, how much narrower the body is at the waist.
SHOULDER_SLOPE, SLEEVE_SLOPE, WAIST = 0.15, 0.4, 0.05


def in_shirt(column: float, row: float, neck: int) -> bool:
    """Whether a place belongs to a layer, with a neck `neck` nodes deep."""
    if abs(column) < NECK and row > SHOULDER - max(neck - (abs(column) > 1), 1):
        return False
    return abs(column) <= BODY or row >= ARMPIT


def is_sewn(column: int, row: int) -> bool:
    """Whether the layers are sewn together at a node."""
    side = abs(column) == BODY and row <= ARMPIT
    top = row == SHOULDER and abs(column) >= NECK
    under = row == ARMPIT and abs(column) >= BODY
    return side or top or under


def place(column: int, row: int, side: float) -> tuple[float, float, float]:
    """Position [m] of a node of the front (side 1), the back (-1) or a seam (0)."""
    shoulder = min(max(abs(column) - NECK, 0), BODY - NECK)
    sleeve = max(abs(column) - BODY, 0)
    above = max(row - ARMPIT, 0) / (SHOULDER - ARMPIT)
    x = column * (1.0 - WAIST * np.sin(np.pi * min(row / ARMPIT, 1.0)))
    y = row - SHOULDER / 2 - SHOULDER_SLOPE * shoulder * above - SLEEVE_SLOPE * sleeve
    return x * PITCH, y * PITCH, side * HALF_GAP


def mesh() -> tuple[list[tuple[float, float, float]], list[tuple[int, ...]]]:
    """Vertices [m] and triangles, which are counter-clockwise from outside."""
    vertices: list[tuple[float, float, float]] = []
    index: dict[tuple[int, int, float], int] = {}
    triangles = []

    def vertex(column: int, row: int, side: float) -> int:
        key = (column, row, 0.0 if is_sewn(column, row) else side)
        if key not in index:
            index[key] = len(vertices)
            vertices.append(place(*key))
        return index[key]

    for side, neck in ((1.0, FRONT_NECK), (-1.0, BACK_NECK)):
        for row in range(SHOULDER):
            for column in range(-SLEEVE, SLEEVE):
                if not in_shirt(column + 0.5, row + 0.5, neck):
                    continue
                a, b, c, d = (
                    vertex(column + i, row + j, side) for i, j in ((0, 0), (1, 0), (1, 1), (0, 1))
                )
                # Diagonals that alternate, so that no direction bends easier.
                faces = [(a, b, c), (a, c, d)] if (row + column) % 2 else [(a, b, d), (b, c, d)]
                triangles += faces if side > 0 else [face[::-1] for face in faces]
    return vertices, triangles


def main() -> None:
    vertices, triangles = mesh()
    print("# T-shirt of two layers, in meters, lying on its back: Z up, the hem at -Y.")
    print("# Own work of the softgym_mj project, Apache-2.0; drawn by tools/t_shirt.py.")
    for x, y, z in vertices:
        print(f"v {x:.5f} {y:.5f} {z:.5f}")
    for triangle in triangles:
        print("f", *(i + 1 for i in triangle))


if __name__ == "__main__":
    main()
