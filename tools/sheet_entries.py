"""What the entries of states and the keys of info mean, for the data sheets."""

import numpy as np

from softgym_mj.envs.environment import Environment
from softgym_mj.tasks import Task
from softgym_mj.tasks.shared.entries import labels

# What the keys of info mean; "reward_*" and "domain_*" are explained apart.
INFO = {
    "performance": "the task's metric",
    "normalized_performance": "the same, 0 at the lower and 1 at the upper bound",
    "success": "whether `normalized_performance` is at least the threshold above",
    "is_success": "the same by the name that Stable-Baselines3 reads",
    "variation": "index of the variation",
    "physics_warnings": "number of MuJoCo's warnings in this episode",
    "diverged": "whether the simulation diverged in the last env step, which ends the episode",
    "max_edge_strain": "largest elongation of an edge, as a share of its length",
    "episode_max_edge_strain": "largest `max_edge_strain` of the episode, its start included",
    "max_speed": "of the fastest vertex [m/s]; above 20 m/s a warning says so",
    "picks_held": "grippers that hold something",
    "dropped": "how often a gripper has let go in this episode",
    "yielded": "how often of these the hold gave way to a pull that was too hard",
    "normalized_coverage": "secondary: covered area over the flat cloth's (NC)",
    "normalized_improvement": "secondary: the same, 0 for what was covered at the start (NI)",
    "mean_corner_distance": "secondary: of the corners from their places, in top view [m]",
    "outline_iou": "secondary: intersection over union of what the cloth covers and ought to cover",
    "wrinkle_height": "secondary: of the highest point above where the upper layer belongs [m]",
    "mean_point_error": "secondary: mean distance of the vertices from their places [m]",
    "rejected_moves": "sim steps of the last env step in which the cup was not allowed to move",
    "end_point_distance": "distance of the two ends [m]",
    "initial_normalized_performance": "`normalized_performance` at reset",
    "distance_to_target": "distance of the cup from its goal [m]",
    "spilled": "fraction of the particles that are in no cup",
    "fraction_in_cup": "fraction of the particles in the box of the cup that is moved",
    "fraction_in_target": "fraction of the particles in the box of the target cup",
    "pair_distance": "mean distance of the pairs [m]",
    "displacement": "mean distance of the second half from its place [m]",
    "poured": "fraction of the particles in the target cup and not in the other",
    "share": "fraction that ought to be poured",
    "sim_steps": "sim steps that the last action took",
    "ik_failures": "control steps for which the arm's controller found no joint speeds",
    "at_reach": "commanded points that lie at the end of their arm's reach",
}


def ending_entries(task: Task) -> dict[str, int]:
    """What the actor senses of itself at the end of the full and the reduced state."""
    return task.actor.senses if task.actor.ends_states else {}


def reduced_entries(task: Task) -> dict[str, int]:
    """What the reduced state lists."""
    return sizes(labels(task.reduced(task.state(), task.episode))) | ending_entries(task)


def full_entries(env: Environment) -> dict[str, int]:
    """What the full state lists."""
    task, number = env.task, env.observation_spec()["full_mask"].shape[0]
    points = {f"{number} points (x, y, z each), zeros from the last that exists [m]": 3 * number}
    return (
        points | sizes(labels(task.extra_state(task.state(), task.episode))) | ending_entries(task)
    )


def sizes(arrays: dict[str, np.ndarray]) -> dict[str, int]:
    """How many numbers each array has."""
    return {name: np.size(array) for name, array in arrays.items()}
