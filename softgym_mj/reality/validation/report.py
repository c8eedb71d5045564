"""Writes what was measured: a CSV of all frames, a JSON of cases and groups."""

import csv
import dataclasses
import math
import pathlib
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from softgym_mj.jobs.files import whole, write_json
from softgym_mj.reality.validation.baselines import rank
from softgym_mj.reality.validation.cases import Case

Baselines = Mapping[str, Mapping[str, float]]


def summary(
    cases: Sequence[Case],
    primary: str,
    baselines: Baselines,
    settings: Mapping[str, Any],
    missing: Sequence[str],
) -> dict[str, Any]:
    """What is worth knowing of cases, JSON-able; numbers that are none are None.

    Args:
        cases: in any order.
        primary: the column by which groups are ranked.
        baselines: published ones, by group or by the last part of its name.
        settings: what was simulated.
        missing: what the data set ought to have had besides.
    """
    groups = {name: [c for c in cases if c.group == name] for name in _unique(cases)}
    return {
        "settings": dict(settings),
        "missing": list(missing),
        "primary": primary,
        "cases": {case.name: of_case(case) for case in cases},
        "groups": {
            name: of_group(name, members, primary, baselines) for name, members in groups.items()
        },
    }


def of_case(case: Case) -> dict[str, Any]:
    """Means over the frames that count of a case, and what else is known of it."""
    return {
        "group": case.group,
        "frames": len(case.times),
        "counted": int(case.counted.sum()),
        "means": {name: number(case.mean(name)) for name in case.columns},
        "strain_99_max": number(_extreme(case.columns.get("strain_99"), np.nanmax)),
        "lowest_min": number(_extreme(case.columns.get("lowest"), np.nanmin)),
        "jitter": number(case.jitter),
        "failures": [
            {k: number(v) for k, v in dataclasses.asdict(f).items()} for f in case.failures
        ],
        "notes": list(case.notes),
    }


def of_group(
    name: str, members: Sequence[Case], primary: str, baselines: Baselines
) -> dict[str, Any]:
    """Mean and standard deviation (of the members, n - 1) of each column's means, and the rank."""
    columns = dict.fromkeys(column for case in members for column in case.columns)
    spread = {}
    for column in columns:
        means = [case.mean(column) for case in members if column in case.columns]
        deviation = float(np.std(means, ddof=1)) if len(means) > 1 else math.nan
        spread[column] = {"mean": number(float(np.mean(means))), "sd": number(deviation)}
    others = baselines.get(name) or baselines.get(name.rpartition("/")[2])
    ranked = None
    if others and spread.get(primary):
        value = spread[primary]["mean"]
        place = None if value is None else rank(value, others)
        ranked = {"rank": place, "of": 1 + len(others), "baselines": dict(others)}
    return {"cases": [case.name for case in members], "columns": spread, "ranked": ranked}


def write(
    cases: Sequence[Case], found: Mapping[str, Any], folder: pathlib.Path
) -> tuple[pathlib.Path, pathlib.Path]:
    """Writes `frames.csv`, of all cases, and `report.json`, a `summary`; returns these files.

    Raises:
        StoreError: if they cannot be written.
    """
    frames, report = folder / "frames.csv", folder / "report.json"
    names = list(dict.fromkeys(name for case in cases for name in case.columns))
    with whole(frames) as partial, partial.open("w", newline="", encoding="utf-8") as file:
        writer = csv.writer(file)
        writer.writerow(["case", "frame", "time", "counted", *names])
        for case in cases:
            for i, time in enumerate(case.times):
                values = (case.columns[n][i] if n in case.columns else math.nan for n in names)
                cells = ("" if math.isnan(value) else repr(float(value)) for value in values)
                row = [case.name, i, repr(float(time)), int(case.counted[i]), *cells]
                writer.writerow(row)
    write_json(report, found)
    return frames, report


def number(value: Any) -> Any:
    """A value as JSON has it: None for a number that is none."""
    return None if isinstance(value, float) and not math.isfinite(value) else value


def _extreme(column: np.ndarray | None, which: Any) -> float:
    finite = column is not None and np.isfinite(column).any()
    return float(which(column)) if finite else math.nan


def _unique(cases: Sequence[Case]) -> list[str]:
    return list(dict.fromkeys(case.group for case in cases))
