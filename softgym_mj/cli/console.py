"""Shared parts of the commands: the terminal, progress bars, common arguments."""

import json
import pathlib
import re
from typing import Annotated, Any

import rich.console
import rich.progress
import typer

from softgym_mj.exceptions import InvalidArgumentError
from softgym_mj.policies.exported import FILES, has_images, observes
from softgym_mj.registry import TASKS, TaskRecord
from softgym_mj.rendering.look import LOOKS, PAPER
from softgym_mj.variations.indices import evaluation_variations

# Without markup: much of the text comes from users.
console = rich.console.Console(markup=False, emoji=False)

Task = Annotated[
    str,
    typer.Argument(
        help="Task name, see `softgym-mj list`; MODULE:NAME for a custom task that MODULE "
        "(installed or in the current folder) registers on import.",
        autocompletion=lambda incomplete: [name for name in TASKS if name.startswith(incomplete)],
    ),
]
Actor = Annotated[
    str | None, typer.Option(help="Actor, such as picker or franka; default: the task's own.")
]
Grasp = Annotated[
    str | None, typer.Option(help="Grasp of arms: attach or friction; default: the task's own.")
]
Look = Annotated[
    str | None, typer.Option(help=f"Rendering quality: {' or '.join(LOOKS)} (slower, for videos).")
]
Trust = Annotated[
    bool,
    typer.Option("--trust", help="Load FILE.pt2 although it can run any code: trust its author."),
]
TaskSettings = Annotated[
    str,
    typer.Option(
        help='Arguments of the task as JSON: \'{"domain": "in_distribution", "action_repeat": 4}\'.'
    ),
]
Ray = Annotated[
    str | None,
    typer.Option(help="Ray cluster: address, auto, or local (starts one of --jobs cores)."),
]
Jobs = Annotated[int, typer.Option(help="Worker processes.", min=1)]
Device = Annotated[
    str,
    typer.Option(
        help="cpu (--jobs processes), host (batch on CPU threads) or cuda (batch on a GPU)."
    ),
]
Variation = Annotated[
    int | None, typer.Option(help="Variation 0..999; default: the task's example.")
]
Variations = Annotated[
    str | None,
    typer.Option("--variations", "--variation", help="Variations, not a split: 800,803,810-819."),
]
CableRecordings = Annotated[
    pathlib.Path | None, typer.Argument(help="Folder data_set of the recordings (docs/reality.md).")
]
ClothRecordings = Annotated[
    pathlib.Path | None, typer.Argument(help="Folder of the CSV files of a session.")
]
WaterRecordings = Annotated[
    pathlib.Path | None, typer.Argument(help="Folder with the files of recordings.")
]
Cables = Annotated[list[str] | None, typer.Option(help="DLO1 to DLO5, repeatable; default: all.")]


PUBLISHED = "docs/results/policies/{}.pt2"  # Policies in a clone of the repository.


def policy_file(name: str) -> str:
    """Returns the file of a published policy, such as straighten_rope-sac; other names as given.

    Raises:
        InvalidArgumentError: for such a name without a file, as outside of a clone.
    """
    file = pathlib.Path(PUBLISHED.format(name))
    if file.is_file():
        return str(file)
    if re.fullmatch(rf"({'|'.join(TASKS)})(-\w+)+", name):
        published = sorted(path.stem for path in file.parent.glob("*.pt2"))
        valid = f"FILE.pt2, or in a clone's folder the name of a file in {file.parent}; {FILES}"
        raise InvalidArgumentError("policy", name, published or valid)
    return name


def given(**options: Any) -> dict[str, Any]:
    """Returns the options that are not None, as arguments of a task."""
    return {name: value for name, value in options.items() if value is not None}


def combined(settings: dict[str, Any], name: str, **options: Any) -> dict[str, Any]:
    """Returns settings together with the options that are not None.

    Args:
        settings: The settings.
        name: Name of the option that contains them.
        options: Values of the options that set one of them each.

    Raises:
        InvalidArgumentError: for a setting that differs from its option.
    """
    options = given(**options)
    for option, value in options.items():
        if settings.get(option, value) != value:
            valid = f"{value!r}, the value of --{option}, or none"
            raise InvalidArgumentError(f"{name}: {option}", settings[option], valid)
    return {**settings, **options}


def for_people(
    record: TaskRecord, policy: str, actor: str | None, grasp: str | None, look: str | None = None
) -> dict[str, Any]:
    """Returns arguments of a task that a policy plays for people to watch.

    They include the observation and actor of a saved policy. A look that is not given is the
    paper's, except for policies of images, which observe that of their training, and custom tasks
    without looks.
    """
    own = observes(policy)
    sees = has_images(own.get("observation", "reduced"))
    if look is None and not sees and "look" in record.arguments:
        look = PAPER.name
    return {**own, **given(actor=actor, grasp=grasp, look=look)}


def parsed_settings(settings: str, name: str = "task_settings") -> dict[str, Any]:
    """Returns the content of the option `TaskSettings`, or of another one, with its name.

    Raises:
        InvalidArgumentError: if it is not a JSON object.
    """
    try:
        parsed = json.loads(settings)
    except (ValueError, RecursionError):
        parsed = None
    if not isinstance(parsed, dict):
        raise InvalidArgumentError(name, settings, "a JSON object")
    return parsed


def chosen_variations(
    named: str | None, split: str | None, episodes: int | None, default: tuple[str, int]
) -> tuple[int, ...]:
    """Returns the variations of the option `Variations`, or the first ones of a split.

    Args:
        named: The option.
        split, episodes: Split and number of variations; None for those of `default`.
        default: Split and number.

    Raises:
        InvalidArgumentError: for indices together with a split or a number; for an unknown split,
            or more variations than it has.
    """
    if named is not None:
        from softgym_mj.evaluation import indices

        parsed = indices.parsed("variations", named)
        if others := given(split=split, episodes=episodes):
            options = " and ".join(f"--{name}" for name in others)
            raise InvalidArgumentError(f"--variations cannot be combined with {options}")
        return parsed
    number = default[1] if episodes is None else episodes
    return evaluation_variations(number, default[0] if split is None else split)


def progress_bar(*columns: rich.progress.ProgressColumn) -> rich.progress.Progress:
    """Returns a progress bar with counts and times, followed by `columns`."""
    return rich.progress.Progress(
        rich.progress.TextColumn("{task.description}", markup=False),
        rich.progress.BarColumn(),
        rich.progress.MofNCompleteColumn(),
        rich.progress.TimeElapsedColumn(),
        rich.progress.TimeRemainingColumn(),
        *columns,
        console=console,
    )
