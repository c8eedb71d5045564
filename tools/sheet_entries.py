"""Entries of states and keys of info, for the data sheets: meanings, sizes and tables."""

from collections.abc import Iterable, Mapping, Sequence

import numpy as np

from softgym_mj.envs.environment import Environment
from softgym_mj.tasks import Task
from softgym_mj.tasks.shared.entries import labels

# Meanings of the keys of info; "reward_*" and "domain_*" are explained elsewhere.
INFO = {
    "performance": "the task's metric",
    "normalized_performance": "the same, scaled to 0 at the lower and 1 at the upper bound",
    "success": "whether `normalized_performance` is at least the task's threshold",
    "is_success": "the same under the name that Stable-Baselines3 reads",
    "variation": "index of the variation",
    "physics_warnings": "number of MuJoCo's warnings in this episode",
    "diverged": "whether the simulation diverged in the last env step, which ends the episode",
    "max_edge_strain": "largest elongation of an edge, relative to its rest length",
    "episode_max_edge_strain": "largest `max_edge_strain` of the episode, its start included",
    "max_speed": "speed of the fastest vertex [m/s]; a warning is issued above 20 m/s",
    "picks_held": "grippers that hold something",
    "dropped": "number of releases in this episode",
    "yielded": "how many of these were releases under load",
    "normalized_coverage": "secondary metric: covered area relative to the flat cloth's (NC)",
    "normalized_improvement": "secondary metric: the same, scaled to 0 at the start (NI)",
    "mean_corner_distance": "secondary metric: mean distance of corners from targets, top view [m]",
    "outline_iou": "secondary metric: intersection over union of the covered and the target area",
    "wrinkle_height": "secondary metric: height of the highest point above the target [m]",
    "mean_point_error": "secondary metric: mean distance of the vertices from their targets [m]",
    "rejected_moves": "sim steps of the last env step in which the cup was not allowed to move",
    "end_point_distance": "distance of the two ends [m]",
    "initial_normalized_performance": "`normalized_performance` at reset",
    "distance_to_target": "distance of the cup from its goal [m]",
    "spilled": "fraction of the particles outside all cups",
    "fraction_in_cup": "fraction of the particles in the box of the moved cup",
    "fraction_in_target": "fraction of the particles in the box of the target cup",
    "pair_distance": "mean distance of the pairs [m]",
    "displacement": "mean distance of the second half from its target [m]",
    "poured": "fraction of the particles in the target cup and not in the other",
    "share": "fraction to be poured",
    "sim_steps": "sim steps that the last action took",
    "ik_failures": "control steps in which the arm's controller found no joint velocities",
    "at_reach": "commanded points at the limit of their arm's reach",
}
# Keys of info that are explained once, by what has them.
COMMON = {
    "all": ("performance", "normalized_performance", "success", "is_success", "variation",
            "physics_warnings", "diverged"),
    "cloth, rope": ("max_edge_strain", "episode_max_edge_strain", "max_speed", "picks_held",
                    "dropped", "yielded"),
    "pick and place": ("sim_steps",),
    "arms": ("ik_failures", "at_reach"),
}  # fmt: skip


def ending_entries(task: Task) -> dict[str, int]:
    """Sizes of the actor's measurements at the end of the full and the reduced state."""
    return task.actor.senses if task.actor.ends_states else {}


def reduced_entries(task: Task) -> dict[str, int]:
    """Sizes of the entries of the reduced state."""
    return sizes(labels(task.reduced(task.state(), task.episode))) | ending_entries(task)


def full_entries(env: Environment) -> dict[str, int]:
    """Sizes of the entries of the full state."""
    task, number = env.task, env.observation_spec()["full_mask"].shape[0]
    points = {f"{number} points (x, y, z each), padded with zeros [m]": 3 * number}
    return (
        points | sizes(labels(task.extra_state(task.state(), task.episode))) | ending_entries(task)
    )


def sizes(arrays: dict[str, np.ndarray]) -> dict[str, int]:
    """Size of each array."""
    return {name: np.size(array) for name, array in arrays.items()}


def table(header: Sequence[str], rows: Iterable[Sequence[object]]) -> str:
    """A Markdown table."""
    lines = [header, ["---"] * len(header), *rows]
    return "\n".join("| " + " | ".join(map(str, line)) + " |" for line in lines) + "\n"


def entry_table(entries: Mapping[str, int], start: int = 0) -> str:
    """Table of the entries of a state from index `start`; `entries` maps "name [unit]" to sizes."""
    rows = []
    for label, number in entries.items():
        end = start + number - 1
        name, _, unit = label.rstrip("]").partition(" [")
        rows.append((start if end == start else f"{start} to {end}", name, unit))
        start = end + 1
    return table(("entries", "what", "unit"), rows)
