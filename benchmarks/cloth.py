"""What cloth and rope cost and how well they keep their shape, here and in another checkout.

    python -m benchmarks.cloth --reference ../softgym_mj-before --out benchmarks/cloth.json

Both packages run in one process each and take turns, so that whatever else the machine does hits
both alike: ratios mean more than times. The reference is a checkout with a virtual environment of
its own in .venv, or one that this interpreter can import. Without it only this package is measured.

Times are milliseconds of the thread's CPU time inside `mj_step`, a sim step of 10 ms.

fold: a square cloth lies flat for a second and is folded by two pickers. Lift, carry and lower are
    the thirds of their way, release is the first 0.3 s after they open, rest the next 0.7 s, fold
    all of lower, release and rest.
pile: a vertex is lifted by 0.6 m at 1 m/s, held for 1.5 s and let go of; the last 2 s of 6 s.
tasks: env steps in a second of CPU time, in episodes of the scripted expert and of pickers that
    move at random, as fast as they can, and keep closed.

strain_99 is the 99th percentile of an edge's elongation, largest in a fold, and hits are
intersections of an edge with a triangle, most at a time.

The yardstick is the speed of dm_control's humanoid, without any of this, on the same core.
"""

import argparse
import contextlib
import itertools
import json
import os
import pathlib
import platform
import statistics
import subprocess
import sys
import tempfile
from collections.abc import Sequence

from benchmarks import cloth_worker
from benchmarks.cloth_worker import DIMS, Figures

SPEEDS = (0.6, 1.73)  # [m/s] Pickers: the experts' speed, and full speed along three axes.
CLOTH_TASKS = ("spread_cloth", "fold_cloth", "drop_cloth", "fold_crumpled_cloth", "drop_fold_cloth")
ROPE_TASKS = ("straighten_rope", "rope_configuration")
FIRST_VARIATION = 800
HERE, REFERENCE = "here", "reference"
ROOT = pathlib.Path(__file__).resolve().parent.parent


class Worker:
    """A process that measures the package of a checkout."""

    def __init__(self, checkout: pathlib.Path | None, cache: str):
        """Starts it; `cache` is a folder for initial states, None the checkout of this file."""
        environment = {**os.environ, "OMP_NUM_THREADS": "1", "SOFTGYM_MJ_CACHE": cache}
        python = sys.executable
        if checkout is None:
            paths = [str(ROOT), *filter(None, [os.environ.get("PYTHONPATH")])]
            environment["PYTHONPATH"] = os.pathsep.join(paths)
        else:
            environment["PYTHONPATH"] = str(checkout)
            own = [checkout / ".venv" / place for place in ("bin/python", "Scripts/python.exe")]
            python = str(next(filter(pathlib.Path.exists, own), python))
        self._process = subprocess.Popen(
            [python, cloth_worker.__file__], env=environment, cwd=checkout or ROOT, text=True,
            stdin=subprocess.PIPE, stdout=subprocess.PIPE,
        )  # fmt: skip

    def measure(self, *request) -> Figures:
        """One measurement."""
        self._process.stdin.write(json.dumps(request) + "\n")
        self._process.stdin.flush()
        line = self._process.stdout.readline()
        if not line:
            raise RuntimeError(f"{request}: the process ended with {self._process.wait()}")
        return json.loads(line)

    def __enter__(self) -> "Worker":
        return self

    def __exit__(self, *_) -> None:
        self._process.stdin.close()
        self._process.wait()


def ratio(name: str, here: float, reference: float) -> float:
    """How many times as fast this package is."""
    return reference / here if name.endswith("_ms") else here / reference


def compare(workers: dict[str, Worker], requests: Sequence[tuple]) -> dict[str, Figures]:
    """Medians over requests of the same kind, by package, and of the ratios of their speeds."""
    rounds: dict[str, list[Figures]] = {name: [] for name in workers}
    for request in requests:
        for name, worker in workers.items():
            rounds[name].append(worker.measure(*request))
    if REFERENCE in rounds:
        rounds["ratio"] = [
            {name: ratio(name, here[name], there[name]) for name in here if timed(name)}
            for here, there in zip(rounds[HERE], rounds[REFERENCE], strict=True)
        ]
    return {
        name: {key: statistics.median(figures[key] for figures in found) for key in found[0]}
        for name, found in rounds.items()
    }


def timed(name: str) -> bool:
    """Whether a figure is a time or a rate."""
    return name.endswith(("_ms", "steps/s"))


def machine() -> dict[str, object]:
    """What this runs on."""
    processor = platform.processor()
    with contextlib.suppress(OSError):
        lines = pathlib.Path("/proc/cpuinfo").read_text().splitlines()
        processor = next(line.split(":")[1].strip() for line in lines if "model name" in line)
    return {"processor": processor, "cores": os.cpu_count(), "system": platform.platform(),
            "load_average": os.getloadavg()[0]}  # fmt: skip


FOLD_TIMES = ("flat_ms", "lift_ms", "carry_ms", "fold_ms", "all_ms")


