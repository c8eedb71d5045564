"""Rates of all versions of docs/throughput.json and docs/gpu.json as docs/rates.csv.

Usage: python -m tools.rate_history
"""

import csv
import json
import pathlib
import subprocess
from collections.abc import Iterator
from typing import Any

ROOT = pathlib.Path(__file__).parent.parent
FILE = ROOT / "docs" / "rates.csv"
COLUMNS = (
    "date", "commit", "processor", "humanoid_mj_steps_per_second", "task", "environments",
    "env_steps_per_second",
)  # fmt: skip
Row = tuple[str, str, int, str]  # humanoid_mj_steps_per_second, task, and so on.


def cores(found: Any) -> Iterator[Row]:
    """Yields rates of single environments on a core, from docs/throughput.json."""
    speed = found["machine"].get("humanoid_mj_steps_per_second")
    for task, own in found["tasks"].items():
        yield f"{speed:.0f}" if speed else "", task, 1, f"{own['env_steps_per_second']:.0f}"


def gpus(found: Any) -> Iterator[Row]:
    """Yields rates by task and number of environments, from docs/gpu.json."""
    for task, by_number in found["rates"].items():
        for number, own in by_number.items():
            yield "", task, int(number), f"{own['env_steps_per_s']:.0f}"


SOURCES = {"throughput": ("processor", cores), "gpu": ("gpu", gpus)}


def _git(*arguments: str) -> str:
    return subprocess.run(
        ["git", *arguments], cwd=ROOT, check=True, capture_output=True, text=True
    ).stdout


def history() -> Iterator[tuple[str | int, ...]]:
    """Yields rows from the newest commit to the oldest."""
    for name, (machine, rows) in SOURCES.items():
        file = f"docs/{name}.json"
        for line in _git("log", "--format=%as %h", "--", file).splitlines():
            date, commit = line.split()
            found = json.loads(_git("show", f"{commit}:{file}"))
            for row in rows(found):
                yield date, commit, found["machine"][machine], *row


def main() -> None:
    """Writes the file."""
    with FILE.open("w", newline="") as file:
        writer = csv.writer(file, lineterminator="\n")
        writer.writerows([COLUMNS, *history()])


if __name__ == "__main__":
    main()
