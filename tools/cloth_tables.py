"""What docs/reality.md shows of a recorded cloth: docs/cloth_recordings.json.

`softgym-mj identify cloth` and then `softgym-mj validate cloth --identified ... --out` wrote it.
"""

from collections.abc import Callable

from tools.pages import table
from tools.reality_table import recorded

# Shown with their factors and units.
PROPERTIES = {
    "bend": ("bending [10⁻⁶ N m]", 1e6),
    "bend_damping": ("its damping [ms]", 1e3),
    "drag": ("drag coefficient", 1.0),
    "added_mass": ("added mass of air [kg/m²]", 1.0),
    "length": ("length", 1.0),
}


def errors() -> str:
    """Errors of all solvers [mm] over all nodes and two edges, and the speed of simulations."""
    lines = []
    for row in recorded("cloth")["measurements"]:
        names = "error", "held_error", "far_error", "worst", "error_of_complete"
        cells = [f"{1e3 * row[name]:.1f}" for name in names]
        cells.append(f"{row['real_time_factor']:.0f}" if row["models"] else "")
        lines.append(f"| {row['solver']} | {' | '.join(cells)} |")
    titles = "all nodes", "held edge", "far edge", "worst recording", "all complete frames"
    return table(f"| mean error [mm] | {' | '.join(titles)} | times real time |", lines)


def properties() -> str:
    """Identified properties with their 95 % intervals."""
    found = recorded("cloth")["identified"]
    lines = []
    for name, (title, factor) in PROPERTIES.items():
        value, (low, high) = found["properties"][name], found["intervals"][name]
        cells = f"{factor * value:.3g} | {factor * low:.3g} to {factor * high:.3g}"
        lines.append(f"| {title} | {cells} |")
    return table("| property | value | 95 % |", lines)


def quality() -> str:
    """Numbers of frames, and the noise at rest."""
    found = recorded("cloth")["quality"]
    counts = [f"{found[name]}" for name in ("frames", "complete", "counted")]
    line = f"| {' | '.join(counts)} | {1e3 * found['noise']:.1f} |"
    return table("| frames | with all nodes | that count | noise at rest [mm] |", [line])


TABLES: dict[str, Callable[[], str]] = {
    "cloth_quality": quality,
    "cloth_errors": errors,
    "cloth_properties": properties,
}