def table(results: dict) -> str:
    """The results as tables of Markdown: this package, the reference, and how many times as fast.

    Args:
        results: what `main` writes as JSON.
    """
    pairs = lambda found, name, form: " / ".join(  # noqa: E731
        format(found[package][name], form) for package in (HERE, REFERENCE) if package in found
    )
    blocks = []
    rows = [["vertices", "speed, m/s", *(name[:-3] + ", ms" for name in FOLD_TIMES),
             "times as fast", "p99 strain, %", "lowest, mm", "hits"]]  # fmt: skip
    for found in results["fold"]:
        rows.append([
            f"{found['size']} x {found['size']}", f"{found['speed']}",
            *(pairs(found, name, ".2f") for name in FOLD_TIMES),
            f"{found['ratio']['all_ms']:.1f}" if "ratio" in found else "",
            " / ".join(f"{100 * found[package]['strain_99']:.1f}"
                       for package in (HERE, REFERENCE) if package in found),
            pairs(found, "lowest_mm", ".1f"), pairs(found, "hits", ".0f"),
        ])  # fmt: skip
    blocks.append(rows)
    rows = [["vertices", "lift, ms", "hang, ms", "fall, ms", "pile, ms", "times as fast",
             "drift, mm/s", "lowest, mm", "hits"]]  # fmt: skip
    for found in results["pile"]:
        times = ("lift_ms", "hang_ms", "fall_ms", "pile_ms")
        rows.append([
            f"{found['size']} x {found['size']}", *(pairs(found, name, ".2f") for name in times),
            f"{found['ratio']['pile_ms']:.1f}" if "ratio" in found else "",
            pairs(found, "drift_mm/s", ".3f"), pairs(found, "lowest_mm", ".1f"),
            pairs(found, "hits", ".0f"),
        ])  # fmt: skip
    blocks.append(rows)
    rows = [["task", "actions", "env steps/s", "times as fast", "score"]]
    for found in results["task"]:
        rows.append([
            found["task"], found["policy"], pairs(found, "env_steps/s", ".0f"),
            f"{found['ratio']['env_steps/s']:.1f}" if "ratio" in found else "",
            pairs(found, "score", ".2f") if found["policy"] == "expert" else "",
        ])  # fmt: skip
    blocks.append(rows)
    texts = []
    for first, *others in (block for block in blocks if len(block) > 1):
        lines = [first, ["---"] * len(first), *others]
        texts.append("\n".join("| " + " | ".join(line) + " |" for line in lines))
    where = results["machine"]
    texts.append(
        f"{where['processor']}; dm_control's humanoid makes "
        f"{results['yardstick'][HERE]['mj_steps/s']:,.0f} mj_steps/s on one core of it."
    )
    return "\n\n".join(texts)


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--reference", type=pathlib.Path, help="another checkout")
    parser.add_argument("--out", type=pathlib.Path)
    parser.add_argument("--parts", nargs="+", choices=("fold", "pile", "task"))
    parser.add_argument("--sizes", type=int, nargs="+", choices=DIMS)
    parser.add_argument("--repeats", type=int, default=3, help="of folds; piles once")
    parser.add_argument("--variations", type=int, default=3, help="of each task")
    parser.add_argument("--quick", action="store_true", help="one size, one task of each kind")
    arguments = parser.parse_args()
    parts = arguments.parts or ("fold", "pile", "task")
    sizes = arguments.sizes or ((21,) if arguments.quick else tuple(DIMS))
    tasks = ("fold_cloth", "straighten_rope") if arguments.quick else CLOTH_TASKS + ROPE_TASKS
    repeats, variations = arguments.repeats, arguments.variations
    if arguments.quick:
        repeats = variations = 1
    results: dict = {"machine": machine(), "fold": [], "pile": [], "task": []}
    jobs: list[tuple[dict, list[tuple]]] = []
    if "fold" in parts:
        for size, speed in itertools.product(sizes, SPEEDS):
            jobs.append(({"part": "fold", "size": size, "speed": speed},
                         [("fold", size, speed)] * repeats))  # fmt: skip
    if "pile" in parts:
        jobs += [({"part": "pile", "size": size}, [("pile", size)]) for size in sizes]
    if "task" in parts:
        for task, policy in itertools.product(tasks, ("expert", "random")):
            requests = [("task", task, policy, FIRST_VARIATION + i) for i in range(variations)]
            jobs.append(({"part": "task", "task": task, "policy": policy}, requests))
    yardsticks = []
    with contextlib.ExitStack() as stack:
        workers = {}
        for name, checkout in ((HERE, None), (REFERENCE, arguments.reference)):
            if name == HERE or checkout:
                cache = stack.enter_context(tempfile.TemporaryDirectory())
                place = checkout.resolve() if checkout else None
                workers[name] = stack.enter_context(Worker(place, cache))
        for labels, requests in jobs:
            yardsticks.append(compare(workers, [("yardstick",)]))
            found = {**labels, **compare(workers, requests)}
            results[labels["part"]].append(found)
            print(json.dumps(found), file=sys.stderr, flush=True)
    results["yardstick"] = {
        name: {"mj_steps/s": statistics.median(found[name]["mj_steps/s"] for found in yardsticks)}
        for name in workers
    }
    print(table(results))
    if arguments.out:
        arguments.out.write_text(json.dumps(results, indent=2) + "\n")


if __name__ == "__main__":
    main()
