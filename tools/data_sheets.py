"""The data sheets in docs/tasks, and what they have in common in docs/interface.md.

Both are read from the tasks: `python -m tools.data_sheets` (`make sheets`) writes them, and
tests/docs/test_data_sheets.py compares.
"""

import inspect
import pathlib
import re
from collections.abc import Iterator

from softgym_mj.envs.environment import Environment
from softgym_mj.envs.gymnasium_env import space_of
from softgym_mj.envs.load import load
from softgym_mj.registry import TASKS, TaskRecord
from softgym_mj.rendering.observables import EXTERNAL, WRIST_RGB
from softgym_mj.rendering.offscreen import camera_ids
from softgym_mj.robots.arm.models import ARMS
from softgym_mj.robots.gripper import HELD, Gripper
from softgym_mj.tasks import Task
from softgym_mj.tasks.shared.observations import GOAL_RGB, OBSERVATIONS
from softgym_mj.variations.indices import SPLITS
from tools.sheet_entries import (
    COMMON,
    INFO,
    ending_entries,
    entry_table,
    full_entries,
    reduced_entries,
    table,
)

FOLDER = pathlib.Path(__file__).parent.parent / "docs" / "tasks"
INTERFACE = FOLDER.parent / "interface.md"
VARIATIONS = (800, 801)  # Two, to detect what differs between variations.

WRIST_SUMMARY = "with arms: uint8 images (arms, height, width, 3) from the cameras on their hands"
HELD_SUMMARY = "cloth, rope: 1 for each gripper that holds something, else 0"
GOAL_SUMMARY = "`rope_configuration`: uint8 image (height, width, 3), `rgb` with the goal reached"
_LABELS = ("Goal", "Actions", "Observations", "Reward", "Bounds", "Horizon", "Start")


def numbers(*values: float, digits: int = 4) -> str:
    """Numbers with no more digits than they need, without a negative zero."""
    return ", ".join(f"{round(float(value), digits) + 0.0:g}" for value in values)


def actors_of(record: TaskRecord) -> dict[str, Task]:
    """The task with each actor that it can have, the usual one first."""
    return {actor: record.build(actor=actor) for actor in record.resolve().actors}


# ---------------------------------------------------------------------- actions, observations


def actions(env: Environment, tasks: dict[str, Task], record: TaskRecord) -> Iterator[str]:
    """The actors of a task: sizes of actions, horizons."""
    yield table(
        ("actor", "entries", "env steps", "sim steps per env step"),
        (
            (
                f"`{name}`",
                task.actor.action_size,
                task.actor.horizon or record.horizon,
                "until the motion ends" if task.actor.horizon else task.action_repeat,
            )
            for name, task in tasks.items()
        ),
    )
    yield "[Entries of the actions](../interface.md#actions).\n"
    if isinstance(env.task.actor, Gripper):
        low, high = env.task.actor.limits
        yield (
            f"Workspace of a picker's center: {numbers(high[0] - low[0])} m along X, "
            f"{numbers(high[1] - low[1])} m along Y, Z from {numbers(low[2])} to "
            f"{numbers(high[2])} m.\n"
        )


def observations(env: Environment, arms: Environment) -> Iterator[str]:
    """Shapes of all observations, then the entries of the states."""
    task, spec = env.task, env.observation_spec()
    shown = {**spec, WRIST_RGB: arms.observation_spec()[WRIST_RGB]}
    yield "[What each observation is](../interface.md#observations).\n"
    yield table(
        ("observation", "shape", "dtype in dm_env", "in Gymnasium"),
        ((f"`{name}`", s.shape, s.dtype, space_of(s).dtype) for name, s in shown.items()),
    )
    yield "### `reduced`\n"
    yield entry_table(reduced_entries(task))
    yield "### `full`\n"
    yield entry_table(full_entries(env))
    yield "### `markov` and arms\n"
    number = sum(ending_entries(task).values())
    reduced, full = (spec[name].shape[0] - number for name in ("reduced", "full"))
    yield (
        "`markov` appends the [actor's memory](../interface.md#markov) to `reduced`, from entry "
        f"{spec['reduced'].shape[0]} on. With arms, "
        "[`proprioception`](../interface.md#proprioception) replaces the last entries of both "
        f"states, from entry {reduced} of `reduced` and {full} of `full` on.\n"
    )


