"""Entries of states and keys of info, for the data sheets: meanings, sizes and tables."""

import re
from collections.abc import Iterable, Iterator, Mapping, Sequence

import numpy as np

from softgym_mj.envs.environment import Environment
from softgym_mj.registry import TaskRecord
from softgym_mj.tasks import Task
from softgym_mj.tasks.shared.entries import labels
from tools import pages

# Meanings of the keys of info; "reward_*" and "domain_*" are explained elsewhere.
INFO = {
    "performance": "the task's metric",
    "normalized_performance": "the same, scaled to 0 at the lower and 1 at the upper bound; the "
    "value of the last step is the score of an episode",
    "success": "whether `normalized_performance` is at least the task's threshold",
    "is_success": "the same under the name that Stable-Baselines3 reads",
    "variation": "index of the variation",
    "physics_warnings": "number of MuJoCo's warnings in this episode",
    "diverged": "whether the simulation diverged in the last env step, which ends the episode",
    "max_edge_strain": "largest elongation of an edge, relative to its rest length",
    "episode_max_edge_strain": "largest `max_edge_strain` of the episode, its start included",
    "max_speed": "speed of the fastest vertex [m/s]; a warning is issued above 20 m/s",
    "picks_held": "number of grippers that hold something",
    "dropped": "number of releases in this episode",
    "yielded": "number of these that were releases under load",
    "normalized_coverage": "secondary: covered area in top view over that of the flat cloth: NC of "
    "VCD (Lin et al., 2021)",
    "normalized_improvement": "secondary: the same, scaled to 0 at the start: NI of VCD",
    "mean_corner_distance": "secondary: mean distance of the corners from their places in top "
    "view [m]",
    "outline_iou": "secondary: intersection over union of the covered and the goal's area in top "
    "view",
    "wrinkle_height": "secondary: height of the highest vertex above the place of the upper "
    "layer [m]",
    "mean_point_error": "secondary: mean distance of the vertices from those of the goal, counted "
    "from the better end [m]; the goal of `straighten_rope` is a straight rope with the middle and "
    "direction of the line between the ends",
    "rejected_moves": "number of sim steps of the last env step in which the cup's move was "
    "rejected",
    "end_point_distance": "distance of the two ends [m]",
    "initial_normalized_performance": "`normalized_performance` at reset",
    "distance_to_target": "distance of the cup from its goal [m]",
    "spilled": "fraction of the particles outside all cups",
    "fraction_in_cup": "fraction of the particles in the box of the moved cup",
    "fraction_in_target": "fraction of the particles in the box of the target cup",
    "pair_distance": "mean distance of the mirror pairs [m]",
    "displacement": "mean distance of the second half from its place [m]",
    "hanging_near": "fraction of the towel that hangs on the -X side of the bar",
    "hanging_far": "the same on the +X side",
    "spread": "spread of the towel along the bar, 1 if it is as wide as when flat",
    "gates_passed": "fraction of the gates at pegs and clips that the rope passes",
    "poured": "fraction of the particles in the target cup and not in the moved cup",
    "share": "fraction that is to be poured",
    "sim_steps": "sim steps that the last action took",
    "ik_failures": "number of control steps in which the arm's controller found no joint "
    "velocities",
    "at_reach": "number of commanded points at the limit of their arm's reach",
}
# Keys of info that do not depend on the task, by what has them.
COMMON = {
    "all": ("performance", "normalized_performance", "success", "is_success", "variation",
            "physics_warnings", "diverged"),
    "cloth, rope": ("max_edge_strain", "episode_max_edge_strain", "max_speed", "picks_held",
                    "dropped", "yielded"),
    "pick and place": ("sim_steps",),
    "arms": ("ik_failures", "at_reach"),
}  # fmt: skip
_RATE = " per sim step"
# Entries of which a table has one row for all corners, grippers or arms.
_NUMBERED = re.compile(r"(?P<noun>corner|gripper|arm) (?P<number>p?\d)(?P<rest>.*)")


def actors_of(record: TaskRecord) -> dict[str, Task]:
    """The task with each actor that it can have, the usual one first."""
    return {actor: record.build(actor=actor) for actor in record.resolve().actors}


def own_keys(env: Environment) -> list[str]:
    """Keys of info that a task adds to the common ones, after a reset."""
    common = {key for keys in COMMON.values() for key in keys}
    return [key for key in env.info() if key not in common]


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
    lines = [f"| {' | '.join(map(str, row))} |".replace("|  |", "| |") for row in rows]
    return pages.table(f"| {' | '.join(header)} |", lines) + "\n"


def merged(entries: Mapping[str, int]) -> Iterator[tuple[str, str]]:
    """Indices and labels of entries: one row for what all corners, grippers or arms have."""
    spans: dict[tuple[str, str], list[range]] = {}
    numbers: dict[tuple[str, str], list[str]] = {}
    start = 0
    for label, size in entries.items():
        found = _NUMBERED.fullmatch(label)
        key = (found["noun"], found["rest"]) if found else (label, "")
        numbers.setdefault(key, []).append(found["number"] if found else "")
        own = spans.setdefault(key, [])
        first = own.pop().start if own and own[-1].stop == start else start
        start += size
        own.append(range(first, start))
    for (noun, rest), own in spans.items():
        label, indices = noun, (f"{i[0]} to {i[-1]}" if len(i) > 1 else str(i[0]) for i in own)
        match numbers[noun, rest]:
            case [""]:
                pass
            case [one]:
                label = f"{noun} {one}{rest}"
            case several:
                each = re.sub("^,", ":", rest).replace("(x, y, z)", "(x, y, z each)")
                label = f"{noun}s {', '.join(several)}{each}"
        yield ", ".join(indices), label


def action_table(entries: Iterable[tuple[str, str, str]]) -> str:
    """Table of the entries of an action: name, unit and range of each."""
    rates = (
        (name, unit + _RATE, ends.removesuffix(_RATE))
        if ends.endswith(_RATE)
        else (name, unit, ends)
        for name, unit, ends in entries
    )
    rows = merged({"\t".join(entry): 1 for entry in rates})
    cells = ((indices, *label.split("\t")) for indices, label in rows)
    return table(("index", "meaning", "unit", "range"), cells)


def entry_table(entries: Mapping[str, int]) -> str:
    """Table of the entries of a state; `entries` maps "name [unit]" to sizes."""
    cells = (
        (indices, *label.rstrip("]").partition(" [")[::2]) for indices, label in merged(entries)
    )
    return table(("index", "meaning", "unit"), cells)
