"""The commands `softgym-mj generate` and `softgym-mj record`."""

import inspect
from collections.abc import Sequence
from typing import Annotated, Any

import typer

from softgym_mj.cli.console import (
    Actor,
    Device,
    Grasp,
    Jobs,
    Look,
    Ray,
    Task,
    TaskSettings,
    Trust,
    Variations,
    chosen_variations,
    combined,
    console,
    parsed_settings,
    policy_file,
    progress_bar,
)
from softgym_mj.exceptions import InvalidArgumentError, check_name
from softgym_mj.parallel.executors import make_executor
from softgym_mj.policies.factory import SIMPLE
from softgym_mj.registry import TASKS, find
from softgym_mj.variations.indices import NUM_VARIATIONS, check_variation
from softgym_mj.vector.make import DEVICES, make_device

ALL = "all"  # Stands for all tasks of this package.


def generate(
    task: Task,
    start: Annotated[int, typer.Option(help="First variation.")] = 0,
    num: Annotated[int, typer.Option(help="Number of variations.", min=1)] = NUM_VARIATIONS,
    jobs: Jobs = 1,
    ray: Ray = None,
    device: Device = "cpu",
    fidelity: Annotated[
        str, typer.Option(help="Resolution: fast, default or accurate.")
    ] = "default",
) -> None:
    """Generates settled initial states in the cache, unless the package ships them.

    The same command continues a stopped one.
    """
    check_name("device", device, DEVICES)
    indices = [check_variation(index) for index in range(start, start + num)]
    batch_device = None if device == "cpu" else make_device(device, num)
    record = find(task)
    settings = {"fidelity": fidelity} if "fidelity" in record.arguments else {}
    store = record.build(**settings).store
    if store is None:
        raise InvalidArgumentError("task", record.name, "a task that stores its initial states")
    if store.shipped() is not None:
        console.print(f"the package ships the initial states of {record.name}: none are generated")
        return
    with make_executor(jobs, ray) as executor, progress_bar() as progress:
        bar = progress.add_task(f"{record.name} variations", total=num)
        made = store.generate_missing(
            indices, executor, lambda index: progress.advance(bar), batch_device
        )
    console.print(f"generated {made}, found {num - made}, in {store.folder}")


def record(
    task: Task,
    policy: Annotated[
        str, typer.Option(help=f"{', '.join(SIMPLE)}, FILE.pt2 or MODULE:FUNCTION.")
    ] = "scripted",
    actor: Actor = None,
    grasp: Grasp = None,
    split: Annotated[str | None, typer.Option(help="train (default), evaluate or all.")] = None,
    episodes: Annotated[
        int | None, typer.Option(help="Number of variations to play; default: 10.")
    ] = None,
    variations: Variations = None,
    observation: Annotated[
        str | None,
        typer.Option(
            help="Observations, separated by commas; default: reduced, for lerobot also "
            "proprioception."
        ),
    ] = None,
    look: Look = None,
    task_settings: TaskSettings = "{}",
    seed: Annotated[int, typer.Option(help="Seed of the random policy and noise.", min=0)] = 0,
    trust: Trust = False,
    successful_only: Annotated[
        bool, typer.Option("--successful-only", help="Leave out episodes without success.")
    ] = False,
    idle: Annotated[
        str, typer.Option(help="Steps after the expert has finished: keep or drop.")
    ] = "keep",
    noise: Annotated[
        float,
        typer.Option(
            help="Standard deviation of noise on actions; infos have the expert's own actions."
        ),
    ] = 0.0,
    jobs: Jobs = 1,
    dataset: Annotated[
        str | None,
        typer.Option(help="Id; softgym_mj/TASK/POLICY[-ACTOR][-GRASP][-NOISE]-v0 if not given."),
    ] = None,
    format: Annotated[str, typer.Option(help="minari or lerobot.")] = "minari",
    codec: Annotated[
        str | None,
        typer.Option(help="Codec of LeRobot's images: videos, AV1 if not given, or png."),
    ] = None,
    author: Annotated[str | None, typer.Option(help="Author of a Minari dataset.")] = None,
    author_email: Annotated[str | None, typer.Option(help="E-mail of the author.")] = None,
    code_permalink: Annotated[
        str | None, typer.Option(help="URL of the code, in the version that was run.")
    ] = None,
) -> None:
    """Records a dataset, one episode per variation. The same command continues a stopped one.

    TASK `all` records a dataset of each task, except those that exist with the same settings.
    """
    from softgym_mj import recording

    played = chosen_variations(variations, split, episodes, ("train", 10))
    chosen = combined(
        parsed_settings(task_settings),
        "task_settings",
        actor=actor,
        grasp=grasp,
        look=look,
        observation=None if observation is None else observation.split(","),
    )
    chosen.setdefault("observation", recording.make_format(format, codec).observation)
    for name in inspect.signature(recording.record).parameters:
        if name in chosen:
            valid = f"arguments of the task; not {name!r}"
            raise InvalidArgumentError("task_settings", task_settings, valid)
    if task == ALL and dataset is not None:
        raise InvalidArgumentError(
            "dataset", dataset, "None with task 'all': each id contains its task"
        )
    how: dict[str, Any] = {
        "policy": policy_file(policy),
        "format": format,
        "codec": codec,
        "seed": seed,
        "trust": trust,
        "successful_only": successful_only,
        "idle": idle,
        "noise": noise,
        "jobs": jobs,
        "author": author,
        "author_email": author_email,
        "code_permalink": code_permalink,
        **chosen,
    }
    everything = [name for name, known in TASKS.items() if not known.is_custom]
    for name in everything if task == ALL else [task]:
        _record(name, played, dataset=dataset, **how)


def _record(task: str, variations: Sequence[int], **how: Any) -> None:
    """Records a dataset, with a progress bar; prints a summary.

    Args:
        task, variations, how: Arguments of `recording.record`.
    """
    from softgym_mj import recording

    finished = []
    try:
        with progress_bar() as progress:
            bar = progress.add_task(task, total=len(variations))

            def on_episode(info: dict) -> None:
                finished.append(info)
                progress.advance(bar)

            made = recording.record(task, variations, on_episode=on_episode, **how)
    except KeyboardInterrupt:
        message = f"{len(finished)} episodes of {task} are stored"
        if finished:
            from softgym_mj.evaluation.indices import as_text

            done = as_text(int(info["variation"]) for info in finished)
            message += f"; --variations {done} makes a dataset of them alone"
        raise KeyboardInterrupt(f"{message}: the same command continues from them") from None
    episodes, steps, call = recording.make_format(how["format"]).summary(made)
    dropped = f"; dropped {len(variations) - episodes} without success"
    plural = "s" * (episodes != 1)
    console.print(
        f"{'recorded' if finished else 'exists already:'} {episodes} episode{plural}, {steps} steps"
        f"{dropped if how['successful_only'] else ''}; {call}"
    )