def interface() -> str:
    """The page of what all tasks have in common: entries of actions, observations and info."""
    groups: dict[str, dict[tuple, dict[str, set[str]]]] = {
        "actions": {}, "proprioception": {}, "markov": {},
    }  # fmt: skip
    for name, record in TASKS.items():
        kind = "water" if "water" in record.tags else "cloth, rope"
        for actor, task in actors_of(record).items():
            for part, entries in (
                ("actions", task.actor.actions.entries),
                ("proprioception", tuple(task.actor.senses.items())),
                ("markov", tuple(task.actor.remembers.items())),
            ):
                own = groups[part].setdefault(entries, {})
                own.setdefault(f"`{actor}`", set()).add(kind if part != "actions" else name)

    def of(part: str) -> Iterator[str]:
        for entries, actors in groups[part].items():
            water = all("water" in name for names in actors.values() for name in names)
            kind = "water" if water else "cloth, rope"
            if part == "actions" and water:
                kind = ", ".join(f"`{name}`" for name in sorted(set().union(*actors.values())))
            yield f"{', '.join(actors)} ({kind}):\n"
            if part == "actions":
                rows = ((i, name, unit, scale) for i, (name, unit, scale) in enumerate(entries))
                yield table(("entry", "what", "unit", "scale"), rows)
            else:
                yield entry_table(dict(entries))

    summaries = {
        **OBSERVATIONS,
        HELD: HELD_SUMMARY,
        GOAL_RGB: GOAL_SUMMARY,
        WRIST_RGB: WRIST_SUMMARY,
    }
    common = [(f"`{key}`", where, INFO[key]) for where, keys in COMMON.items() for key in keys]
    parts = [
        "# Entries of actions, observations and info\n",
        "The [data sheets](tasks/fold_cloth.md) list what differs between tasks.\n",
        "## Actions\n",
        "All entries range from -1 to 1. A gripper is a picker or the hand of an arm. Arms have "
        'these actions with `action="position"`; `"pose"` and `"joints"` have '
        "[others](robots.md#actions).\n",
        *of("actions"),
        "## Observations\n",
        table(("observation", "what"), ((f"`{name}`", what) for name, what in summaries.items())),
        "### `proprioception`\n",
        *of("proprioception"),
        "### `markov`\n",
        "Memory of the actor, after the entries of `reduced`:\n",
        *of("markov"),
        "## info\n",
        table(("key", "in", "what"), common),
        "`cameras` (Gymnasium, with images) is the [calibration](arguments.md#cameras), `domain_*` "
        "the value of each domain parameter that varies, `intersections` the number of "
        "self-intersections (`count_intersections=True`), `reward_*` a term of the reward.\n",
    ]
    return "\n".join(parts)


# ---------------------------------------------------------------------- the rest


def paragraphs(record: TaskRecord) -> dict[str, str]:
    """The docstring of the task's class as Markdown paragraphs by their label."""
    text = re.sub(r"\s+\(docs/softgym.md [^)]*\)", "", inspect.getdoc(record.resolve()) or "")
    text = re.sub(r"\s+docs/interface\.md\s+lists\s+the\s+others\.", "", text)
    _, *parts = re.split(rf"^({'|'.join(_LABELS)})\b", text, flags=re.MULTILINE)
    return {
        label: (
            paragraph[2].upper() + paragraph[3:].rstrip() + "\n"
            if label in ("Actions", "Observations")  # Headings of the page.
            else f"**{label}**{paragraph.rstrip()}\n"
        )
        for label, paragraph in zip(parts[::2], parts[1::2], strict=True)
    }


def bounds(env: Environment) -> tuple[str, str]:
    """Lower and upper bound of the performance, in words where they depend on the variation."""
    seen = []
    for variation in VARIATIONS:
        env.reset(variation)
        episode = env.task.episode
        seen.append((episode.initial_performance, *env.task.bounds(episode)))
    (first, *one), (second, *other) = seen

    def said(a: float, b: float) -> str:
        if a == b:
            return f"{a + 0.0:g}"
        if (a, b) == (first, second):
            return "the performance at reset"
        return "a value of the variation: " + ", ".join(
            f"{value:.4g} in {variation}"
            for value, variation in zip((a, b), VARIATIONS, strict=True)
        )

    lower, upper = (said(a, b) for a, b in zip(one, other, strict=True))
    return lower, upper


