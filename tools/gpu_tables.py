"""Tables of environments on a GPU: docs/gpu*.json and docs/pictures.json."""

import json
import pathlib
from collections.abc import Callable, Mapping
from typing import Any

from softgym_mj.registry import DOMAIN, TASKS, task_names
from tools.pages import table

DOCS = pathlib.Path(__file__).parent.parent / "docs"
_NUMBERS = "16", "128", "1056"  # Of environments in `cores`.


def measured(name: str) -> Any:
    """Returns the content of docs/<name>.json."""
    return json.loads((DOCS / f"{name}.json").read_text())


def rates() -> str:
    """Env steps per second on a core and on a GPU, and the memory of most environments."""
    found, on_cores = measured("gpu"), measured("throughput")
    numbers = sorted({int(number) for own in found["rates"].values() for number in own})
    rows = []
    for task in task_names(DOMAIN):
        by_number = found["rates"].get(task, {})
        own = [by_number.get(str(number)) for number in numbers]
        on_core = on_cores["tasks"][task]["env_steps_per_second"]
        cells = [f"{rate['env_steps_per_s']:,.0f}" if rate else "not yet" for rate in own]
        cells.insert(0, f"{on_core:,.0f}")
        cells.append(f"{own[-1]['memory_gb']:.1f}" if own[-1] else "")
        rows.append(f"| `{task}` | {' | '.join(cells)} |".replace("|  |", "| |"))
    head = " | ".join(f"{number:,}" for number in numbers)
    compiled = sum(found["compile_s"].values())
    machine = found["machine"]
    return (
        f"{table(f'| task | one CPU core | {head} | GB of {numbers[-1]:,} |', rows)}\n\n"
        f"{machine['gpu']}, PyTorch {machine['torch']}; compiling the kernels took "
        f"{compiled:.0f} s. Core: {on_cores['machine']['processor']}."
    )


def cores() -> str:
    """CPU cores that make as many env steps per second as a GPU, least to most of the tasks."""
    found, on_cores = measured("gpu")["rates"], measured("throughput")["tasks"]
    rows = []
    for material in ("rope", "cloth", "water"):
        own = [task for task in task_names(DOMAIN) if material in TASKS[task].tags]
        cells = []
        for number in _NUMBERS:
            ratios = sorted(
                found[task][number]["env_steps_per_s"] / on_cores[task]["env_steps_per_second"]
                for task in own
            )
            cells.append(f"{ratios[0]:.1f} to {ratios[-1]:.1f}")
        rows.append(f"| {material} | {' | '.join(cells)} |")
    heads = " | ".join(f"{int(number):,} environments" for number in _NUMBERS)
    return table(f"| material | {heads} |", rows)


def arms() -> str:
    """Env steps per second with a Franka, and the memory of most environments."""
    found = measured("gpu_arms")
    rows = []
    for task, by_number in found["rates"].items():
        cells = [f"{rate['env_steps_per_s']:,.0f}" for rate in by_number.values()]
        most = list(by_number.values())[-1]
        cells.append(f"{most['memory_gb'] + most['jax_memory_gb']:.1f}")
        rows.append(f"| `{task}` | {' | '.join(cells)} |")
    numbers = [f"{int(number):,}" for number in by_number]
    return table(f"| task | {' | '.join(numbers)} | GB of {numbers[-1]} |", rows)


def images() -> str:
    """Env steps per second with images, and how alike images are."""
    found, alike = measured("gpu").get("images", {}), measured("pictures")
    rows = []
    for task in task_names(DOMAIN):
        cells = ["not yet"] * 3
        if task in found:
            without, own = (found[task][name]["env_steps_per_s"] for name in ("without", "with"))
            cells = [f"{without:,.0f}", f"{own:,.0f}", f"{100 * own / without:.0f} %"]
        if task in alike:
            overlap = alike[task]["overlap"]["object"]
            cells += [f"{overlap['mean']:.3f} ({overlap['least']:.3f})"]
            cells += [f"{alike[task]['rgb_mean_difference']:.1f}"]
        else:
            cells += ["not yet"] * 2
        rows.append(f"| `{task}` | {' | '.join(cells)} |")
    rates = "env steps/s without images | with rgb | with / without"
    head = f"| task | {rates} | overlap, mean (least) | difference in color |"
    return table(head, rows)


