"""Scores on the hidden categories of `softgym_plus`, of experts and published policies.

    python -m benchmarks.hidden --jobs 2

The same command goes on where it was stopped. Scores are written to docs/hidden.json, which
`make sheets` shows in docs/softgym_plus.md. All take an hour of a core.
"""

import argparse
import pathlib

from softgym_mj.evaluation import Configuration, evaluate
from softgym_mj.parallel.executors import make_executor
from softgym_mj.policies.exported import observes
from softgym_mj.storage.files import write_json
from softgym_mj.variations.indices import SPLITS

DOCS = pathlib.Path(__file__).parent.parent / "docs"
POLICIES = DOCS / "results" / "policies"
FILE = DOCS / "hidden.json"
# Arguments of tasks that select the hidden category.
HIDDEN = {
    "fold_shirt": {"cuts": "unseen"},
    "hang_cloth": {"bars": "unseen"},
    "route_cable": {"routes": "unseen"},
}
# Strides of variations. The expert of `route_cable` rehearses, which takes seconds an episode.
STRIDES = {("route_cable", "scripted"): 5}


def policies(task: str) -> dict[str, pathlib.Path]:
    """Returns the published policies of a task with pickers, by name."""
    files = sorted(POLICIES.glob(f"{task}-*.pt2"))
    return {file.stem: file for file in files if "actor" not in observes(str(file))}


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--jobs", type=int, default=1)
    parser.add_argument("--folder", type=pathlib.Path, default="hidden")
    told = parser.parse_args()
    found: dict[str, dict[str, dict[str, float]]] = {}
    for task, settings in HIDDEN.items():
        for name, policy in {"scripted": "scripted", **policies(task)}.items():
            variations = tuple(SPLITS["evaluate"])[:: STRIDES.get((task, name), 1)]
            case = Configuration(task, str(policy), variations, settings=settings)
            with make_executor(told.jobs) as executor:
                result = evaluate(case, told.folder / task / name, executor, trust=True)
            summary = result["summary"]
            kept = {key: summary[key] for key in ("mean", "min", "success_rate")}
            found.setdefault(task, {})[name] = {**kept, "episodes": len(result["episodes"])}
            print(task, name, found[task][name], flush=True)
    write_json(FILE, found)


if __name__ == "__main__":
    main()
