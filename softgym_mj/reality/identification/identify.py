"""Identification: from recordings to parameters with intervals, checked on held-out recordings."""

import dataclasses
import pathlib
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from softgym_mj.exceptions import StoreError, check_count
from softgym_mj.parallel.executors import Executor
from softgym_mj.reality.identification.confidence import intervals
from softgym_mj.reality.identification.recordings import HELD_OUT
from softgym_mj.reality.identification.search import (
    EVALUATIONS,
    Progress,
    Search,
    SearchResult,
    run_searches,
)
from softgym_mj.reality.identification.tasks import Task, best_latency, evaluate, motions
from softgym_mj.reality.identification.unknowns import (
    LATENCY,
    UNKNOWNS,
    bounds,
    coordinates_of,
    fabric_of,
    values_at,
    values_of,
)
from softgym_mj.storage.store import JSON, Store

SEEDS = 3
REFINEMENTS = 2  # Evaluations on the finer mesh: the second one checks the result of the first.
FACTOR = 2.0  # Ratio of the ends of an interval above which a parameter is not identified.
WIDEST = 0.033  # [s] The same limit for latency: one frame.
REACH = 0.1  # [s] Range of latency around its first estimate.
# [s] Difference from the common latency above which a recording's clock is off,
CLOCK_TOLERANCE = 0.015
_NOTICED = 0.95  # provided that its loss is at most this share of that at the common latency.
_AS_GOOD = 1.05  # Searches with a loss of at most this many times the least are averaged.


@dataclasses.dataclass(frozen=True)
class Start:
    """Start of a task's searches.

    Attributes:
        coordinates: (unknowns,).
        bounds: (unknowns, 2).
    """

    coordinates: np.ndarray
    bounds: np.ndarray


def make_start(task: Task) -> Start:
    """Returns a start at the task's base fabric and the latency that fits its recordings best."""
    moved = motions(task.only_fitted(), task.base)
    latency = best_latency(task.fitted, [moved[recording.scene] for recording in task.fitted])
    start = coordinates_of(values_of(task.base, latency))
    return Start(start, bounds(latency, REACH))


def make_search(task: Task, start: Start, seed: int, evaluations: int = EVALUATIONS) -> Search:
    """Returns a search of a task; it ends with evaluations on finer meshes if the task has any."""
    refinements = REFINEMENTS if task.finer else 0
    return Search(start.coordinates, start.bounds, seed, evaluations, refinements)


def identify(
    task: Task,
    executor: Executor,
    seeds: Sequence[int] = tuple(range(SEEDS)),
    evaluations: int = EVALUATIONS,
    store: Store | None = None,
    progress: Progress = lambda made: None,
) -> dict[str, Any]:
    """Searches for the parameters that fit a task's recordings best.

    Args:
        task: recordings and a fabric to start from.
        executor: makes the evaluations.
        seeds: one for each search.
        evaluations: largest number of evaluations of a search.
        store: keeps journals of the searches, so that an interrupted search continues.
        progress: called after every generation, as in `run_searches`.

    Returns:
        The dict that `report` describes.

    Raises:
        InvalidArgumentError: for no seeds, or too few evaluations.
        StoreError: for journals of other settings.
    """
    check_count("seeds", len(seeds), 1)
    start, fitted = make_start(task), task.only_fitted()
    searches = {seed: make_search(task, start, seed, evaluations) for seed in seeds}
    journals = {} if store is None else {seed: store.journal(seed) for seed in seeds}
    run_searches(searches, lambda seed, *at: (fitted, *at), evaluate, executor, journals, progress)
    return report(task, start, [search.result() for search in searches.values()])


