"""The data sheets in docs/tasks, and docs/interface.md, the page of what they share.

Both are read from the tasks: `python -m tools.data_sheets` (`make sheets`) writes them, and
tests/docs/test_data_sheets.py compares.
"""

import inspect
import json
import pathlib
import re
import statistics
import textwrap
from collections.abc import Mapping

from softgym_mj.envs.environment import Environment
from softgym_mj.envs.load import load
from softgym_mj.registry import TASKS, TaskRecord
from softgym_mj.robots.arm.grasps import PICK_DISTANCE
from softgym_mj.robots.arm.models import ARMS
from softgym_mj.robots.gripper import Gripper
from softgym_mj.robots.picker import Picker
from softgym_mj.tasks import Task
from softgym_mj.tasks.shared.observations import STATES
from softgym_mj.variations.indices import SPLITS
from tools import interface_page
from tools.sheet_entries import (
    action_table,
    actors_of,
    entry_table,
    full_entries,
    own_keys,
    reduced_entries,
    table,
)

FOLDER = pathlib.Path(__file__).parent.parent / "docs" / "tasks"
EXPERTS = FOLDER.parent / "experts.json"
VARIATION = 800

SCALED = "Entries in [-1, 1] are scaled to the range; arms have the same by default:\n"
_LABELS = ("Goal", "Actions", "Observations", "Reward", "Bounds", "Horizon", "Start")
# What the docstrings repeat of the sheet's tables, and references that other pages have.
_ELSEWHERE = (
    r"\s*\(docs/softgym.md [^)]*\)",
    r"`OBSERVATIONS`\s+of\s+`tasks\.shared\.observations`\s+lists\s+the\s+others\.",
    r"\d+ env steps of \d+ sim steps; nothing else\s+ends an episode\.",
    r"`(?:reduced|full)`[\s\S]*?\.(?=\s+[A-Z`]|\s*$)",
    r"^:?\s*dx\b[\s\S]*?\.(?=\s+[A-Z])",
)


def numbers(*values: float, digits: int = 3) -> str:
    """Numbers with no more digits than they need, without a negative zero."""
    return ", ".join(f"{round(float(value), digits) + 0.0:g}" for value in values)


def _own(paragraph: str) -> str:
    """A paragraph of a docstring without what is elsewhere."""
    for pattern in _ELSEWHERE:
        paragraph = re.sub(pattern, "", paragraph)
    return paragraph.removeprefix(":").strip()


def paragraphs(record: TaskRecord) -> dict[str, str]:
    """Paragraphs of the docstring of the task's class, by their label, as Markdown."""
    whole = inspect.getdoc(record.resolve()) or ""
    _, *parts = re.split(rf"^({'|'.join(_LABELS)})\b", whole, flags=re.MULTILINE)
    found = {}
    for label, body in zip(parts[::2], map(_own, parts[1::2]), strict=True):
        text = body[:1].upper() + body[1:]
        if label in ("Goal", "Reward", "Bounds"):
            text = f"**{label}**{'' if body.startswith('=') else ':'} {body}"
        found[label] = textwrap.fill(text, 120) + "\n" if body else ""
    return found


def expert(scores: Mapping[str, float], threshold: float) -> str:
    """Mean, smallest score and success rate of the scripted expert."""
    values = list(scores.values())
    success = statistics.mean(value >= threshold for value in values)
    mean = statistics.mean(values)
    number = "" if len(values) == len(SPLITS["evaluate"]) else f", {len(values)} variations"
    return (
        f"mean {mean:.3f}, smallest {min(values):.2f}, success {success:.2f}{number} "
        "([arms](../validation.md#scripted-experts))"
    )


def actors(tasks: Mapping[str, Task], horizon: int) -> str:
    """Table of the actors of a task: sizes of actions, horizons."""
    groups: dict[tuple, list[str]] = {}
    for name, task in tasks.items():
        steps = "until the motion ends" if task.actor.horizon else task.action_repeat
        row = task.actor.action_size, task.actor.horizon or horizon, steps
        groups.setdefault(row, []).append(f"`{name}`")
    return table(
        ("actor", "[entries](../interface.md#actions)", "env steps", "sim steps each"),
        ((", ".join(names), *row) for row, names in groups.items()),
    )


