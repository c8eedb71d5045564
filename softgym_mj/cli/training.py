"""The command `softgym-mj train`."""

import dataclasses
import json
import math
import pathlib
import time
from collections.abc import Mapping, Sequence
from typing import Annotated, Any

import typer

from softgym_mj.cli.console import (
    PUBLISHED,
    Ray,
    Task,
    TaskSettings,
    Trust,
    combined,
    console,
    parsed_settings,
    policy_file,
)
from softgym_mj.exceptions import (
    InvalidArgumentError,
    UnavailableError,
    check_count,
    check_name,
    check_number,
    import_extra,
)
from softgym_mj.parallel.executors import make_executor
from softgym_mj.registry import find
from softgym_mj.storage.files import make_folder
from softgym_mj.vector.make import DEVICES

_CPU_PRESET = "night"  # Small networks that learn in about an hour on a CPU core.


def train(
    method: Annotated[
        str,
        typer.Argument(
            help="Method, such as sac (an unknown name lists all), or MODULE:FUNCTION of a module "
            "that is installed or in the current folder."
        ),
    ],
    task: Task,
    preset: Annotated[
        str | None,
        typer.Option(
            help="fast or minutes (methods have one of them: default), paper, or night (sac, on a "
            "CPU)."
        ),
    ] = None,
    seeds: Annotated[int, typer.Option(help="Number of seeds, trained together.", min=1)] = 1,
    first_seed: Annotated[
        int, typer.Option(help="First seed; `learning join` joins the results of several folders.")
    ] = 0,
    device: Annotated[
        str,
        typer.Option(
            help="Environments: cuda (a GPU), cpu (worker processes) or host (CPU threads)."
        ),
    ] = "cuda",
    learner_device: Annotated[
        str | None, typer.Option(help="Device of networks: cpu or cuda; default: as --device.")
    ] = None,
    observation: Annotated[
        str | None,
        typer.Option(
            help="Observation of the policy instead of the preset's: reduced, markov, key_points, "
            "full or rgb; of distill, names such as rgb,proprioception,held."
        ),
    ] = None,
    teacher: Annotated[
        str | None,
        typer.Option(
            help="Policy that distill imitates: with --trust FILE.pt2, or the name of one in "
            "docs/results/policies of a clone; or MODULE:FUNCTION that maps markov observations "
            "to actions, or those that its attribute `observes` names."
        ),
    ] = None,
    trust: Trust = False,
    settings: Annotated[
        str,
        typer.Option(
            help="Settings of the training or the method as JSON, instead of the preset's: "
            "'{\"env_steps\": 204800}'."
        ),
    ] = "{}",
    task_settings: TaskSettings = "{}",
    jobs: Annotated[
        int, typer.Option(help="Processes, one seed each; 1: all seeds in one process.", min=1)
    ] = 1,
    ray: Ray = None,
    minutes: Annotated[
        float | None,
        typer.Option(
            help="Time limit, without --jobs and --ray: learning stops early enough for the final "
            "evaluation; the same command continues later."
        ),
    ] = None,
    log: Annotated[str, typer.Option(help="none, tensorboard or wandb.")] = "none",
    show_settings: Annotated[
        bool,
        typer.Option(
            "--show-settings", help="Print all settings as JSON, as --settings takes them; no run."
        ),
    ] = False,
    out: Annotated[pathlib.Path, typer.Option(help="Folder of this training.")] = pathlib.Path(
        "training"
    ),
) -> None:
    """Trains a policy. The same command continues a training that was stopped."""
    start = time.monotonic()
    import_extra("torch", "PyTorch", "learning")
    from softgym_mj.learning import logs, reports
    from softgym_mj.learning.registry import default_preset, find_preset
    from softgym_mj.learning.setup import check_settings
    from softgym_mj.learning.spreading import train_each
    from softgym_mj.learning.time_limits import TimeLimit
    from softgym_mj.learning.training import Training

    check_name("device", device, DEVICES)
    check_name("learner_device", learner_device, (None, "cpu", "cuda"))
    is_alone = jobs == 1 and ray is None
    check_name("log", log, logs.LOGS if is_alone else ("none",))  # A log is of one process.
    check_count("seeds", seeds, 1, 100)
    check_count("first_seed", first_seed, 0, 1000)
    left = math.inf if minutes is None else 60.0 * _checked_minutes(minutes, is_alone)
    limit = TimeLimit(start + left)
    chosen_seeds = range(first_seed, first_seed + seeds)
    names = (observation or "").split(",")
    chosen = combined(
        parsed_settings(settings, "settings"), "settings",
        observation=names if len(names) > 1 else observation,
    )  # fmt: skip
    if teacher is not None:
        chosen |= _teacher(teacher, trust)
    chosen |= _of_task(parsed_settings(task_settings))
    preset = preset or default_preset(method)
    training, result = find_preset(method, preset, find(task).name, **chosen)
    if show_settings:
        everything = {**dataclasses.asdict(training), **dataclasses.asdict(result.settings)}
        del everything["task"]
        typer.echo(json.dumps(everything, indent=2))
        return
    check_settings(training, result)
    _note_symmetries(training.actor, result.settings)
    if "cuda" in (device, learner_device):
        _check_gpu(method, task, preset)
    make_folder(out)  # Before the environments, which take long.
    try:
        if is_alone:
            reports.line(
                f"{method} {training.task}: creating {training.num_envs * seeds} environments"
            )
            run = Training(training, result, chosen_seeds, out, device, learner_device, limit)
            tell = logs.make_log(log, run.folder)
            with reports.repeated(lambda: reports.progress(run), reports.LINE_SECONDS):
                run.run(tell, reports.start, logs.POINTS)
            rows = run.rows
        else:
            with make_executor(jobs, ray) as executor:
                rows = train_each(
                    training, result, chosen_seeds, out, device, learner_device, executor,
                    lambda seed, own: print(f"seed {seed} is finished", flush=True),
                )  # fmt: skip
    except KeyboardInterrupt:
        message = f"{out} keeps its last checkpoint: the same command continues from it"
        raise KeyboardInterrupt(message) from None
    _print_scores(rows, training.env_steps)
    console.print(f"wrote {out / 'curve.csv'}")