def report(task: Task, start: Start, searches: Sequence[SearchResult]) -> dict[str, Any]:
    """Summarizes the searches of a task.

    Returns:
        "parameters": by name "value", "low" and "high" (95 %), "start", "unit", "is_identified"
        and, for parameters that recordings only bound, "at_least" or "at_most". "fit", "held_out":
        distances [m] "found", "start" (the base fabric at its first latency) and by recording.
        "clocks": by recording the latency [s] that fits it best, its distance there, and whether
        that is more than `CLOCK_TOLERANCE` from the common one and lowers the loss. "searches": the
        least loss [m] and the values of each.
    """
    least = min(found.loss for found in searches)
    good = [found.estimate for found in searches if found.loss <= _AS_GOOD * least]
    estimate = np.mean(good, axis=0)
    lengths = [len(recording.times) for recording in task.fitted]
    ranges = intervals(list(searches), estimate, start.bounds, lengths)
    values = values_at(estimate)
    moved = motions(task, fabric_of(values, task.base))
    before = motions(task, task.base)
    first = values_at(start.coordinates)
    return {
        "parameters": _parameters(estimate, ranges, first, start.bounds),
        "not_identified": [
            u.name for u, row in zip(UNKNOWNS, ranges, strict=True) if not _is_identified(u, row)
        ],
        "density": task.base.density,
        **_losses(task, moved, values[LATENCY], before, first[LATENCY]),
        "clocks": _clocks(task, moved, values[LATENCY]),
        "searches": [
            {"loss": found.loss, "evaluations": found.evaluations, **values_at(found.estimate)}
            for found in searches
        ],
    }


def _is_identified(unknown, coordinates: np.ndarray) -> bool:
    low, high = (unknown.value(float(x)) for x in coordinates)
    if unknown.is_only_bounded:
        return False
    return high <= FACTOR * low if unknown.is_logarithmic else high - low <= WIDEST


def _parameters(estimate, ranges, first: Mapping[str, float], limits) -> dict[str, Any]:
    """Returns the entry "parameters" of `report`."""
    found: dict[str, Any] = {}
    for unknown, x, row, edge in zip(UNKNOWNS, estimate, ranges, limits, strict=True):
        low, high = (unknown.value(float(end)) for end in row)
        entry: dict[str, Any] = {
            "value": unknown.value(float(x)), "low": low, "high": high,
            "start": first[unknown.name], "unit": unknown.unit, "summary": unknown.summary,
            "is_identified": _is_identified(unknown, row),
        }  # fmt: skip
        if row[0] > edge[0] and (row[1] >= edge[1] or unknown.is_only_bounded):
            entry["at_least"] = low
        if row[0] <= edge[0] and row[1] < edge[1]:
            entry["at_most"] = high
        found[unknown.name] = entry
    return found


def _losses(task: Task, moved, latency: float, before, first: float) -> dict[str, Any]:
    """Returns distances [m] of fitted and of held-out recordings."""
    found: dict[str, Any] = {}
    for name, role in (("fit", "fit"), ("held_out", HELD_OUT)):
        rows = {
            r.name: {
                "found": float(r.distances(moved[r.scene], latency).mean()),
                "start": float(r.distances(before[r.scene], first).mean()),
            }
            for r in task.recordings
            if r.role == role
        }
        means = {
            key: float(np.mean([row[key] for row in rows.values()])) if rows else None
            for key in ("found", "start")
        }
        found[name] = {**means, "recordings": rows}
    return found


def _clocks(task: Task, moved, latency: float) -> dict[str, Any]:
    """Returns the entry "clocks" of `report`."""
    found = {}
    for recording in task.recordings:
        motion = moved[recording.scene]
        best = best_latency([recording], [motion])
        there, here = (float(recording.distances(motion, t).mean()) for t in (best, latency))
        found[recording.name] = {
            "latency": best,
            "clock_error": best - latency,
            "loss": there,
            "is_clock_off": abs(best - latency) > CLOCK_TOLERANCE and there < _NOTICED * here,
        }
    return found


def open_store(folder: pathlib.Path, settings: Mapping[str, Any]) -> Store:
    """Opens a store of journals in a folder, for one combination of settings.

    Raises:
        StoreError: if the folder has other settings.
    """
    store = Store(folder, settings, JSON)
    if others := store.differences():
        raise StoreError(f"{folder} holds a search of other settings: {', '.join(others)}")
    store.claim()
    return store
