"""The commands `softgym-mj evaluate` and `softgym-mj plot`."""

import json
import pathlib
import time
from typing import Annotated, Any

import rich.progress
import rich.table
import typer

from softgym_mj.baselines.cem import BUDGET, ITERATIONS, PLANNERS, Plan
from softgym_mj.console import Ray, Task, console, progress_bar
from softgym_mj.exceptions import OutOfRangeError
from softgym_mj.registry import TASKS, find


def evaluate(
    task: Task,
    policy: Annotated[
        str,
        typer.Option(help="scripted, random, zero, cem, icem, FILE.pt2 or MODULE:FUNCTION."),
    ] = "scripted",
    episodes: Annotated[int, typer.Option(help="Evaluation variations, from the first on.")] = 10,
    seeds: Annotated[int, typer.Option(help="Seeds 0.. of the policy.", min=1)] = 1,
    horizon: Annotated[
        int | None, typer.Option(help="Env steps that a plan looks ahead; the task's if not given.")
    ] = None,
    budget: Annotated[int, typer.Option(help="Env steps for a decision of a planner.")] = BUDGET,
    iterations: Annotated[int, typer.Option(help="Of a planner.")] = ITERATIONS,
    replan_every: Annotated[int, typer.Option(help="Env steps that a plan is executed for.")] = 1,
    settings: Annotated[
        str,
        typer.Option(
            help='Arguments of the task as JSON: \'{"actor": "franka", "grasp": "friction"}\'.'
        ),
    ] = "{}",
    jobs: Annotated[int, typer.Option(help="Worker processes.", min=1)] = 1,
    ray: Ray = None,
    out: Annotated[pathlib.Path, typer.Option(help="Folder of this evaluation.")] = pathlib.Path(
        "evaluation"
    ),
) -> None:
    """Scores a policy as the paper does; may be killed and run again."""
    from softgym_mj import evaluation
    from softgym_mj.workers import make_workers

    planning = evaluation.Planning(horizon, budget, iterations, replan_every)
    configuration = evaluation.Configuration(
        find(task).name,
        policy,
        evaluation.evaluation_variations(episodes),
        tuple(range(seeds)),
        _parsed(settings),
        planning if policy in PLANNERS else None,
    )
    try:
        with _Bar(configuration) as bar, make_workers(jobs, ray) as workers:
            result = evaluation.evaluate(configuration, out, workers, bar.progress())
    except KeyboardInterrupt:
        console.print(f"interrupted; {out} keeps what is done: the same command goes on from it")
        raise typer.Exit(130) from None
    console.print(
        f"{configuration.task}, {policy}: median {result['summary']['median']:.3f}, "
        f"mean {result['summary']['mean']:.3f} (min {result['summary']['min']:.3f}); "
        f"wrote {out / 'result.json'}"
    )


def plot(
    results: Annotated[list[pathlib.Path], typer.Argument(help="result.json files or folders.")],
    x: Annotated[
        str | None, typer.Option(help="Curves over horizon, budget or replan_every; bars if not.")
    ] = None,
    out: Annotated[pathlib.Path, typer.Option(help="Picture to write.")] = pathlib.Path(
        "results.png"
    ),
) -> None:
    """Draws the results of evaluations; prints them as a table."""
    from softgym_mj import plots

    read = plots.read_results(results)
    if x is None:
        plots.bars(read, out)
    else:
        plots.curves(read, x, out)
    table = rich.table.Table("task", "policy", "median", "25 %", "75 %", "mean", "episodes")
    for result, name in zip(read, plots.labels(read), strict=True):
        numbers = [f"{value:.3f}" for value in (*plots.spread(result), result["summary"]["mean"])]
        table.add_row(result["task"], name, *numbers, str(len(result["episodes"])))
    console.print(table)
    console.print(f"wrote {out}")


def _parsed(settings: str) -> dict[str, Any]:
    try:
        parsed = json.loads(settings)
    except ValueError:
        parsed = None
    if not isinstance(parsed, dict):
        raise OutOfRangeError("settings", settings, "a JSON object")
    return parsed


class _Bar:
    """A progress bar: episodes, for planners the decisions too."""

    def __init__(self, configuration):
        self._configuration = configuration
        self._bar = progress_bar(rich.progress.TextColumn("{task.fields[note]}"))
        planning, settings = configuration.planning, configuration.settings
        steps = settings.get("horizon") or TASKS[configuration.task].horizon
        # Of an episode.
        self._decisions = -(-steps // planning.replan_every) if planning else 1
        self._env_steps, self._start = 0, time.perf_counter()
        self._scores: list[float] = []

    def __enter__(self):
        self._bar.start()
        self._bar_id = self._bar.add_task(
            "decisions" if self._decisions > 1 else "episodes",
            total=len(self._configuration.episodes) * self._decisions,
            note="",
        )
        return self

    def __exit__(self, *error):
        self._bar.stop()

    def progress(self):
        """What to tell the evaluation to call."""
        from softgym_mj.evaluation import Progress

        return Progress(self._on_episode, self._on_decision)

    def _on_episode(self, episode: dict) -> None:
        self._scores.append(episode["normalized_performance"])
        mean = sum(self._scores) / len(self._scores)
        done = len(self._scores) * self._decisions
        self._bar.update(self._bar_id, completed=done, note=f"mean {mean:.3f}")

    def _on_decision(self, plan: Plan) -> None:
        self._env_steps += plan.env_steps
        rate = self._env_steps / (time.perf_counter() - self._start)
        note = f"best return {plan.best_return:.3f}, {rate:.0f} env steps/s"
        self._bar.update(self._bar_id, advance=1, note=note)
