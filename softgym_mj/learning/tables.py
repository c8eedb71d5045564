"""Tables of learned results: statistics over seeds, with published scores of others."""

from collections.abc import Iterable, Sequence
from typing import Any

import numpy as np

from softgym_mj.evaluation.statistics import summary
from softgym_mj.learning.results import Reference, Row

# Statistics that need several seeds.
_SPREAD = "percentile_25", "percentile_75", "mean_low", "mean_high", "iqm_low", "iqm_high"


def table(rows: Iterable[Row], references: Sequence[Reference] = ()) -> list[dict[str, Any]]:
    """Returns statistics of final held-out scores for each name and number of env steps.

    Args:
        rows: Rows of all evaluations.
        references: Scores of others.

    Returns:
        Fields of `Name`; number of `seeds`; `env_steps`; medians of `updates`, `episodes` and `gap`
        (train minus held-out); `minutes` of all seeds, where equal `seconds` are of one training;
        `statistics.summary` of the seeds' means; `published`, the score of others for the same
        task, method and observation at the nearest number of env steps. Unknown values, such as
        quartiles of one seed, are None.
    """
    result: dict[tuple, dict[str, list[Row]]] = {}
    for row in (row for row in rows if row.final):
        splits = result.setdefault((row.name, row.env_steps), {"train": [], "evaluate": []})
        splits[row.split].append(row)
    lines = []
    for (name, env_steps), splits in result.items():
        if not (held_out := splits["evaluate"]):
            continue
        trained = {row.seed: row.normalized_performance for row in splits["train"]}
        gaps = [trained[r.seed] - r.normalized_performance for r in held_out if r.seed in trained]
        seconds = {row.seconds for row in held_out if row.seconds is not None}
        known = {
            abs((r.env_steps or env_steps) - env_steps): r.value
            for r in references
            if r.bound == "is" and r.compares(name)
        }
        lines.append({
            **name._asdict(),
            "seeds": len(held_out),
            "env_steps": env_steps,
            "updates": int(np.median([row.updates for row in held_out])),
            "minutes": sum(seconds) / 60 if seconds else None,
            "episodes": int(np.median([row.episodes for row in held_out])),
            **summary([{**vars(row), "variation": None} for row in held_out]),
            **dict.fromkeys(_SPREAD if len(held_out) == 1 else ()),
            "gap": float(np.median(gaps)) if gaps else None,
            "published": known[min(known)] if known else None,
        })  # fmt: skip
    return lines