def _of_task(arguments: dict[str, Any]) -> dict[str, Any]:
    """Returns settings of a training for arguments of its task; the actor is one of its own."""
    settings = {"actor": arguments.pop("actor")} if "actor" in arguments else {}
    return settings | ({"arguments": arguments} if arguments else {})


def _note_symmetries(actor: str | None, settings: Any) -> None:
    """Prints whether a method that can use symmetries trains without, because of its actor."""
    if actor is not None and getattr(settings, "symmetric", None) is False:
        from softgym_mj.learning import reports

        reports.line(f"symmetric is off for the actor {actor}: replay is plain")


def _checked_minutes(minutes: float, in_one_process: bool) -> float:
    """Returns the minutes of a time limit, at which all seeds end after the same env steps."""
    check_number("minutes", minutes, gt=0.0)
    if not in_one_process:
        valid = "no value with jobs or ray, whose seeds would end after different env steps"
        raise InvalidArgumentError("minutes", minutes, valid)
    return minutes


def _print_scores(rows: Sequence[Mapping[str, Any]], env_steps: int) -> None:
    """Prints the final rows of a curve, and whether a time limit has ended the training."""
    for row in rows:
        if row["final"]:
            console.print(
                f"seed {row['seed']}, {row['split']}, {row['episodes']} episodes: "
                f"{row['normalized_performance']:.3f}, success {row['success']:.2f}"
            )
    if (done := rows[-1]["env_steps"]) < env_steps:
        console.print(
            f"ended after {done:,} of {env_steps:,} env steps: the same command continues"
        )


def _check_gpu(method: str, task: str, preset: str) -> None:
    """Raises `UnavailableError`, with the command for a CPU, unless there is a CUDA device."""
    import torch

    from softgym_mj.learning.registry import preset_names

    if not torch.cuda.is_available():
        preset = _CPU_PRESET if _CPU_PRESET in preset_names(method) else preset
        raise UnavailableError(
            "there is no CUDA device that PyTorch can use; to train on the CPU, run "
            f"`softgym-mj train {method} {task} --preset {preset} --device cpu`"
        )


def _teacher(name: str, trust: bool) -> dict[str, Any]:
    """Returns settings of distill for a teacher, and the actor that a file was trained with."""
    from softgym_mj.policies.exported import SUFFIX, has_images, observes
    from softgym_mj.policies.saved import imported
    from softgym_mj.tasks.shared.observations import names_of

    if ":" in name:
        function = imported(name, "teacher")
        return {"teacher": name, "privileged": getattr(function, "observes", "markov")}
    file = policy_file(name)
    if not file.endswith(SUFFIX) or not pathlib.Path(file).is_file():
        raise InvalidArgumentError("teacher", name, f"FILE{SUFFIX}, or {PUBLISHED.format('NAME')}")
    if not trust:
        raise InvalidArgumentError(
            f"teacher={file!r} is not loaded: loading can run any code on this machine; add "
            "--trust if you trust its author"
        )
    note = observes(file)
    observed = note.get("observation", "markov")
    if has_images(observed):
        raise InvalidArgumentError("teacher", name, f"a state policy; this one observes {observed}")
    acting = {"actor": note["actor"]} if "actor" in note else {}
    return {"teacher": file, "privileged": "+".join(names_of(observed)), **acting}
