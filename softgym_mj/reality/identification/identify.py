"""Identification: from recordings to parameters with intervals, and what held-out ones say."""

import dataclasses
import pathlib
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from softgym_mj.exceptions import StoreError, check_count
from softgym_mj.jobs.executors import Executor
from softgym_mj.jobs.store import JSON, Store
from softgym_mj.reality.identification.confidence import intervals
from softgym_mj.reality.identification.recordings import HELD_OUT
from softgym_mj.reality.identification.search import EVALUATIONS, Found, Progress, Search, together
from softgym_mj.reality.identification.tasks import Task, evaluate, motions, slip
from softgym_mj.reality.identification.unknowns import (
    LATENCY,
    UNKNOWNS,
    bounds,
    coordinates_of,
    fabric_of,
    values_at,
    values_of,
)

SEEDS = 3
LOOKS = 2  # At finer meshes: the second one where the first has led to.
FACTOR = 2.0  # Upper over lower end of an interval, above which a number is not identified.
WIDEST = 0.033  # [s] The same of latency: a frame.
REACH = 0.1  # [s] Of latency around where a first look finds it.
SLIPPED = 0.015  # [s] From the common latency, above which a recording's clock is off,
_NOTICED = 0.95  # if its loss is at most this share of that at the common one.
_AS_GOOD = 1.05  # Searches whose loss is at most so many times the least are averaged.


@dataclasses.dataclass(frozen=True)
class Start:
    """Where searches of a task start.

    Attributes:
        coordinates: (unknowns,).
        bounds: (unknowns, 2).
    """

    coordinates: np.ndarray
    bounds: np.ndarray


def first_look(task: Task) -> Start:
    """Starts at the task's own fabric, and at the latency at which what is fitted fits it best."""
    moved = motions(task.only_fitted(), task.base)
    latency = slip(task.fitted, [moved[recording.scene] for recording in task.fitted])
    start = coordinates_of(values_of(task.base, latency))
    return Start(start, bounds(latency, REACH))


def make_search(task: Task, start: Start, seed: int, evaluations: int = EVALUATIONS) -> Search:
    """A search of a task, which looks at finer meshes in the end if there are any."""
    looks = LOOKS if task.finer else 0
    return Search(start.coordinates, start.bounds, seed, evaluations, looks)


def identify(
    task: Task,
    executor: Executor,
    seeds: Sequence[int] = tuple(range(SEEDS)),
    evaluations: int = EVALUATIONS,
    store: Store | None = None,
    progress: Progress = lambda made: None,
) -> dict[str, Any]:
    """Looks for the parameters with which a task's recordings are met best.

    Args:
        task: recordings, and a fabric to start from.
        executor: that makes evaluations.
        seeds: of the searches, one each.
        evaluations: of a search.
        store: for journals of the searches, so that they go on where they were stopped.
        progress: as of `together`.

    Returns:
        As of `report`.

    Raises:
        InvalidArgumentError: for no seeds, or too few evaluations.
        StoreError: for journals of other work.
    """
    check_count("seeds", len(seeds), 1)
    start, fitted = first_look(task), task.only_fitted()
    searches = {seed: make_search(task, start, seed, evaluations) for seed in seeds}
    journals = {} if store is None else {seed: store.journal(seed) for seed in seeds}
    together(searches, lambda seed, *at: (fitted, *at), evaluate, executor, journals, progress)
    return report(task, start, [search.found() for search in searches.values()])


def report(task: Task, start: Start, searches: Sequence[Found]) -> dict[str, Any]:
    """What searches of a task say.

    Returns:
        "parameters": by name "value", "low" and "high" (95 %), "start", "unit", "is_identified"
            and, for numbers that recordings only bound, "at_least" or "at_most"; "fit", "held_out":
            distances [m] "found", "start" (the fabric to start from, at its first latency) and by
            recording; "clocks": by recording the latency [s] at which it fits best, its distance
            there, and whether that is `SLIPPED` from the common one and noticed; "searches": the
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
    """As of `report`."""
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
    """Distances [m] of what is fitted and of what is held out."""
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
    """As of `report`: a clock is off if it is by enough, and losses notice."""
    found = {}
    for recording in task.recordings:
        motion = moved[recording.scene]
        best = slip([recording], [motion])
        there, here = (float(recording.distances(motion, t).mean()) for t in (best, latency))
        found[recording.name] = {
            "latency": best,
            "slip": best - latency,
            "loss": there,
            "has_slipped": abs(best - latency) > SLIPPED and there < _NOTICED * here,
        }
    return found


def open_store(folder: pathlib.Path, settings: Mapping[str, Any]) -> Store:
    """A store of journals in a folder, for work of these settings alone.

    Raises:
        StoreError: if the folder is of other settings.
    """
    store = Store(folder, settings, JSON)
    if others := store.differences():
        raise StoreError(f"{folder} holds a search of other settings: {', '.join(others)}")
    store.claim()
    return store
