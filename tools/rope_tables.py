"""What docs/reality.md shows of recorded cables: docs/rope_recordings.json.

`softgym-mj identify rope` and then `softgym-mj validate rope --identified ... --out` wrote it.
"""

from collections.abc import Callable

from tools.pages import table
from tools.reality_table import recorded

# Shown with their factors and units.
PROPERTIES = {
    "bend": ("bending [10⁻³ N m²]", 1e3),
    "bend_damping": ("its damping [ms]", 1e3),
    "air_damping": ("air [10⁻³ N s/m²]", 1e3),
    "length": ("length", 1.0),
}


def errors() -> str:
    """Errors of all solvers [mm], over all and over free markers, and the speed of simulations."""
    rows = recorded("rope")["measurements"]
    cables = list(dict.fromkeys(row["cable"] for row in rows))
    lines = []
    for solver in dict.fromkeys(row["solver"] for row in rows):
        own = {row["cable"]: row for row in rows if row["solver"] == solver}
        cells = [f"{1e3 * own[c]['error']:.1f}, {1e3 * own[c]['free_error']:.1f}" for c in cables]
        speeds = [row["real_time_factor"] for row in own.values()]
        simulated = any(row["models"] for row in own.values())
        cells.append(f"{min(speeds):.0f} to {max(speeds):.0f}" if simulated else "")
        lines.append(f"| {solver} | {' | '.join(cells)} |")
    return table(f"| all, free markers [mm] | {' | '.join(cables)} | times real time |", lines)


def properties() -> str:
    """Identified properties with their 95 % intervals."""
    lines = []
    for cable, found in recorded("rope")["identified"].items():
        cells = []
        for name, (_, factor) in PROPERTIES.items():
            value, (low, high) = found["properties"][name], found["intervals"][name]
            cells.append(f"{factor * value:.3g} ({factor * low:.3g} to {factor * high:.3g})")
        lines.append(f"| {cable} | {' | '.join(cells)} |")
    titles = " | ".join(title for title, _ in PROPERTIES.values())
    return table(f"| cable | {titles} |", lines)


TABLES: dict[str, Callable[[], str]] = {"rope_errors": errors, "rope_properties": properties}