def cameras(env: Environment, arms: Environment) -> str:
    """The cameras of the compiled models; with arms where they differ."""
    rows: list[tuple[str, ...]] = []
    for name in ("task", "overview", *EXTERNAL):
        seen = []
        for label, each in (("", env), (" (with arms)", arms)):
            camera = each.physics.model.ptr.camera(name)
            seen.append((f"`{name}`{label}", numbers(*camera.pos), numbers(*camera.quat),
                         numbers(*camera.fovy)))  # fmt: skip
        rows += seen if seen[0][1:] != seen[1][1:] else seen[:1]
    model = arms.physics.model.ptr
    for name in arms.task.actor.wrists:
        angle = numbers(*model.cam_fovy[[camera_ids(model)[name]]])
        rows.append((f"`{name}`", "on the hand of the arm", "moves with it", angle))
    return table(
        ("camera", "position [m]", "quaternion (w, x, y, z)", "vertical field of view [deg]"), rows
    )


def info(env: Environment, tasks: dict[str, Task]) -> str:
    """The keys of info that the task adds to the common ones."""
    common = {key for keys in COMMON.values() for key in keys}
    keys = [key for key in env.info() if key not in common]
    terms = [f"`{key}`" for key in keys if key.startswith("reward_")]
    rows = [(f"`{key}`", INFO[key]) for key in keys if not key.startswith("reward_")]
    listed = f"Terms of the reward: {', '.join(terms)}.\n\n" if terms else ""
    return listed + table(("key", "what"), rows)


def sheet(name: str) -> str:
    """The data sheet of a task as Markdown.

    Args:
        name: of the task, one of `TASKS`.
    """
    record = TASKS[name]
    tasks = actors_of(record)
    usual, arm = next(iter(tasks)), next(actor for actor in tasks if actor in ARMS)
    own = [seen for seen in (HELD, GOAL_RGB) if seen in tasks[usual].task_observables]
    env = load(name, observation=(*OBSERVATIONS, *own))
    arms = load(name, actor=arm, observation=("reduced", WRIST_RGB))
    lower, upper = bounds(env)
    text, task = paragraphs(record), env.task
    facts = table(
        ("property", "value"),
        (
            ("name", f"`{name}`"),
            ("Gymnasium id", f"`{record.gymnasium_id}`"),
            ("kind", ", ".join(record.tags)),
            ("horizon", f"{record.horizon} env steps"),
            ("action repeat", f"{task.action_repeat} sim steps of 0.01 s"),
            ("physics step", f"{env.physics.timestep():g} s"),
            ("normalized performance 0 at", lower),
            ("normalized performance 1 at", upper),
            ("success from", f"{task.success:g} (normalized)"),
        ),
    )
    splits = ", ".join(f"`{key}` {part[0]} to {part[-1]}" for key, part in SPLITS.items())
    parts = [
        f"# {name}\n",
        f"{record.summary}\n",
        f"![The scripted expert](../videos/{name}.webp)\n",
        facts,
        "## Goal and reward\n",
        *(text[label] for label in ("Goal", "Reward", "Bounds", "Horizon")),
        "## Actions\n",
        text["Actions"],
        *actions(env, tasks, record),
        "## Observations\n",
        text["Observations"],
        *observations(env, arms),
        "## Variations\n",
        f"Variations by split: {splits}.\n",
        text["Start"],
        "[Domain parameters](../domain.md#parameters).\n",
        "## Cameras\n",
        cameras(env, arms),
        "## info\n",
        "Besides the [common keys](../interface.md#info):\n",
        info(env, tasks),
    ]
    return "\n".join(parts)


def main() -> None:
    """Writes all sheets."""
    FOLDER.mkdir(exist_ok=True)
    for name in TASKS:
        (FOLDER / f"{name}.md").write_text(sheet(name))
    INTERFACE.write_text(interface())


if __name__ == "__main__":
    main()
