"""Table of grasp distances and lowest heights of grippers, for the page on custom tasks."""

from softgym_mj.envs.load import load
from softgym_mj.robots.arm.models import ARMS
from softgym_mj.robots.picker import Picker
from tools.pages import table

# Tasks whose objects lie flat on the floor at the start, by material.
_TASKS = {"cloth": "fold_cloth", "rope": "straighten_rope"}
VARIATION = 800


def grasps() -> str:
    """Returns the table, with a row for each material and actor."""
    rows = []
    for material, name in _TASKS.items():
        for actor in ("picker", *ARMS):
            env = load(name, actor=actor)
            env.reset(VARIATION)
            own = env.task.actor
            cells = (
                material,
                f"`{actor}`",
                f"{own.radius:g}" if isinstance(own, Picker) else "",
                f"{own.pick_distance:g}",
                f"{own.limits[0][2]:.3g}",
                f"{env.task.points()[:, 2].min():.2g}",
            )
            rows.append(f"| {' | '.join(cells)} |".replace("|  |", "| |"))
    head = (
        "| material | actor | radius [m] | grasp distance [m] | lowest Z [m] | vertices at Z [m] |"
    )
    return table(head, rows)
