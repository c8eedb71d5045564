"""The command line: softgym-mj list | demo | rollout | oracle | evaluate | plot | ..."""

import contextlib
import dataclasses
import json
import pathlib
from collections.abc import Callable, Iterator
from typing import Annotated, Any

import numpy as np
import rich.console
import rich.progress
import rich.table
import typer

import softgym_mj
from softgym_mj import cli_data, cli_evaluation
from softgym_mj.baselines.policies import SIMPLE, make_policy
from softgym_mj.console import Actor, Task, console, progress_bar
from softgym_mj.exceptions import RenderingUnavailableError, SoftGymError, check_name
from softgym_mj.rendering import CameraView, has_display

app = typer.Typer(help="Deformable-object manipulation tasks on MuJoCo.", no_args_is_help=True)
app.command()(cli_evaluation.evaluate)
app.command()(cli_evaluation.plot)
app.command()(cli_data.generate)
app.command()(cli_data.record)


def _load(task: str, split: str, filmed: bool, actor: str | None = None):
    """The environment of a task; water is drawn finely if a video is made of it."""
    check_name("task", task, softgym_mj.TASKS)
    drawn = filmed and "draw" in softgym_mj.TASKS[task].arguments
    settings: dict[str, Any] = {"draw": "fine"} if drawn else {}
    if actor is not None:
        settings["actor"] = actor
    return softgym_mj.load(task, split=split, **settings)


@app.command("list")
def list_tasks() -> None:
    """Lists the tasks."""
    table = rich.table.Table("task", "Gymnasium id", "tags", "horizon", "action repeat", "goal")
    for record in softgym_mj.TASKS.values():
        table.add_row(
            record.name,
            record.gymnasium_id,
            ", ".join(record.tags),
            str(record.horizon),
            str(record.action_repeat),
            record.summary,
        )
    console.print(table)


@app.command()
def demo(
    out: Annotated[
        pathlib.Path, typer.Option(help="Folder for videos and pictures.")
    ] = pathlib.Path("demo"),
    size: Annotated[int, typer.Option(help="Image side [pixels].", min=64, max=1280)] = 480,
    variation: Annotated[int, typer.Option(help="Variation 0..999.")] = 806,
) -> None:
    """Plays every task with its scripted policy; writes a video and a picture of each.

    And `tasks.png`: the start, the middle and the end of all of them.
    """
    strips = []
    with progress_bar() as progress:
        for name in softgym_mj.TASKS:
            video = _Video(out / f"{name}.mp4", size)
            env = _load(name, "all", filmed=True)
            bar = progress.add_task(name, total=env.horizon)
            scores = []
            for score in _play(env, "scripted", variation, video=video):
                scores.append(score)
                progress.advance(bar)
            progress.console.print(
                f"{name}: normalized performance {scores[-1]:.3f}; "
                f"wrote {video.file} and {video.file.with_suffix('.png')}"
            )
            strips.append(_strip(video.file))
    _write_sheet(strips, out / "tasks.png")
    console.print(f"wrote {out / 'tasks.png'}")


@app.command()
def rollout(
    task: Task,
    policy: Annotated[str, typer.Option(help=f"One of {', '.join(SIMPLE)}.")] = "scripted",
    actor: Actor = None,
    split: Annotated[str, typer.Option(help="train, evaluate or all.")] = "evaluate",
    episodes: Annotated[int, typer.Option(min=1)] = 5,
    seed: Annotated[int, typer.Option(help="Seed of the random policy.")] = 0,
    video: Annotated[
        pathlib.Path | None, typer.Option(help="Folder for a video of every episode.")
    ] = None,
) -> None:
    """Runs a policy on the first variations of a split; prints one JSON line an episode."""
    env = _load(task, split, filmed=video is not None, actor=actor)
    for index in list(env.variations)[:episodes]:
        file = None if video is None else _Video(video / f"{task}_{index:04d}.mp4")
        *_, score = _play(env, policy, index, seed, file)
        typer.echo(
            json.dumps(
                {
                    "task": task,
                    "actor": actor,
                    "policy": policy,
                    "variation": index,
                    "normalized_performance": score,
                    "success": env.info()["success"],
                }
            )
        )