def workspace(actor: Picker) -> str:
    """The box of a picker's center and the grasp distances."""
    low, high = actor.limits
    hand = "[with hands](../custom_tasks.md#writing-an-expert)"
    sentences = (
        f"Workspace of a picker's center: {numbers(high[0] - low[0])} m along X, "
        f"{numbers(high[1] - low[1])} m along Y, Z from {numbers(low[2])} to "
        f"{numbers(high[2])} m. A closed picker that holds nothing grasps the nearest vertex "
        f"within {numbers(actor.pick_distance, digits=5)} m of its center ({hand}: "
        f"{PICK_DISTANCE:g} m)."
    )
    return textwrap.fill(sentences, 120, break_on_hyphens=False) + "\n"


def camera(env: Environment, arms: Environment) -> str:
    """Pose of the camera of `rgb`, with and without arms."""
    usual, other = (each.physics.model.ptr.camera("task") for each in (env, arms))
    own, with_arms = (
        f"({numbers(*camera.pos)}) m, quaternion ({numbers(*camera.quat, digits=4)})"
        for camera in (usual, other)
    )
    return (
        f"[Camera](../arguments.md#cameras) of `rgb`: vertical field of view "
        f"{numbers(*usual.fovy)} degrees, at {own}; with arms at {with_arms}.\n"
    )


def info(env: Environment) -> str:
    """The keys of info that the task adds to those of all tasks: terms of the reward, others."""
    keys: tuple[list[str], list[str]] = [], []
    for key in own_keys(env):
        keys[not key.startswith("reward_")].append(f"`{key}`")
    terms, others = map(", ".join, keys)
    more = f" [Keys of info](../interface.md#info): {others}." if others else ""
    return f"Terms of the reward: {terms}.{more}\n"


def sheet(name: str) -> str:
    """The data sheet of a task as Markdown.

    Args:
        name: of the task, one of `TASKS`.
    """
    record = TASKS[name]
    tasks = actors_of(record)
    env = load(name, observation=tuple(STATES))
    arms = load(name, actor=next(actor for actor in tasks if actor in ARMS))
    env.reset(VARIATION)
    text, task = paragraphs(record), env.task
    scores = json.loads(EXPERTS.read_text())
    facts = {
        "Gymnasium id": f"`{record.gymnasium_id}`",
        "level": record.tags[0],
        "material": ", ".join(record.tags[1:]),
        "success": f"normalized performance of at least {task.success:g}",
        "scripted expert": expert(scores[name]["default"]["scores"], task.success)
        if name in scores
        else "not yet played",
    }
    sizes = (f"`{key}` {spec.shape[0]}" for key, spec in env.observation_spec().items())
    parts = [
        f"# {name}\n",
        f"{record.summary} Symbols and keys: [Observations, actions and info](../interface.md).\n",
        f"![The scripted expert](../videos/{name}.webp)\n",
        table(("property", "value"), facts.items()),
        "## Goal and reward\n",
        *(text[label] for label in ("Goal", "Reward", "Bounds")),
        "## Start\n",
        text["Start"],
        "## Actions\n",
        SCALED,
        action_table(task.actor.actions.entries),
        "" if isinstance(task.actor, Gripper) else text["Actions"],
        actors(tasks, record.horizon),
        text["Horizon"],
        workspace(task.actor) if isinstance(task.actor, Picker) else "",
        "## Observations\n",
        f"Sizes of [observations](../interface.md#observations): {', '.join(sizes)}. `reduced`, "
        "the default:\n",
        entry_table(reduced_entries(task)),
        "`full`:\n",
        entry_table(full_entries(env)),
        text["Observations"],
        camera(env, arms),
        info(env),
    ]
    return "\n".join(part for part in parts if part)


def main() -> None:
    """Writes all sheets and the page of what they share."""
    FOLDER.mkdir(exist_ok=True)
    for name in TASKS:
        (FOLDER / f"{name}.md").write_text(sheet(name))
    interface_page.FILE.write_text(interface_page.page())


if __name__ == "__main__":
    main()
