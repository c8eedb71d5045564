"""The command `softgym-mj photo`."""

import pathlib
from typing import Annotated

import typer

import softgym_mj
from softgym_mj.cli.console import (
    Actor,
    Grasp,
    Task,
    Trust,
    Variation,
    console,
    for_people,
    policy_file,
    progress_bar,
)
from softgym_mj.exceptions import InvalidArgumentError, check_count
from softgym_mj.policies.factory import SIMPLE, make_policy
from softgym_mj.registry import find
from softgym_mj.rendering import photo as photos
from softgym_mj.rendering.offscreen import write_picture
from softgym_mj.storage.files import make_folder


def photo(
    task: Task,
    actor: Actor = None,
    grasp: Grasp = None,
    variation: Variation = None,
    step: Annotated[int, typer.Option(help="Env steps before the picture.", min=0)] = 0,
    policy: Annotated[
        str, typer.Option(help=f"Policy: {', '.join(SIMPLE)}, FILE.pt2 or MODULE:FUNCTION.")
    ] = "scripted",
    trust: Trust = False,
    camera: Annotated[str, typer.Option(help="task, overview or another of the model.")] = "task",
    size: Annotated[int, typer.Option(help="Image side [pixels].")] = 512,
    samples: Annotated[
        int, typer.Option(help="Samples per pixel; 256 for glass and water.", min=1)
    ] = photos.SAMPLES,
    denoise: Annotated[bool, typer.Option(help="Remove noise.")] = True,
    video: Annotated[
        bool, typer.Option("--video", help="Render a video of the whole episode.")
    ] = False,
    every: Annotated[int, typer.Option(help="Env steps between video frames.", min=1)] = 1,
    out: Annotated[
        pathlib.Path | None, typer.Option(help="The file; TASK.png or TASK.mp4 if not given.")
    ] = None,
) -> None:
    """Renders a task with a path tracer: seconds to minutes per picture."""
    record, ending = find(task), ".mp4" if video else ".png"
    file = out or pathlib.Path(f"{record.name}{ending}")
    if file.suffix.lower() != ending:
        raise InvalidArgumentError("out", str(file), f"a file that ends in {ending}")
    # Its arguments are checked before the episode is played.
    view = photos.PhotoCamera(camera, size, samples, denoise)
    make_folder(file.parent)
    policy = policy_file(policy)
    env = softgym_mj.load(record, split="all", **for_people(record, policy, actor, grasp))
    check_count("step", step, 0, env.horizon)
    act = make_policy(policy, env, trust=trust)
    index = env.task.example_variation if variation is None else variation
    with progress_bar() as progress:
        if video:
            bar = progress.add_task("env steps", total=env.horizon)
            photos.film(env, act, index, view, every=every,
                        on_step=lambda: progress.advance(bar)).write(file)  # fmt: skip
        else:
            bar = progress.add_task("env steps", total=step)
            for _ in env.play(act, index):
                progress.update(bar, completed=env.step_count)
                if env.step_count == step:
                    break
            if env.step_count < step:
                raise InvalidArgumentError("step", step, f"at most {env.step_count}")
            bar = progress.add_task("samples", total=samples)
            picture = view.rgb(env.physics, lambda number: progress.advance(bar, number))
            write_picture(picture, file)
    console.print(f"wrote {file}")
