"""The page docs/interface.md: what all tasks have in common, read from the tasks."""

import math
import pathlib
from collections.abc import Iterator

from softgym_mj.envs.load import load
from softgym_mj.registry import TASKS
from softgym_mj.rendering.observables import WRIST_RGB
from softgym_mj.robots.base import SIM_STEP
from softgym_mj.robots.gripper import HELD
from softgym_mj.robots.pick_and_place import PixelPickAndPlace
from softgym_mj.tasks import Task
from softgym_mj.tasks.shared.observations import GOAL_RGB, OBSERVATIONS
from tools.sheet_entries import COMMON, INFO, action_table, actors_of, entry_table, own_keys, table

FILE = pathlib.Path(__file__).parent.parent / "docs" / "interface.md"
INTRODUCTION = """# Observations, actions and info

The [data sheets](tasks/fold_cloth.md) list what differs between tasks. Their sizes are those of
`fidelity="default"` and two grippers; [arguments](arguments.md) change them. The physics step is
0.01 s; positions are in meters in the world frame, quaternions (w, x, y, z). Variations 0 to 799
train, 800 to 999 evaluate. An episode ends after its horizon, or [earlier if the simulation
diverges](arguments.md#how-episodes-end). Sides of a cloth are counted in SoftGym's particles, rho =
0.00625 m apart: dimx columns along X, dimy rows. Its corners are p1 and p2 (first and last row) of
column 0, p3 and p4 of the last column.
"""
ACTIONS = """All entries are in [-1, 1] and scaled to their range. A gripper is a picker or the hand
of an arm. The [data sheets](tasks/fold_cloth.md#actions) list the actions of pickers and cups. Arms
have the same actions with `action="position"`, and [others](robots.md#actions) with `"pose"` and
`"joints"`. Those of pick and place:
"""
SIZES = "Sizes of actions and states, and the length of an episode, with the tasks' defaults:\n"
STATE_SIZES = "reduced", "markov", "key_points", "full"
STATES = "States are float64 in dm_env and float32 in Gymnasium.\n"
PROPRIOCEPTION = """`reduced` and `full` end with these entries, except for the actor `cup`.
`pixel_pick_and_place` has those of gripper 0 of `picker`, also in `markov`. Of the quaternions q
and -q of a tool, the one nearer to its orientation at home is observed: entries do not jump.
"""
MARKOV = """`markov` is `reduced`, then the actor's internal state. Indices count from the first
entry after `reduced`. The tables of arms are for `action="position"`. With `"pose"` the commanded
quaternion (w, x, y, z) of each tool follows; with `"joints"` the commanded joint positions [rad] of
each arm replace the commanded points.
"""
OTHERS = """`cameras` (Gymnasium, with images) is the [calibration](arguments.md#cameras),
`domain_*` the value of each [domain parameter](domain.md#parameters) that varies, `intersections`
the number of self-intersections (`count_intersections=True`), `reward_*` a term of the reward
(the reward is their sum). *Secondary* metrics are not part of the reward, such as metrics of other
work; `softgym-mj evaluate` reports them.
"""
SUMMARIES = {
    **OBSERVATIONS,
    HELD: "cloth, rope: uint8 (grippers,), 1 for each that holds something, else 0",
    GOAL_RGB: "`rope_configuration`: uint8 image (height, width, 3), `rgb` with the goal reached",
    WRIST_RGB: "with arms: uint8 images (arms, height, width, 3) from the cameras on their hands",
}
KINDS = {
    kind: {n for n, r in TASKS.items() if kind in r.tags} for kind in ("cloth", "rope", "water")
}


def named(tasks: set[str]) -> str:
    """Tasks by the materials of which they are all the tasks, otherwise by their names."""
    kinds = {kind: own for kind, own in KINDS.items() if own <= tasks}
    names = sorted(tasks.difference(*kinds.values()))
    return ", ".join([*kinds, *(f"`{name}`" for name in names)])


def actor_tables(part: str) -> Iterator[str]:
    """Tables of "actions", "proprioception" or "markov": one for all actors of the same entries.

    Actions of a task's usual actor are on its data sheet; `PROPRIOCEPTION` describes those of one
    picker.
    """
    groups: dict[tuple, dict[str, set[str]]] = {}
    for name, record in TASKS.items():
        actors = {actor: _entries(part, task) for actor, task in actors_of(record).items()}
        usual = next(iter(actors.values())) if part == "actions" else None
        for actor, entries in actors.items():
            if entries != usual and (part == "actions" or actor != PixelPickAndPlace.name):
                groups.setdefault(entries, {}).setdefault(f"`{actor}`", set()).add(name)
    for entries, actors in groups.items():
        tasks = set().union(*actors.values())
        yield f"{', '.join(actors)} ({named(tasks)}):\n"
        yield action_table(entries) if part == "actions" else entry_table(dict(entries))


def _entries(part: str, task: Task) -> tuple:
    """Entries of an actor's actions, measurements or memory."""
    actor = task.actor
    if part == "actions":
        return actor.actions.entries
    return tuple((actor.senses if part == "proprioception" else actor.remembers).items())


def sizes() -> str:
    """Table of the tasks' sizes of actions and states, and of their episodes."""
    rows = []
    for name in TASKS:
        env = load(name, observation=list(STATE_SIZES))
        spec = env.observation_spec()
        states = (math.prod(spec[state].shape) for state in STATE_SIZES)
        actions, repeat = math.prod(env.action_spec().shape), env.task.action_repeat
        seconds = f"{env.horizon * repeat * SIM_STEP:g}"
        rows.append((f"`{name}`", *map(str, (actions, *states, env.horizon, repeat)), seconds))
    titles = ("task", "actions", *(f"`{state}`" for state in STATE_SIZES))
    return table((*titles, "env steps", "`action_repeat`", "seconds"), rows)


def info() -> str:
    """Table of the keys of info and of what has them."""
    owners: dict[str, set[str]] = {}
    for name in TASKS:
        env = load(name)
        env.reset(0)
        for key in own_keys(env):
            if not key.startswith("reward_"):
                owners.setdefault(key, set()).add(name)
    common = [(key, where) for where, keys in COMMON.items() for key in keys]
    own = [(key, named(tasks)) for key, tasks in owners.items()]
    return table(
        ("key", "in", "what"), ((f"`{key}`", where, INFO[key]) for key, where in common + own)
    )


def page() -> str:
    """The page of what all tasks have in common."""
    summaries = ((f"`{name}`", what) for name, what in SUMMARIES.items())
    parts = [
        INTRODUCTION,
        "## Sizes\n",
        SIZES,
        sizes(),
        "## Actions\n",
        ACTIONS,
        *actor_tables("actions"),
        "## Observations\n",
        STATES,
        table(("observation", "what"), summaries),
        "### `proprioception`\n",
        PROPRIOCEPTION,
        *actor_tables("proprioception"),
        "### `markov`\n",
        MARKOV,
        *actor_tables("markov"),
        "## info\n",
        info(),
        OTHERS,
    ]
    return "\n".join(parts)
