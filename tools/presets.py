"""Table of the learning methods' presets: budget, device and measured duration."""

import tomllib

from softgym_mj.learning import registry
from softgym_mj.learning.results import Row
from softgym_mj.robots.arm.models import ARMS
from tools import learned
from tools.pages import table

DEVICES = {"night": "`cpu`"}  # Device that a preset is made for; otherwise `cuda`.


def presets() -> str:
    """Returns the table; durations are those of published rows."""
    measured = [row for row in learned.rows() if row.final and row.actor not in ARMS]
    lines = []
    for method in registry.METHODS:
        file = registry.PRESETS / f"{method}.toml"
        for preset, parts in tomllib.loads(file.read_text()).items():
            own = [row for row in measured if (row.method, row.preset) == (method, preset)]
            device = DEVICES.get(preset, "`cuda`")
            cells = f"`{method}`", preset, device, _env_steps(parts), _minutes(own)
            lines.append(f"| {' | '.join(cells)} |".replace("|  |", "| |"))
    head = "| method | preset | made for `--device` | env steps per seed | minutes, measured |"
    return table(head, lines)


def _env_steps(parts: dict) -> str:
    """Returns the budget of a preset, and its range over tasks where these differ."""
    budgets = [part["training"]["env_steps"] for part in _trainings(parts)]
    low, high = min(budgets), max(budgets)
    return f"{low:,}" if low == high else f"{low:,} to {high:,}"


def _trainings(parts: dict) -> list[dict]:
    """Returns the parts of a preset that set a budget: for all, a task or an observation."""
    own = [parts] if "env_steps" in parts.get("training", {}) else []
    special = [*parts.get("tasks", {}).values(), *parts.get("observations", {}).values()]
    return own + [found for part in special for found in _trainings(part)]


def _minutes(rows: list[Row]) -> str:
    """Returns the shortest and longest duration, with the number of seeds of a training."""
    times = sorted({row.seconds / 60 for row in rows if row.seconds is not None})
    if not times:
        return ""
    runs: dict[tuple, set[int]] = {}
    for row in rows:
        runs.setdefault((row.task, row.observation, row.replay), set()).add(row.seed)
    seeds = sorted({len(found) for found in runs.values()})
    span = " to ".join(dict.fromkeys(f"{time:.0f}" for time in (times[0], times[-1])))
    noun = "seed" if seeds == [1] else "seeds"
    return f"{span} ({' or '.join(map(str, seeds))} {noun})"
