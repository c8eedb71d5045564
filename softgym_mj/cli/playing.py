"""Commands that list and play tasks: list, demo, rollout, expert."""

import functools
import json
import pathlib
from collections.abc import Callable
from typing import Annotated, Any

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
    console,
    first_variations,
    for_people,
    given,
    policy_file,
    progress_bar,
)
from softgym_mj.envs.environment import Environment
from softgym_mj.policies.episodes import Episode, play
from softgym_mj.policies.exported import observes
from softgym_mj.policies.factory import SIMPLE
from softgym_mj.registry import find
from softgym_mj.rendering.look import PAPER
from softgym_mj.rendering.offscreen import CameraView, write_picture
from softgym_mj.storage.files import make_folder, write_json
from softgym_mj.variations.indices import check_variation

VIDEO_SIZE = 480  # Side of a video [pixels].


def list_tasks() -> None:
    """Lists the tasks: a table, or tab-separated lines if the output is not a terminal.

    The columns of a line are name, Gymnasium id, tags, horizon, action repeat and goal.
    """
    if not console.is_terminal:
        for record in softgym_mj.TASKS.values():
            lengths = str(record.horizon), str(record.action_repeat)
            tags = ",".join(record.tags)
            row = record.name, record.gymnasium_id, tags, *lengths, record.summary
            typer.echo("\t".join(row))
        return
    table = rich.table.Table(box=rich.box.SIMPLE)
    for title in ("task\nGymnasium id", "tags", "horizon\nrepeat"):
        table.add_column(title, no_wrap=True)
    table.add_column("goal")
    for record in softgym_mj.TASKS.values():
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
            episode, stills = _demonstrate(env, variation, size, advance)
            episode.video.write(file)
            write_picture(stills[-1], file.with_suffix(".png"))
            strips.append(np.hstack(stills))
            progress.console.print(
                f"{name}: normalized performance {_score(episode):.3f}; "
                f"wrote {file} and {file.with_suffix('.png')}"
            )
    _write_sheet(strips, out / "tasks.png")
    console.print(f"wrote {out / 'tasks.png'}")


def _demonstrate(
    env: Environment, variation: int, size: int, advance: Callable[[], None]
) -> tuple[Episode, list[np.ndarray]]:
    """Plays the expert's episode; also returns pictures of its start, middle and end."""
    stills, view = [], CameraView("task", size, size)

    def on_step() -> None:
        advance()
        if env.step_count in (1, env.horizon // 2, env.horizon):
            stills.append(view.rgb(env.physics))

    return play(env, "scripted", variation, size=size, on_step=on_step), stills


def rollout(
    task: Task,
    policy: Annotated[
        str, typer.Option(help=f"{', '.join(SIMPLE)}, FILE.pt2 or MODULE:FUNCTION.")
    ] = "scripted",
    actor: Actor = None,
    grasp: Grasp = None,
    split: Annotated[str, typer.Option(help="train, evaluate or all.")] = "evaluate",
    episodes: Annotated[int, typer.Option(min=1)] = 5,
    seed: Annotated[int, typer.Option(help="Seed of the random policy.", min=0)] = 0,
    trust: Trust = False,
    look: Look = None,
    video: Annotated[
        pathlib.Path | None, typer.Option(help="Folder for a video of every episode.")
    ] = None,
) -> None:
    """Runs a policy on the first variations of a split; prints one JSON line an episode."""
    record, variations = find(task), first_variations(split, episodes)
    policy = policy_file(policy)
    if video is not None:
        make_folder(video)
    settings = {**for_people(record, actor, grasp, look), **observes(policy)}
    env = softgym_mj.load(record, split=split, **settings)
    for index in variations:
        episode = _played(env, policy, index, video is not None, seed=seed, trust=trust)
        if video is not None:
            _write(episode, video / f"{record.name}_{index:04d}.mp4")
        line = {"task": record.name, "actor": actor, "grasp": grasp, "policy": policy,
                "variation": index, "normalized_performance": _score(episode),
                "success": bool(episode.info["success"][-1])}  # fmt: skip
        typer.echo(json.dumps(line))


def expert(
    task: Task,
    actor: Actor = None,
    grasp: Grasp = None,
    split: Annotated[str, typer.Option(help="train, evaluate or all.")] = "evaluate",
    episodes: Annotated[int, typer.Option(help="Variations, from the first on.", min=1)] = 20,
    look: Look = None,
    out: Annotated[
        pathlib.Path, typer.Option(help="Folder for the scores and a video of the first episode.")
    ] = pathlib.Path("expert"),
) -> None:
    """Scores the scripted expert on the first variations of a split; writes JSON and a video."""
    record = find(task)
    settings = for_people(record, actor, grasp, look)
    variations = first_variations(split, episodes)
    make_folder(out)
    env = softgym_mj.load(record, split=split, **settings)
    name = "-".join([record.name, *given(actor=actor, grasp=grasp).values()])
    scores: dict[int, float] = {}
    with progress_bar() as progress:
        bar = progress.add_task(record.name, total=len(variations))
        for index in variations:
            first = index == variations[0]
            episode = _played(env, "scripted", index, first)
            if first:
                _write(episode, out / f"{name}.mp4")
            scores[index] = _score(episode)
            progress.advance(bar)
    values = list(scores.values())
    summary = {"task": record.name, "actor": actor, "grasp": grasp, "policy": "scripted",
               "version": softgym_mj.__version__, "mean": float(np.mean(values)),
               "min": min(values), "max": max(values),
               "normalized_performance": scores}  # fmt: skip
    file = out / f"{name}.json"
    write_json(file, summary)
    console.print(
        f"{record.name}: mean {summary['mean']:.3f}, min {min(values):.3f}, "
        f"max {max(values):.3f} of {len(values)}; wrote {file} and {out / name}.mp4"
    )


def _played(env, policy: str, variation: int, with_video: bool, **settings: Any) -> Episode:
    """Plays an episode, with images only if asked for: they take most of the time."""
    camera = "task" if with_video else None
    return play(env, policy, variation, camera=camera, size=VIDEO_SIZE, **settings)


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
