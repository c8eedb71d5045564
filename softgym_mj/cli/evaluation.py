"""The commands `softgym-mj evaluate` and `softgym-mj plot`."""

import contextlib
import pathlib
import time
from collections.abc import Iterator
from typing import TYPE_CHECKING, Annotated

import rich.progress
import rich.table
import typer

from softgym_mj.cli.console import (
    Actor,
    Device,
    Grasp,
    Jobs,
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
from softgym_mj.envs.load import horizon_of
from softgym_mj.exceptions import check_count
from softgym_mj.policies.factory import SIMPLE
from softgym_mj.policies.planners import BUDGET, ITERATIONS, PLANNERS, Plan
from softgym_mj.registry import find
from softgym_mj.storage.files import write_csv

if TYPE_CHECKING:
    from softgym_mj.evaluation import Configuration, Progress

_EPISODES = 10  # Default number of episodes of an evaluation.


def evaluate(
    task: Task,
    policy: Annotated[
        str,
        typer.Option(
            help=f"{', '.join((*SIMPLE, *PLANNERS))}, FILE.pt2 or MODULE:FUNCTION; "
            "FILE_{seed}.pt2 for one file per seed; the name of a file in docs/results/policies of "
            "a clone."
        ),
    ] = "scripted",
    trust: Trust = False,
    actor: Actor = None,
    grasp: Grasp = None,
    split: Annotated[str | None, typer.Option(help="evaluate (default), train or all.")] = None,
    episodes: Annotated[
        int | None,
        typer.Option(help=f"Number of variations from the split's first; default: {_EPISODES}."),
    ] = None,
    variations: Variations = None,
    seeds: Annotated[
        int, typer.Option(help="Number of seeds of the policy, from 0 on.", min=1, max=1000)
    ] = 1,
    horizon: Annotated[
        int | None,
        typer.Option(help="Planning horizon (cem, icem) in env steps; default: the task's."),
    ] = None,
    budget: Annotated[int, typer.Option(help="Simulated env steps per decision.")] = BUDGET,
    iterations: Annotated[int, typer.Option(help="Planner iterations per decision.")] = ITERATIONS,
    replan_every: Annotated[
        int, typer.Option(help="Env steps between two decisions of a planner.")
    ] = 1,
    task_settings: TaskSettings = "{}",
    jobs: Jobs = 1,
    ray: Ray = None,
    device: Device = "cpu",
    out: Annotated[pathlib.Path, typer.Option(help="Folder of this evaluation.")] = pathlib.Path(
        "evaluation"
    ),
) -> None:
    """Scores a policy by SoftGym's protocol. The same command continues one that was stopped."""
    from softgym_mj import evaluation
    from softgym_mj.parallel.executors import make_executor

    policy = policy_file(policy)
    planning = evaluation.Planning(horizon, budget, iterations, replan_every)
    configuration = evaluation.Configuration(
        find(task).name,
        policy,
        chosen_variations(variations, split, episodes, ("evaluate", _EPISODES)),
        tuple(range(seeds)),
        combined(parsed_settings(task_settings), "task_settings", actor=actor, grasp=grasp),
        planning if policy in PLANNERS or planning != evaluation.Planning() else None,
    )
    try:
        with progress_of(configuration) as progress, make_executor(jobs, ray) as executor:
            result = evaluation.evaluate(
                configuration, out, executor, progress, trust=trust, device=device
            )
    except KeyboardInterrupt:
        message = f"{out} has the finished episodes: the same command continues from them"
        raise KeyboardInterrupt(message) from None
    numbers = result["summary"]
    console.print(
        f"{configuration.task}, {policy}: mean {numbers['mean']:.3f} "
        f"(95 %: {numbers['mean_low']:.3f} to {numbers['mean_high']:.3f}), "
        f"median {result['methods']['quartiles']} {numbers['median']:.3f}, "
        f"min {numbers['min']:.3f}; wrote {out / 'result.json'}"
    )


def plot(
    results: Annotated[list[pathlib.Path], typer.Argument(help="result.json files or folders.")],
    out: Annotated[pathlib.Path, typer.Option(help="Picture to write.")] = pathlib.Path(
        "results.png"
    ),
    csv: Annotated[
        pathlib.Path | None, typer.Option(help="Also write the table, with all numbers.")
    ] = None,
    markdown: Annotated[
        bool, typer.Option("--markdown", help="Print a Markdown table of means (minima).")
    ] = False,
) -> None:
    """Draws the results of evaluations; prints them as a table."""
    from softgym_mj.evaluation import comparison, plots

    read = comparison.read_results(results)
    rows = comparison.rows(read)
    plots.bars(read, out)
    if csv is not None:
        write_csv(csv, list(rows[0]), rows)
    if markdown:
        typer.echo(comparison.markdown(read))
    else:
        console.print(_table(rows))
    for file in filter(None, (out, csv)):
        console.print(f"wrote {file}")


def _table(rows: list[dict]) -> rich.table.Table:
    """Returns the columns that fit into 80 characters; the CSV file has all."""
    table = rich.table.Table(show_lines=True)
    for title in ("task", "policy"):
        table.add_column(title, overflow="fold")
    for title in ("mean\n95 %", "median\nquartiles", "over", "episodes"):
        table.add_column(title, no_wrap=True)
    for row in rows:
        table.add_row(
            row["task"],
            row["policy"],
            f"{row['mean']:.3f}\n{row['mean_low']:.2f}..{row['mean_high']:.2f}",
            f"{row['median']:.3f}\n{row['percentile_25']:.2f}..{row['percentile_75']:.2f}",
            row["quartiles_over"],
            str(row["episodes"]),
        )
    return table


@contextlib.contextmanager
def progress_of(configuration: "Configuration") -> Iterator["Progress"]:
    """Shows a bar of episodes, or of a planner's decisions; yields the callbacks that move it."""
    from softgym_mj.evaluation import Progress

    planning = configuration.planning
    steps = horizon_of(configuration.task, configuration.settings)
    check_count("horizon", steps, 1)
    decisions = -(-steps // planning.replan_every) if planning else 1  # Per episode.
    scores: list[float] = []
    env_steps, start = 0, time.perf_counter()

    def on_episode(episode: dict) -> None:
        scores.append(episode["normalized_performance"])
        done, mean = len(scores) * decisions, sum(scores) / len(scores)
        bar.update(shown, completed=done, note=f"mean {mean:.3f}")

    def on_decision(plan: Plan) -> None:
        nonlocal env_steps
        env_steps += plan.env_steps
        rate = env_steps / (time.perf_counter() - start)
        note = f"best return {plan.best_return:.3f}, {rate:.0f} env steps/s"
        bar.update(shown, advance=1, note=note)

    def on_step(step: int) -> None:
        bar.update(shown, note=f"env step {step} of {steps}")

    with progress_bar(rich.progress.TextColumn("{task.fields[note]}", markup=False)) as bar:
        name = "decisions" if decisions > 1 else "episodes"
        shown = bar.add_task(name, total=len(configuration.episodes) * decisions, note="")
        yield Progress(on_episode, on_decision, on_step)