def bits() -> str:
    """Table of bitwise comparisons of GPU and CPU."""
    found = measured("gpu")["bits"]
    rows = []
    for task, own in found.items():
        kept = ("same_in_another_run", "same_among_others")
        words = ["yes" if own[name] else "no" for name in kept]
        apart = f"{own['of_processor_largest_difference']:.1g}"
        rows.append(f"| `{task}` | {' | '.join(words)} | {apart} |")
    titles = "same in a second run | beside other environments | largest difference from the CPU"
    return table(f"| task | {titles} |", rows)


def planner() -> str:
    """Seconds of a decision of CEM with true dynamics, beside those of a core of a CPU."""
    rows, on_core = [], measured("throughput")["tasks"]
    for task, own in measured("gpu_planner").items():
        seconds, env_steps = own["seconds"], own["env_steps"]
        first, rest = seconds[0], sum(seconds[1:]) / len(seconds[1:])
        core = env_steps / on_core[task]["env_steps_per_second"]
        rows.append(f"| `{task}` | {env_steps:,} | {first:.1f} | {rest:.1f} | {core:.0f} |")
    head = "| task | env steps of a decision | first [s] | later ones, mean [s] | one core [s] |"
    return table(head, rows)


def long() -> str:
    """Many env steps in a row: rate and memory at first and at last."""
    runs = measured("gpu_steps").values()
    gains = [run["env_steps_per_s"][-1] / run["env_steps_per_s"][1] for run in runs]
    growth = max(run["memory_gb"][-1] - run["memory_gb"][0] for run in runs)
    return (
        f"{sum(run['env_steps'] for run in runs):,} env steps of {len(runs)} tasks: the last tenth "
        f"of a run is\n{min(gains):.2f} to {max(gains):.2f} times as fast as its second tenth, and "
        f"memory grows by {growth:.2f} GB ([figures](gpu_steps.json))."
    )


# Reasons of `benchmarks.gpu_limits` for which warps wait, in words; the others are "other".
WAITS = {
    "barrier": "barriers",
    "long_scoreboard": "memory",
    "wait": "arithmetic",
    "no_instruction": "instructions",
}


def limits() -> str:
    """Shares of the GPU's limits that kernels reach, and for what their warps wait."""
    found, rows = measured("gpu_limits"), []
    for task, own in found["tasks"].items():
        cells = [f"{own['ns'] / 1e6:.1f}", f"{own['threads']:.0f}", f"{own['lanes']:.0f}"]
        cells += [f"{own[name]:.0f} %" for name in ("warps", "issue", "fp64", "l1", "l2", "dram")]
        waits = sorted(WAITS, key=own["waits"].__getitem__, reverse=True)[:3]
        cells.append(", ".join(f"{WAITS[name]} {own['waits'][name]:.0f} %" for name in waits))
        rows.append(f"| `{task}` | {' | '.join(cells)} |")
    shares = "resident warps | issue slots | FP64 | L1 | L2 | DRAM"
    head = f"| task | ms | threads | active lanes of 32 | {shares} | warps wait for |"
    return f"{table(head, rows)}\n\n{found['machine']['gpu']}."


# Tables of docs/gpu.md, and of docs/gpu_kernels.md.
RATES: Mapping[str, Callable[[], str]] = {
    "cores": cores,
    "rates": rates,
    "arms": arms,
    "images": images,
    "planner": planner,
}
DETAILS: Mapping[str, Callable[[], str]] = {"limits": limits, "bits": bits, "long": long}