@app.command()
def oracle(
    task: Task,
    actor: Actor = None,
    split: Annotated[str, typer.Option(help="train, evaluate or all.")] = "evaluate",
    episodes: Annotated[int, typer.Option(help="Variations, from the first on.", min=1)] = 20,
    out: Annotated[
        pathlib.Path, typer.Option(help="Folder for the scores and a video of the first episode.")
    ] = pathlib.Path("oracle"),
) -> None:
    """Scores the scripted expert on the first variations of a split; writes JSON and a video."""
    env = _load(task, split, filmed=True, actor=actor)
    name = task if actor is None else f"{task}-{actor}"
    scores: dict[int, float] = {}
    with progress_bar() as progress:
        variations = list(env.variations)[:episodes]
        bar = progress.add_task(task, total=len(variations))
        for index in variations:
            video = _Video(out / f"{name}.mp4") if index == variations[0] else None
            *_, scores[index] = _play(env, "scripted", index, video=video)
            progress.advance(bar)
    values = list(scores.values())
    summary = {"task": task, "actor": actor, "policy": "scripted",
               "version": softgym_mj.__version__, "mean": float(np.mean(values)),
               "min": min(values), "max": max(values),
               "normalized_performance": scores}  # fmt: skip
    file = out / f"{name}.json"
    file.write_text(json.dumps(summary, indent=2))
    console.print(
        f"{task}: mean {summary['mean']:.3f}, min {min(values):.3f}, max {max(values):.3f} of "
        f"{len(values)}; wrote {file} and {out / name}.mp4"
    )


@dataclasses.dataclass(frozen=True)
class _Video:
    """Where a video goes; its last frame becomes a PNG beside it."""

    file: pathlib.Path
    size: int = 480  # Image side [pixels].


def _play(
    env, policy: str, variation: int, seed: int = 0, video: _Video | None = None
) -> Iterator[float]:
    """Plays one episode; yields the normalised performance after every env step."""
    act = make_policy(policy, env, seed)
    timestep = env.reset(variation)
    with contextlib.ExitStack() as stack:
        film = stack.enter_context(_film(env, video)) if video else lambda: None
        while not timestep.last():
            timestep = env.step(act(timestep))
            film()
            yield env.info()["normalized_performance"]


@contextlib.contextmanager
def _film(env, video: _Video) -> Iterator[Callable[[], None]]:
    """Yields a function that adds the current frame to the video."""
    import imageio.v2 as imageio

    view = CameraView("task", video.size, video.size)
    first = view.rgb(env.physics)  # Fails before a file is made if there is no OpenGL.
    video.file.parent.mkdir(parents=True, exist_ok=True)
    fps = round(1 / env.control_timestep())
    writer: Any  # imageio annotates the base class, which lacks append_data.
    with imageio.get_writer(video.file, fps=fps, macro_block_size=8, quality=8) as writer:
        writer.append_data(first)
        yield lambda: writer.append_data(view.rgb(env.physics))
    imageio.imwrite(video.file.with_suffix(".png"), view.rgb(env.physics))


def _strip(file: pathlib.Path) -> np.ndarray:
    """The first, the middle and the last frame of a video, beside each other."""
    import imageio.v2 as imageio

    frames = imageio.mimread(file, memtest=False)
    return np.hstack([frames[0], frames[len(frames) // 2], frames[-1]])


def _write_sheet(strips: list[np.ndarray], file: pathlib.Path) -> None:
    """Writes strips in two columns, half as large."""
    import imageio.v2 as imageio

    strips = strips + [np.full_like(strips[0], 255)] * (len(strips) % 2)
    rows = [np.hstack(pair) for pair in zip(strips[::2], strips[1::2], strict=True)]
    sheet = np.vstack(rows)
    quarters = [sheet[i::2, j::2].astype(int) for i in range(2) for j in range(2)]
    imageio.imwrite(file, (np.sum(quarters, axis=0) // 4).astype(np.uint8))


@app.command()
def view(
    task: Task,
    policy: Annotated[str, typer.Option(help=f"One of {', '.join(SIMPLE)}.")] = "scripted",
    actor: Actor = None,
    variation: Annotated[int, typer.Option(help="Variation 0..999.")] = 800,
) -> None:
    """Plays a task in MuJoCo's viewer; needs a display."""
    check_name("task", task, softgym_mj.TASKS)
    if not has_display():
        raise RenderingUnavailableError(
            "the viewer needs a display and neither DISPLAY nor WAYLAND_DISPLAY is set; "
            f"make a video instead: softgym-mj rollout {task} --video videos"
        )
    import mujoco.viewer

    env = _load(task, "all", filmed=False, actor=actor)
    timestep = env.reset(variation)
    act = make_policy(policy, env)
    model, data = env.physics.model.ptr, env.physics.data.ptr
    with mujoco.viewer.launch_passive(model, data) as window:
        while window.is_running():
            if timestep.last():
                timestep = env.reset(variation)
            timestep = env.step(act(timestep))
            mujoco.mj_forward(model, data)
            window.sync()


def main() -> None:
    """Runs the command line; an error of this package is one line and exit status 1."""
    try:
        app()
    except SoftGymError as error:
        typer.echo(f"{type(error).__name__}: {error}", err=True)
        raise SystemExit(1) from None


if __name__ == "__main__":
    main()
