"""The data sheets in docs/tasks: what a task is, read from the task itself.

`python -m tools.data_sheets` (`make sheets`) writes them, tests/docs/test_data_sheets.py compares.
"""

import inspect
import pathlib
import re
from collections.abc import Iterable, Iterator, Mapping, Sequence

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
    INFO,
    ending_entries,
    full_entries,
    reduced_entries,
)

FOLDER = pathlib.Path(__file__).parent.parent / "docs" / "tasks"
VARIATIONS = (800, 801)  # Two, so that what differs between variations can be told.

WRIST_SUMMARY = (
    f"with {' or '.join(f'`{name}`' for name in ARMS)}: uint8 images (arms, height, width, 3) from "
    "the cameras on their hands"
)
HELD_SUMMARY = "1 for each gripper that holds something, else 0"
GOAL_SUMMARY = "uint8 image (height, width, 3): `rgb` with the goal reached"
_LABELS = ("Goal", "Reward", "Bounds", "Reduced state", "Full state", "Start", "End")


def table(header: Sequence[str], rows: Iterable[Sequence[object]]) -> str:
    """A Markdown table."""
    lines = [header, ["---"] * len(header), *rows]
    return "\n".join("| " + " | ".join(map(str, line)) + " |" for line in lines) + "\n"


def numbers(*values: float, digits: int = 4) -> str:
    """Numbers with no more digits than they need, without a negative zero."""
    return ", ".join(f"{round(float(value), digits) + 0.0:g}" for value in values)


def actors_of(record: TaskRecord) -> dict[str, Task]:
    """The task with each actor that it can have, the usual one first."""
    return {actor: record.build(actor=actor) for actor in record.resolve().actors}


# ---------------------------------------------------------------------- actions


def actions(env: Environment, tasks: dict[str, Task], record: TaskRecord) -> Iterator[str]:
    """The actors, then their actions; actors with the same entries share a table."""
    yield table(
        ("actor", "entries", "env steps", "sim steps in an env step"),
        (
            (
                f"`{name}`",
                task.actor.action_size,
                task.actor.horizon or record.horizon,
                "as many as it takes" if task.actor.horizon else task.action_repeat,
            )
            for name, task in tasks.items()
        ),
    )
    if isinstance(env.task.actor, Gripper):
        low, high = env.task.actor.limits
        yield (
            f"A gripper is a picker or the hand of an arm. The workspace of a picker's centre is "
            f"{numbers(high[0] - low[0])} m long (X), {numbers(high[1] - low[1])} m wide (Y) and "
            f"reaches from Z = {numbers(low[2])} to {numbers(high[2])} m. These are the actions of "
            'arms with `action="position"`; with `"pose"` hands turn, too, with `"joints"` their '
            "joints are told what to do ([entries](../robots.md#actions)).\n"
        )
    groups: dict[tuple, list[str]] = {}
    for name, task in tasks.items():
        groups.setdefault(task.actor.actions.entries, []).append(f"`{name}`")
    for entries, names in groups.items():
        yield f"### {', '.join(names)}\n"
        yield table(
            ("entry", "what", "unit", "range", "scale"),
            ((i, name, unit, "-1 to 1", scale) for i, (name, unit, scale) in enumerate(entries)),
        )


# ---------------------------------------------------------------------- observations


def entry_table(entries: Mapping[str, int], start: int = 0) -> str:
    """Which entries of a state are what, from index `start`: numbers by what they are [unit]."""
    rows = []
    for label, number in entries.items():
        end = start + number - 1
        name, _, unit = label.rstrip("]").partition(" [")
        rows.append((start if end == start else f"{start} to {end}", name, unit))
        start = end + 1
    return table(("entries", "what", "unit"), rows)


def observations(
    env: Environment, arms: Environment, tasks: Mapping[str, Task], remarks: Sequence[str]
) -> Iterator[str]:
    """All observations, then the entries of the states; arms that sense the same share a table."""
    task, spec = env.task, env.observation_spec()
    further = {HELD: HELD_SUMMARY, GOAL_RGB: GOAL_SUMMARY, WRIST_RGB: WRIST_SUMMARY}
    summaries = {**OBSERVATIONS, **further}
    shown = {**spec, WRIST_RGB: arms.observation_spec()[WRIST_RGB]}
    yield table(
        ("observation", "shape", "dtype in dm_env", "in Gymnasium", "what"),
        (
            (f"`{name}`", s.shape, s.dtype, space_of(s).dtype, summaries[name])
            for name, s in shown.items()
        ),
    )
    yield "### `reduced`\n"
    yield entry_table(reduced_entries(task))
    yield from remarks
    yield "### `markov`\n"
    yield "The entries of `reduced`, then:\n"
    yield entry_table(task.actor.remembers, sum(reduced_entries(task).values()))
    yield "With arms, after their `reduced`:\n"
    yield entry_table(arms.task.actor.remembers, sum(reduced_entries(arms.task).values()))
    yield "### `full`\n"
    yield entry_table(full_entries(env))
    yield "### `proprioception`\n"
    yield entry_table(task.actor.senses)
    number = sum(ending_entries(task).values())
    reduced, full = (spec[name].shape[0] - number for name in ("reduced", "full"))
    groups: dict[tuple, list[str]] = {}
    for name in ARMS:
        groups.setdefault(tuple(tasks[name].actor.senses.items()), []).append(f"`{name}`")
    for senses, names in groups.items():
        yield (
            f"With {' or '.join(names)}; from entry {reduced} of `reduced` and {full} of `full` "
            "on, the same:\n"
        )
        yield entry_table(dict(senses))


