"""Plays the evaluations of docs/results again, with the configurations that are in them.

    OMP_NUM_THREADS=1 python benchmarks/results.py spread_cloth fold_cloth --jobs 2

All tasks take an hour and a half of two cores. The same command goes on where it was stopped, with
the episodes in `--folder`; `make sheets` shows the results in docs/results.md.
"""

import argparse
import json
import os
import pathlib
import shutil

import softgym_mj
from softgym_mj.evaluation import Configuration, Planning, evaluate
from softgym_mj.parallel.executors import make_executor

RESULTS = pathlib.Path(__file__).parent.parent / "docs" / "results"


def configuration(result: dict) -> Configuration:
    """That of a result."""
    planning = result["planning"] and Planning(**result["planning"])
    keys = ("variations", "seeds")
    variations, seeds = (tuple(result[key]) for key in keys)
    task, policy, settings = (result[key] for key in ("task", "policy", "settings"))
    return Configuration(task, policy, variations, seeds, settings, planning)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("tasks", nargs="*", default=list(softgym_mj.TASKS), help="else all")
    parser.add_argument("--jobs", type=int, default=1)
    parser.add_argument("--folder", type=pathlib.Path, default="evaluations")
    arguments = parser.parse_args()
    os.environ.setdefault("MUJOCO_GL", "disable")
    for file in sorted(RESULTS.glob("*.json")):
        result = json.loads(file.read_text())
        if result["task"] not in arguments.tasks:
            continue
        folder = arguments.folder / file.stem
        with make_executor(arguments.jobs) as executor:
            found = evaluate(configuration(result), folder, executor)
        shutil.copy(folder / "result.json", file)
        old, new = (r["summary"]["mean"] for r in (result, found))
        print(f"{file.stem}: {old:.3f} before, {new:.3f} now", flush=True)


if __name__ == "__main__":
    main()
