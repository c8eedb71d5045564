"""Curves: how well each seed did, a row of each evaluation and split."""

import csv
import io
import pathlib
from collections.abc import Mapping, Sequence
from typing import Any

from softgym_mj.jobs.files import write_whole

COLUMNS = (
    "task", "method", "observation", "preset", "replay", "seed", "env_steps", "updates", "seconds",
    "split", "episodes", "normalized_performance", "success", "final",
)  # fmt: skip
FILE = "curve.csv"  # In the folder of a training.


def write_curve(folder: pathlib.Path, rows: Sequence[Mapping[str, Any]]) -> None:
    """Writes rows by `COLUMNS` to `folder`/curve.csv: all of it or nothing."""
    text = io.StringIO(newline="")
    writer = csv.DictWriter(text, COLUMNS, lineterminator="\n")
    writer.writeheader()
    writer.writerows(rows)
    write_whole(folder / FILE, text.getvalue().encode())
