"""Commands that list and play tasks: list, demo, rollout."""

import functools
import json
import pathlib
from typing import Annotated

import numpy as np
import rich.box
import rich.table
import typer

import softgym_mj
from softgym_mj.cli.console import (
    Actor,
    Grasp,
    Look,
    Task,
    Trust,
    Variations,
    chosen_variations,
    console,
    for_people,
    policy_file,
    progress_bar,
)
from softgym_mj.policies.episodes import Episode, play
from softgym_mj.policies.exported import observes
from softgym_mj.policies.factory import SIMPLE
from softgym_mj.registry import SUITES, find, task_names
from softgym_mj.rendering.look import PAPER
from softgym_mj.rendering.offscreen import write_picture
from softgym_mj.storage.files import make_folder
from softgym_mj.variations.indices import check_variation

_COLUMNS = "suite", "name", "gymnasium_id", "tags", "horizon", "action_repeat", "goal"
VIDEO_SIZE = 480  # Side of a video [pixels].


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
    size: Annotated[int, typer.Option(help="Image side [pixels].", min=64, max=1280)] = VIDEO_SIZE,
    variation: Annotated[int, typer.Option(help="Variation 0..999.")] = 806,
    look: Look = PAPER.name,
) -> None:
    """Plays every task with its scripted expert; writes a video and a picture of each.

    The picture `tasks.png` shows the start, middle and end of all tasks.
    """
    check_variation(variation)
    make_folder(out)
    strips = []
    with progress_bar() as progress:
        for name, record in softgym_mj.TASKS.items():
            file = out / f"{name}.mp4"
            env = softgym_mj.load(record, split="all", look=look)
            bar = progress.add_task(name, total=env.horizon)
            advance = functools.partial(progress.advance, bar)
            episode = play(env, variation=variation, size=size, on_step=advance)
            _write(episode, file)
            strips.append(np.hstack([episode.frames[k] for k in (0, env.horizon // 2, -1)]))
            progress.console.print(
                f"{name}: normalized performance {_score(episode):.3f}; "
                f"wrote {file} and {file.with_suffix('.png')}"
            )
    _write_sheet(strips, out / "tasks.png")
    console.print(f"wrote {out / 'tasks.png'}")


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
    settings = {**for_people(record, actor, grasp, look), **observes(policy)}
    env = softgym_mj.load(record, split=played, **settings)
    own_grasp = (*env.task.actor.name.split("/"), None)[1]  # Arms are named as in "franka/attach".
    camera = None if video is None else "task"  # Images take most of the time.
    for index in played:
        episode = play(env, policy, index, seed=seed, trust=trust, camera=camera, size=VIDEO_SIZE)
        if video is not None:
            _write(episode, video / f"{record.name}_{index:04d}.mp4")
        line = {"task": record.name, "actor": actor or env.task.actors[0], "grasp": own_grasp,
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


def _write_sheet(strips: list[np.ndarray], file: pathlib.Path) -> None:
    """Writes strips in two columns, at half their size."""
    strips = strips + [np.full_like(strips[0], 255)] * (len(strips) % 2)
    rows = [np.hstack(pair) for pair in zip(strips[::2], strips[1::2], strict=True)]
    sheet = np.vstack(rows)
    quarters = [sheet[i::2, j::2].astype(int) for i in range(2) for j in range(2)]
    write_picture((np.sum(quarters, axis=0) // 4).astype(np.uint8), file)