# ---------------------------------------------------------------------- the rest


def paragraphs(record: TaskRecord) -> dict[str, list[str]]:
    """The docstring of the task's module as Markdown paragraphs by their label."""
    module = inspect.getmodule(record.resolve())
    text = re.sub(r" \(facts [^)]*\)", "", inspect.getdoc(module) or "")
    start = rf"\n(?=(?:{'|'.join(_LABELS)})\b)|\n\n|(?<=\.) (?=End:)"
    found: dict[str, list[str]] = {}
    for paragraph in re.split(start, text):
        match = re.match("|".join(_LABELS), paragraph)
        label = match.group() if match else ""
        marked = f"**{label}**{paragraph[len(label) :]}" if label else paragraph
        found.setdefault(label, []).append(marked.strip() + "\n")
    return found


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
        return " and ".join(
            f"{value:.4g} in variation {variation}"
            for value, variation in zip((a, b), VARIATIONS, strict=True)
        )

    lower, upper = (said(a, b) for a, b in zip(one, other, strict=True))
    return lower, upper


def cameras(env: Environment, arms: Environment) -> str:
    """The cameras of the compiled models."""
    rows = []
    for label, each in (("", env), (" (with arms)", arms)):
        model = each.physics.model.ptr
        for name in ("task", "overview", *EXTERNAL):
            camera = model.camera(name)
            place, turn = numbers(*camera.pos), numbers(*camera.quat)
            rows.append((f"`{name}`{label}", place, turn, numbers(*camera.fovy)))
    for name in arms.task.actor.wrists:
        angle = numbers(*model.cam_fovy[[camera_ids(model)[name]]])
        rows.append((f"`{name}` (with arms)", "on the hand of the arm", "moves with it", angle))
    return table(
        ("camera", "position [m]", "quaternion (w, x, y, z)", "vertical field of view [deg]"), rows
    )


def domain(task: Task) -> str:
    """The domain parameters."""
    rows = [
        (
            f"`{p.name}`", p.kind, p.unit, f"{p.nominal:.3g}",
            *(f"{low:.3g} to {high:.3g}" for low, high in (p.usual, p.valid)), p.summary,
        )
        for p in task.domain.parameters
    ]  # fmt: skip
    return table(("parameter", "kind", "unit", "nominal", "usual", "valid", "what it is"), rows)


def info(env: Environment, tasks: dict[str, Task], record: TaskRecord) -> str:
    """The keys of info."""
    rows = []
    for key in env.info():
        rows.append((f"`{key}`", "term of the reward" if key.startswith("reward_") else INFO[key]))
    own: dict[str, list[str]] = {}  # What only some actors tell.
    for name, task in tasks.items():
        for key in task.actor.diagnostics():
            if key not in env.info():
                own.setdefault(key, []).append(f"`{name}`")
    rows += [(f"`{key}`", f"with {', '.join(names)}: {INFO[key]}") for key, names in own.items()]
    if "count_intersections" in record.arguments:
        meaning = "with `count_intersections=True`: where the cloth passes through itself"
        rows.append(("`intersections`", meaning))
    rows.append(("`cameras`", "in Gymnasium, with images: [calibration](../arguments.md#cameras)"))
    rows.append(("`domain_*`", "value of each domain parameter that varies"))
    return table(("key", "what"), rows)


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
        ("", ""),
        (
            ("name", f"`{name}`"),
            ("Gymnasium id", f"`{record.gymnasium_id}`"),
            ("kind", ", ".join(record.tags)),
            ("horizon", f"{record.horizon} env steps"),
            ("action repeat", f"{task.action_repeat} sim steps of 0.01 s in an env step"),
            ("physics step", f"{env.physics.timestep():g} s"),
            ("performance that counts as 0", lower),
            ("performance that counts as 1", upper),
            ("success from", f"{task.success:g} (normalised)"),
        ),
    )
    splits = ", ".join(f"`{key}` {part[0]} to {part[-1]}" for key, part in SPLITS.items())
    parts = [
        f"# {name}\n",
        f"{record.summary}\n",
        f"![The scripted expert](../videos/{name}.webp)\n",
        facts,
        "## Goal and reward\n",
        *(line for label in ("", "Goal", "Reward", "Bounds", "End") for line in text[label]),
        "## Actions\n",
        *actions(env, tasks, record),
        "## Observations\n",
        *observations(env, arms, tasks, text["Reduced state"]),
        "## Variations\n",
        f"Indices of the splits: {splits}.\n",
        *text["Start"],
        "## Domain parameters\n",
        domain(task),
        "## Cameras\n",
        cameras(env, arms),
        "## info\n",
        info(env, tasks, record),
    ]
    return "\n".join(parts)


def main() -> None:
    """Writes all sheets."""
    FOLDER.mkdir(exist_ok=True)
    for name in TASKS:
        (FOLDER / f"{name}.md").write_text(sheet(name))


if __name__ == "__main__":
    main()
