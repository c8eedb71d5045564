"""The command `softgym-mj train`."""

import pathlib
from typing import TYPE_CHECKING, Annotated, Any

import rich.progress
import typer

from softgym_mj.cli.console import (
    Ray,
    Task,
    Trust,
    console,
    parsed_settings,
)
from softgym_mj.exceptions import InvalidArgumentError, check_count, check_name
from softgym_mj.parallel.executors import make_executor
from softgym_mj.registry import find
from softgym_mj.vector.make import DEVICES

if TYPE_CHECKING:
    from softgym_mj.learning.training import Training


def train(
    method: Annotated[
        str,
        typer.Argument(
            help="Such as sac; an unknown one lists all. MODULE:FUNCTION for one of a module of "
            "yours, installed or in the current folder."
        ),
    ],
    task: Task,
    preset: Annotated[str, typer.Option(help="paper, fast, or night (sac).")] = "fast",
    seeds: Annotated[int, typer.Option(help="How many, side by side.", min=1)] = 1,
    first_seed: Annotated[
        int, typer.Option(help="The first; `learning join` makes one result of several folders.")
    ] = 0,
    device: Annotated[
        str, typer.Option(help="Of environments: cpu (worker processes), host or cuda.")
    ] = "cuda",
    learner_device: Annotated[
        str | None, typer.Option(help="Of networks: cpu or cuda; the environments' if not given.")
    ] = None,
    observation: Annotated[
        str | None,
        typer.Option(
            help="What the policy observes, in place of the preset's: reduced, markov, full or "
            "rgb; of distill names such as rgb,proprioception,held."
        ),
    ] = None,
    teacher: Annotated[
        str | None,
        typer.Option(
            help="Policy that distill imitates: FILE.pt2, or the name of one in docs/results/"
            "policies of a checkout; with --trust.",
        ),
    ] = None,
    trust: Trust = False,
    settings: Annotated[
        str,
        typer.Option(
            help="Settings of the training or the method as JSON, in place of the preset's: "
            "'{\"env_steps\": 200000}'."
        ),
    ] = "{}",
    task_settings: Annotated[
        str,
        typer.Option(
            help="Arguments of the task as JSON: "
            '\'{"domain": "in_distribution", "action_repeat": 4}\'.'
        ),
    ] = "{}",
    jobs: Annotated[
        int, typer.Option(help="Processes that train a seed each; 1: all side by side.", min=1)
    ] = 1,
    ray: Ray = None,
    log: Annotated[str, typer.Option(help="none, tensorboard or wandb.")] = "none",
    out: Annotated[pathlib.Path, typer.Option(help="Folder of this training.")] = pathlib.Path(
        "training"
    ),
) -> None:
    """Trains a policy; may be killed and run again."""
    from softgym_mj.learning import reports
    from softgym_mj.learning.registry import find_preset
    from softgym_mj.learning.spreading import train_each
    from softgym_mj.learning.training import Training

    check_name("device", device, DEVICES)
    check_name("learner_device", learner_device, (None, "cpu", "cuda"))
    check_count("seeds", seeds, 1, 100)
    check_count("first_seed", first_seed, 0, 1000)
    chosen_seeds = range(first_seed, first_seed + seeds)
    chosen: dict[str, Any] = parsed_settings(settings)
    if observation is not None:
        names = observation.split(",")
        chosen["observation"] = names if len(names) > 1 else observation
    if teacher is not None:
        chosen |= _teacher(teacher, trust)
    if arguments := parsed_settings(task_settings):
        chosen["arguments"] = arguments
    training, result = find_preset(method, preset, find(task).name, **chosen)
    try:
        if jobs == 1 and ray is None:
            reports.line(
                f"{method} {training.task}: makes {training.num_envs * seeds} environments"
            )
            run = Training(training, result, chosen_seeds, out, device, learner_device)
            rows = _side_by_side(run, log)
        else:
            check_name("log", log, ("none",))  # Of seeds side by side only.
            with make_executor(jobs, ray) as executor:
                rows = train_each(
                    training, result, chosen_seeds, out, device, learner_device, executor,
                    lambda seed, own: print(f"seed {seed} has ended", flush=True),
                )  # fmt: skip
    except KeyboardInterrupt:
        message = f"{out} keeps its last checkpoint: the same command continues from it"
        raise KeyboardInterrupt(message) from None
    for row in rows:
        if row["final"]:
            console.print(
                f"seed {row['seed']}, {row['split']}, {row['episodes']} episodes: "
                f"{row['normalized_performance']:.3f}, success {row['success']:.2f}"
            )
    console.print(f"wrote {out / 'curve.csv'}")


def _teacher(name: str, trust: bool) -> dict[str, Any]:
    """Returns settings of distill for a teacher."""
    from softgym_mj.policies.exported import SUFFIX, has_images, observes

    file = name if name.endswith(SUFFIX) else f"docs/results/policies/{name}{SUFFIX}"
    if not pathlib.Path(file).is_file():
        raise InvalidArgumentError("teacher", name, f"a file; there is no {file}")
    if not trust:
        raise InvalidArgumentError(
            f"teacher={file!r} is not loaded: such a file can run any code on this machine. If you "
            "trust whoever made it, say so by --trust"
        )
    observed = observes(file).get("observation", "markov")
    if not isinstance(observed, str) or has_images([observed]):
        raise InvalidArgumentError("teacher", name, f"a policy of states; it observes {observed}")
    return {"teacher": file, "privileged": observed}


def _side_by_side(training: "Training", log: str) -> list[dict[str, Any]]:
    """Trains all seeds here; shows a bar or, without a terminal, lines. Returns the curve."""
    from softgym_mj.learning import logs, reports

    tell = logs.make_log(log, training.folder)
    if not console.is_terminal:
        with reports.repeated(lambda: reports.progress(training), reports.LINE_SECONDS):
            training.run(tell, reports.start, logs.POINTS)
        return training.rows
    text = rich.progress.TextColumn("{task.fields[note]}")
    elapsed = rich.progress.TimeElapsedColumn()
    with rich.progress.Progress(text, elapsed, console=console) as progress:
        bar = progress.add_task(
            "", total=training.settings.env_steps, note=reports.summary(training)
        )

        def show() -> None:
            progress.update(bar, completed=training.covered, note=reports.summary(training))

        with reports.repeated(show, 1.0):
            training.run(tell, reports.start, logs.POINTS)
    return training.rows
