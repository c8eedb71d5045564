"""What limits the kernels that step environments on a GPU, by counters of NVIDIA's Nsight Compute.

    python -m benchmarks.gpu_limits --out docs/gpu_limits.json

For one CUDA device and `ncu`. Each task takes random actions in 1,056 environments; counters are
means of `LAUNCHES` sim steps after `SKIPPED` ones. `ncu` replays a launch for each group of them.
"""

import argparse
import csv
import json
import pathlib
import subprocess
import sys

import softgym_mj
from benchmarks.gpu import MAIN, actions_of, machine, variations

TASKS = ("straighten_rope", "fold_cloth", "spread_cloth", "pour_water", "transport_water")
SKIPPED, LAUNCHES, ENV_STEPS = 40, 2, 8
FEW = 32  # Variations: each start takes time to read.
_SHARE = "avg.pct_of_peak_sustained_elapsed"
# Counters by name in the results; those without a unit are shares of the card's limit [%].
COUNTERS = {
    "ns": "gpu__time_duration.sum",
    "threads": "launch__block_size",
    "registers": "launch__registers_per_thread",
    "shared_bytes": "launch__shared_mem_per_block_dynamic",
    "warps": "sm__warps_active.avg.pct_of_peak_sustained_active",
    "lanes": "smsp__thread_inst_executed_per_inst_executed.ratio",
    "issue": "smsp__issue_active.avg.pct_of_peak_sustained_active",
    "fp64": f"sm__inst_executed_pipe_fp64.{_SHARE}",
    "l1": f"l1tex__throughput.{_SHARE}",
    "l2": f"lts__throughput.{_SHARE}",
    "dram": f"dram__throughput.{_SHARE}",
}
# Reasons for which a warp waits: numbers of waiting warps per issued instruction.
_STALL = "smsp__average_warps_issue_stalled_{}_per_issue_active.ratio"
REASONS = (
    "barrier", "branch_resolve", "dispatch_stall", "drain", "imc_miss", "lg_throttle",
    "long_scoreboard", "math_pipe_throttle", "membar", "mio_throttle", "misc", "no_instruction",
    "not_selected", "selected", "short_scoreboard", "sleeping", "tex_throttle", "wait",
)  # fmt: skip


def play(task: str) -> None:
    """Plays random actions in a batch, for `ncu` to look at."""
    envs = softgym_mj.make_vec(task, MAIN, device="cuda", split=range(800, 800 + FEW))
    envs.reset(seed=0, options={"variation": variations(MAIN, FEW), "stagger": True})
    for action in actions_of(envs, ENV_STEPS):
        envs.step(action)
    envs.close()


def counters(task: str) -> dict[str, float | dict[str, float]]:
    """Counters of a task's kernel, and shares of the reasons for which its warps wait."""
    stalls = {name: _STALL.format(name) for name in REASONS}
    command = ["ncu", "--csv", "--page", "raw", "--print-units", "base"]
    command += ["--graph-profiling", "node"]
    command += ["--kernel-name", "Step", "--launch-skip", str(SKIPPED)]
    command += ["--launch-count", str(LAUNCHES), "--clock-control", "none", "--metrics"]
    command += [",".join((*COUNTERS.values(), *stalls.values()))]
    command += [sys.executable, "-m", "benchmarks.gpu_limits", "--play", task]
    told = subprocess.run(command, check=False, capture_output=True, text=True)
    lines = [line for line in told.stdout.splitlines() if line.startswith('"')]
    if told.returncode or len(lines) < 3:  # Names, units, and a line for each launch.
        raise SystemExit(f"ncu failed for {task}: {told.stdout[-2000:]}{told.stderr[-2000:]}")
    rows = list(csv.DictReader([lines[0], *lines[2:]]))

    def mean(counter: str) -> float:
        return sum(float(row[counter].replace(",", "")) for row in rows) / len(rows)

    found: dict[str, float | dict[str, float]] = {
        name: round(mean(counter), 2) for name, counter in COUNTERS.items()
    }
    waits = {name: mean(counter) for name, counter in stalls.items() if counter in rows[0]}
    whole = sum(waits.values())
    found["waits"] = {name: round(100.0 * wait / whole, 1) for name, wait in waits.items()}
    return found


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--tasks", nargs="+", default=TASKS)
    parser.add_argument("--out", type=pathlib.Path)
    parser.add_argument("--play", help=argparse.SUPPRESS)
    arguments = parser.parse_args()
    if arguments.play:
        play(arguments.play)
        return
    found = {"machine": machine(), "tasks": {}}
    for task in arguments.tasks:
        found["tasks"][task] = counters(task)
        print(task, found["tasks"][task], flush=True)
        if arguments.out:
            arguments.out.write_text(json.dumps(found, indent=1) + "\n")


if __name__ == "__main__":
    main()
