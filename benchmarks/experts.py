"""How well the scripted experts do with every actor, over many evaluation variations.

    python benchmarks/experts.py straighten_rope fold_cloth --jobs 2 --out benchmarks/experts.json

The same command goes on where it was stopped, with the scores in `--folder`. `make sheets` shows
docs/experts.json in README and docs.
"""

import argparse
import json
import os
import pathlib
import statistics
from collections.abc import Iterable

import mujoco

import softgym_mj
from softgym_mj.envs.environment import Environment
from softgym_mj.jobs.executors import make_executor
from softgym_mj.jobs.store import JSON, Store
from softgym_mj.policies.factory import make_policy
from softgym_mj.robots.models import ARMS

ACTORS = ("default", *ARMS)  # Pickers or cups, arms.
FIRST, LAST = 800, 999  # Evaluation variations.

Scores = dict[str, dict[str, dict[str, float]]]  # By task, actor and variation.

_environments: dict[tuple[str, str], Environment] = {}


def score(task: str, actor: str, variation: int) -> float:
    """Normalised performance at the end of an episode of the expert."""
    key = task, actor
    if key not in _environments:
        settings = {} if actor == "default" else {"actor": actor}
        _environments[key] = softgym_mj.load(task, split="all", **settings)
    env = _environments[key]
    timestep = env.reset(variation)
    policy = make_policy("scripted", env, 0)
    while not timestep.last():
        timestep = env.step(policy(timestep))
    return env.info()["normalized_performance"]


def table(scores: Scores) -> str:
    """Means, standard errors and smallest scores of the actors that have played, as Markdown.

    And the number of variations.
    """
    played = [actor for actor in ACTORS if any(actor in actors for actors in scores.values())]
    titles = ["abstract actor" if actor == "default" else f"`{actor}`" for actor in played]
    lines = [f"| task | {' | '.join(titles)} |", "|---" * (1 + len(played)) + "|"]
    for task, actors in scores.items():
        cells = []
        for actor in played:
            if actor not in actors:
                cells.append("not yet played")
                continue
            values = list(actors[actor].values())
            error = statistics.stdev(values) / len(values) ** 0.5
            mean, number = statistics.mean(values), len(values)
            cells.append(f"{mean:.3f} ± {error:.3f} ({min(values):.2f}), {number}")
        lines.append(f"| `{task}` | {' | '.join(cells)} |")
    return "\n".join(lines)


def play(
    tasks: Iterable[str],
    actors: Iterable[str],
    variations: Iterable[int],
    jobs: int,
    folder: pathlib.Path,
) -> Scores:
    """The scores of tasks with actors; plays those that `folder` lacks."""
    versions = {"softgym_mj": softgym_mj.__version__, "mujoco": mujoco.__version__}
    store = Store(folder, versions, JSON)
    keys = [(task, actor, v) for v in variations for task in tasks for actor in actors]
    with make_executor(jobs) as executor:
        found: dict[tuple[str, str, int], float] = {}
        store.run(keys, score, executor, found.__setitem__)
    scores: Scores = {}
    for task, actor, variation in keys:
        value = found[task, actor, variation]
        scores.setdefault(task, {}).setdefault(actor, {})[str(variation)] = value
    return scores


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("tasks", nargs="*", help="all if none is named")
    parser.add_argument("--actors", nargs="+", choices=ACTORS, default=ACTORS)
    parser.add_argument("--every", type=int, default=3, help="play every n-th variation")
    parser.add_argument("--jobs", type=int, default=1)
    parser.add_argument("--folder", type=pathlib.Path, default=pathlib.Path("build/experts"))
    parser.add_argument("--out", type=pathlib.Path, required=True)
    arguments = parser.parse_args()
    os.environ.setdefault("MUJOCO_GL", "disable")
    variations = range(FIRST, LAST + 1, arguments.every)
    tasks = arguments.tasks or list(softgym_mj.TASKS)
    scores = play(tasks, arguments.actors, variations, arguments.jobs, arguments.folder)
    arguments.out.write_text(json.dumps(scores, indent=1))
    print(table(scores))


if __name__ == "__main__":
    main()
