"""The commands `softgym-mj generate` and `softgym-mj record`."""

import pathlib
from typing import Annotated

import typer

from softgym_mj.console import Actor, Grasp, Ray, Task, acting, console, progress_bar
from softgym_mj.exceptions import OutOfRangeError
from softgym_mj.registry import find
from softgym_mj.variations import split_indices
from softgym_mj.workers import make_workers


def generate(
    task: Task,
    start: Annotated[int, typer.Option(help="First variation.")] = 0,
    num: Annotated[int, typer.Option(help="Number of variations.")] = 1000,
    jobs: Annotated[int, typer.Option(help="Worker processes.")] = 1,
    ray: Ray = None,
    fidelity: Annotated[str, typer.Option(help="Resolution of cloth and water.")] = "default",
    pack: Annotated[
        pathlib.Path | None, typer.Option(help="Also write all 1000 into this file.")
    ] = None,
) -> None:
    """Generates settled initial states into the cache; may be killed and run again."""
    record = find(task)
    settings = {"fidelity": fidelity} if "fidelity" in record.arguments else {}
    from softgym_mj.tasks.stored_task import StoredTask  # dm_control takes a second to import.

    built = record.build(**settings)
    if not isinstance(built, StoredTask):
        raise OutOfRangeError("task", record.name, "a task that keeps its initial states")
    store = built.store
    with make_workers(jobs, ray) as workers, progress_bar() as progress:
        bar = progress.add_task(f"{record.name} variations", total=num)
        made = store.generate_missing(
            range(start, start + num), workers, lambda index: progress.advance(bar)
        )
    console.print(f"{made} generated, {num - made} were there, in {store.folder}")
    if pack is not None:
        store.pack(pack)
        console.print(f"packed into {pack} ({pack.stat().st_size / 1e6:.2f} MB)")


def record(
    task: Task,
    policy: Annotated[
        str, typer.Option(help="scripted, random, zero, FILE.pt2 or MODULE:FUNCTION.")
    ] = "scripted",
    actor: Actor = None,
    grasp: Grasp = None,
    split: Annotated[str, typer.Option(help="train, evaluate or all.")] = "train",
    episodes: Annotated[int, typer.Option(help="Variations, from the first on.", min=1)] = 10,
    observation: Annotated[str, typer.Option(help="Observations, with commas.")] = "reduced",
    seed: Annotated[int, typer.Option(help="Seed of the random policy.")] = 0,
    dataset: Annotated[
        str | None,
        typer.Option(help="Id; softgym_mj/TASK/POLICY[-ACTOR][-GRASP]-v0 if not given."),
    ] = None,
) -> None:
    """Records episodes as a Minari dataset, one a variation."""
    from softgym_mj import recording

    variations = list(split_indices(split))[:episodes]
    with progress_bar() as progress:
        bar = progress.add_task(task, total=len(variations))
        made = recording.record(
            task,
            variations,
            policy,
            dataset=dataset,
            seed=seed,
            on_episode=lambda info: progress.advance(bar),
            observation=observation.split(","),
            **acting(actor, grasp),
        )
    console.print(
        f"recorded {made.total_episodes} episodes, {made.total_steps} steps; "
        f"minari.load_dataset({made.spec.dataset_id!r})"
    )
