"""Commands that list and play tasks: list, demo, rollout."""

import json
import os
import pathlib
from typing import Annotated

import numpy as np
import rich.box
import rich.table
import typer
from PIL import Image, ImageDraw, ImageFont

import softgym_mj
from softgym_mj.cli.console import (
    Actor,
    Grasp,
    Jobs,
    Look,
    Task,
    Trust,
    Variation,
    Variations,
    chosen_variations,
    console,
    for_people,
    policy_file,
    progress_bar,
)
from softgym_mj.parallel.executors import make_executor
from softgym_mj.policies.episodes import Episode, play
from softgym_mj.policies.factory import SIMPLE
from softgym_mj.registry import SUITES, find, task_names
from softgym_mj.rendering.look import PAPER
from softgym_mj.rendering.offscreen import write_picture
from softgym_mj.storage.files import make_folder
from softgym_mj.variations.indices import check_variation

_COLUMNS = "suite", "name", "gymnasium_id", "tags", "horizon", "action_repeat", "goal"
VIDEO_SIZE = 480  # Side of a video [pixels].
DEMO_JOBS = min(os.cpu_count() or 1, 4)  # Worker processes of `demo`.


def list_tasks() -> None:
    """Lists the tasks by suite: a table, or tab-separated lines if the output is no terminal.

    The first line names the columns; horizon is in env steps, action_repeat in sim steps of 0.01 s.
    """
    if not console.is_terminal:
        typer.echo("\t".join(_COLUMNS))
        for record in softgym_mj.TASKS.values():
            lengths = str(record.horizon), str(record.action_repeat)
            tags = ",".join(record.tags)
            row = record.suite, record.name, record.gymnasium_id, tags, *lengths, record.summary
            typer.echo("\t".join(row))
        return
    for suite in SUITES:
        table = rich.table.Table(box=rich.box.SIMPLE, title=f"suite {suite}", title_justify="left")
        for title in ("task\nGymnasium id", "tags", "horizon\nrepeat"):
            table.add_column(title, no_wrap=True)
        table.add_column("goal")
        for record in map(find, task_names(suite)):
            table.add_row(
                f"{record.name}\n{record.gymnasium_id}",
                "\n".join(record.tags),
                f"{record.horizon}\n{record.action_repeat}",
                record.summary,
            )
        console.print(table)


def demo(
    out: Annotated[
        pathlib.Path, typer.Option(help="Folder for videos and pictures.")
    ] = pathlib.Path("demo"),
    size: Annotated[int, typer.Option(help="Image side [pixels].", min=64, max=1280)] = 240,
    variation: Variation = None,
    look: Look = PAPER.name,
    jobs: Jobs = DEMO_JOBS,
) -> None:
    """Plays every task with its scripted expert; writes a video and a picture of each.

    The picture `tasks.png` shows the start, middle and end of all tasks.
    """
    if variation is not None:
        check_variation(variation)
    make_folder(out)
    # The longest first, so that no worker ends much later than the others.
    names = sorted(softgym_mj.TASKS, key=lambda name: -softgym_mj.TASKS[name].horizon)
    calls = [(name, variation, look, size, out / f"{name}.mp4") for name in names]
    strips = {}
    with progress_bar() as progress, make_executor(min(jobs, len(calls))) as executor:
        bar = progress.add_task("tasks", total=len(calls))
        for index, (score, strip) in executor.results(_played, calls):
            name, *_, file = calls[index]
            strips[name] = strip
            progress.advance(bar)
            progress.console.print(
                f"{name}: normalized performance {score:.3f}; "
                f"wrote {file} and {file.with_suffix('.png')}"
            )
    _write_sheet([_labeled(strips[name], name) for name in softgym_mj.TASKS], out / "tasks.png")
    console.print(f"wrote {out / 'tasks.png'}")


def _played(
    name: str, variation: int | None, look: str, size: int, file: pathlib.Path
) -> tuple[float, np.ndarray]:
    """Plays a task's expert and writes its video.

    Args:
        name: Task.
        variation: Index; None for the task's example.
        look: Look of images.
        size: Side of images [pixels].
        file: The video.

    Returns:
        Normalized performance at the end; start, middle and end side by side.
    """
    env = softgym_mj.load(name, split="all", look=look)
    index = env.task.example_variation if variation is None else variation
    episode = play(env, variation=index, size=size)
    _write(episode, file)
    return _score(episode), np.hstack([episode.frames[k] for k in (0, env.horizon // 2, -1)])


def rollout(
    task: Task,
    policy: Annotated[
        str, typer.Option(help=f"{', '.join(SIMPLE)}, FILE.pt2 or MODULE:FUNCTION.")
    ] = "scripted",
    actor: Actor = None,
    grasp: Grasp = None,
    split: Annotated[str | None, typer.Option(help="evaluate (default), train or all.")] = None,
    episodes: Annotated[
        int | None, typer.Option(help="Number of variations to play; default: 5.")
    ] = None,
    variations: Variations = None,
    seed: Annotated[int, typer.Option(help="Seed of the random policy.", min=0)] = 0,
    trust: Trust = False,
    look: Look = None,
    video: Annotated[
        pathlib.Path | None, typer.Option(help="Folder for a video of every episode.")
    ] = None,
) -> None:
    """Runs a policy on variations, the first of a split; prints one JSON line per episode."""
    record, played = find(task), chosen_variations(variations, split, episodes, ("evaluate", 5))
    policy = policy_file(policy)
    if video is not None:
        make_folder(video)
    settings = for_people(record, policy, actor, grasp, look)
    env = softgym_mj.load(record, split=played, **settings)
    # Arms are named as in "franka/attach".
    own_actor, own_grasp = (*env.task.actor.name.split("/"), None)[:2]
    camera = None if video is None else "task"  # Images take most of the time.
    for index in played:
        episode = play(env, policy, index, seed=seed, trust=trust, camera=camera, size=VIDEO_SIZE)
        if video is not None:
            _write(episode, video / f"{record.name}_{index:04d}.mp4")
        line = {"task": record.name, "actor": own_actor, "grasp": own_grasp,
                "policy": policy, "variation": index, "normalized_performance": _score(episode),
                "success": bool(episode.info["success"][-1])}  # fmt: skip
        typer.echo(json.dumps(line))


def _score(episode: Episode) -> float:
    """Returns the normalized performance at the end."""
    return float(episode.info["normalized_performance"][-1])


def _write(episode: Episode, file: pathlib.Path) -> None:
    """Writes the video, and its last picture as a PNG file next to it."""
    episode.video.write(file)
    write_picture(episode.frames[-1], file.with_suffix(".png"))


def _labeled(strip: np.ndarray, name: str) -> np.ndarray:
    """Returns a strip with a name in its upper left corner."""
    picture, size = Image.fromarray(strip), len(strip) // 12
    ImageDraw.Draw(picture).text(
        (size // 3, size // 3), name, "black", ImageFont.load_default(size),
        stroke_width=size // 10, stroke_fill="white",
    )  # fmt: skip
    return np.asarray(picture)


def _write_sheet(strips: list[np.ndarray], file: pathlib.Path) -> None:
    """Writes strips in two columns, at half their size."""
    strips = strips + [np.full_like(strips[0], 255)] * (len(strips) % 2)
    rows = [np.hstack(pair) for pair in zip(strips[::2], strips[1::2], strict=True)]
    sheet = np.vstack(rows)
    quarters = [sheet[i::2, j::2].astype(int) for i in range(2) for j in range(2)]
    write_picture((np.sum(quarters, axis=0) // 4).astype(np.uint8), file)
