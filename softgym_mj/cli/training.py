"""The command `softgym-mj train`."""

import pathlib
from typing import Annotated, Any

import rich.progress
import typer

from softgym_mj.cli.console import Settings, Task, console, given, parsed_settings, progress_bar
from softgym_mj.exceptions import check_count, check_name
from softgym_mj.registry import find
from softgym_mj.vector.make import DEVICES


def train(
    method: Annotated[str, typer.Argument(help="Such as sac; an unknown one lists all.")],
    task: Task,
    preset: Annotated[str, typer.Option(help="paper or fast.")] = "fast",
    seeds: Annotated[int, typer.Option(help="How many, side by side: 0..", min=1)] = 1,
    device: Annotated[
        str, typer.Option(help="cpu (worker processes), host or cuda; the learner's, too.")
    ] = "cuda",
    observation: Annotated[
        str | None, typer.Option(help="reduced, full or rgb, in place of the preset's.")
    ] = None,
    settings: Settings = "{}",
    log: Annotated[str, typer.Option(help="none, tensorboard or wandb.")] = "none",
    out: Annotated[pathlib.Path, typer.Option(help="Folder of this training.")] = pathlib.Path(
        "training"
    ),
) -> None:
    """Trains a policy; may be killed and run again. --settings are those of preset files."""
    from softgym_mj.learning.logs import make_log
    from softgym_mj.learning.registry import find_preset
    from softgym_mj.learning.training import Training

    check_name("device", device, DEVICES)
    check_count("seeds", seeds, 1, 100)
    chosen: dict[str, Any] = {**parsed_settings(settings), **given(observation=observation)}
    training, chosen_method = find_preset(method, preset, find(task).name, **chosen)
    run = Training(training, chosen_method, list(range(seeds)), out, device)
    tell = make_log(log, out)
    with progress_bar(rich.progress.TextColumn("{task.fields[note]}")) as progress:
        bar = progress.add_task(f"{method} {training.task}", total=training.env_steps, note="")

        def show(now: Training, news: dict[str, list[float]]) -> None:
            progress.update(bar, completed=now.done * training.part, note=now.said())
            tell(now, news)

        run.run(show)
    for row in run.rows:
        if row["final"]:
            console.print(
                f"seed {row['seed']}, {row['split']}, {row['episodes']} episodes: "
                f"{row['normalized_performance']:.3f}, success {row['success']:.2f}"
            )
    console.print(f"wrote {out / 'curve.csv'}")
