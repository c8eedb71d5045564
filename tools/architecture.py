"""Draws docs/architecture.svg: the folders on their layers, which tests/test_imports.py checks."""

import pathlib

# Each folder or root module imports only from layers below its own.
LAYERS = [
    {"assets", "exceptions"},
    {"native", "validation", "parallel"},
    {"storage"},
    {"batch"},
    {"metrics", "rendering", "variations", "cloth"},
    {"fluid", "entities"},
    {"robots", "reality"},
    {"tasks"},
    {"registry"},
    {"envs"},
    {"vector", "compat", "policies"},
    {"__init__", "viewing", "evaluation", "recording"},
    {"learning"},
    {"cli"},
]
FILE = pathlib.Path(__file__).parent.parent / "docs" / "architecture.svg"
WIDTH, HEIGHT, GAP = 130, 30, 14  # [pixels] Sides of a box, distance of two.
COLORS = ("#e8eef7", "#d3e1f1")  # Colors of the layers, alternating.


def svg() -> str:
    """The picture."""
    widest = max(map(len, LAYERS))
    width = widest * (WIDTH + GAP) + GAP
    height = len(LAYERS) * (HEIGHT + GAP) + GAP
    parts = [
        f'<svg xmlns="http://www.w3.org/2000/svg" width="{width}" height="{height}" '
        'font-family="sans-serif" font-size="14" text-anchor="middle">'
    ]
    for layer, packages in enumerate(LAYERS):
        y = height - (layer + 1) * (HEIGHT + GAP)
        left = (width - len(packages) * (WIDTH + GAP) + GAP) / 2
        for i, package in enumerate(sorted(packages)):
            x = left + i * (WIDTH + GAP)
            parts.append(
                f'<rect x="{x:g}" y="{y}" width="{WIDTH}" height="{HEIGHT}" rx="5" '
                f'fill="{COLORS[layer % 2]}" stroke="#4a6a96"/>'
                f'<text x="{x + WIDTH / 2:g}" y="{y + HEIGHT / 2 + 5:g}">{package}</text>'
            )
    return "\n".join([*parts, "</svg>"]) + "\n"


def main() -> None:
    FILE.write_text(svg())


if __name__ == "__main__":
    main()
