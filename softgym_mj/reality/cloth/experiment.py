"""Errors of solvers on recordings of a cloth."""

import dataclasses
import time
from collections.abc import Sequence

import numpy as np

from softgym_mj.exceptions import check_count
from softgym_mj.reality.cloth.recordings import Recording
from softgym_mj.reality.cloth.scenario import Grip, Scenario, is_at_rest, is_complete, scenario_of
from softgym_mj.reality.solver import Solver

EVERY = 4  # Every fourth recording is a test recording.


@dataclasses.dataclass(frozen=True)
class Measurement:
    """Errors of a solver over recordings.

    Attributes:
        solver: Name of the solver.
        models: Effects that the solver models.
        recordings: Number of recordings.
        error: Mean distance [m] of nodes, over counted frames: mean over recordings.
        held_error: The same over nodes of the held edge, which the tool moves: error of the
            tracker, the clocks and the tool's pose.
        far_error: The same over nodes of the opposite edge.
        worst: Largest `error` of a recording [m].
        error_of_complete: `error` over all frames with all nodes, also those that do not count.
        real_time_factor: Simulated over CPU time.
    """

    solver: str
    models: tuple[str, ...]
    recordings: int
    error: float
    held_error: float
    far_error: float
    worst: float
    error_of_complete: float
    real_time_factor: float


@dataclasses.dataclass(frozen=True)
class Quality:
    """Quality of recordings.

    Attributes:
        frames: Number of frames.
        complete: Number of those with all nodes.
        counted: Number of those that count.
        noise: Mean distance [m] of nodes from their mean, over counted frames before the tool
            moves, and thus without the errors of the clocks and most errors of the tracker.
    """

    frames: int
    complete: int
    counted: int
    noise: float


def split(recordings: Sequence[Recording]) -> tuple[list[Recording], list[Recording]]:
    """Returns the recordings for identification and those for tests, every fourth.

    Raises:
        InvalidArgumentError: For less than four recordings.
    """
    check_count("recordings", len(recordings), EVERY)
    first = [r for i, r in enumerate(recordings) if i % EVERY != EVERY - 1]
    return first, list(recordings[EVERY - 1 :: EVERY])


def measure(solver: Solver[Scenario], recordings: Sequence[Recording], grip: Grip) -> Measurement:
    """Predicts recordings and compares."""
    found, took, simulated = [], 0.0, 0.0
    for recording in recordings:
        scenario, nodes = scenario_of(recording, grip)
        before = time.thread_time()
        off = _distances(solver.predict(scenario), nodes)
        took += time.thread_time() - before
        simulated += float(scenario.times[-1])
        scenario, nodes = scenario_of(recording, grip, every=True)
        every = _distances(solver.predict(scenario), nodes).mean()
        found.append((off.mean(), off[:, :, 0].mean(), off[:, :, -1].mean(), every))
    error, held, far, every = map(float, np.mean(found, axis=0))
    return Measurement(
        solver=solver.name,
        models=solver.models,
        recordings=len(recordings),
        error=error,
        held_error=held,
        far_error=far,
        worst=float(max(row[0] for row in found)),
        error_of_complete=every,
        real_time_factor=simulated / max(took, 1e-9),
    )


def _distances(predicted: np.ndarray, nodes: np.ndarray) -> np.ndarray:
    """Returns distances (f, n, n) [m] of nodes (f, n, n, 3) [m]."""
    return np.linalg.norm(predicted - nodes, axis=3)


def quality(recordings: Sequence[Recording], grip: Grip) -> Quality:
    """Returns the quality of recordings."""
    counted, off = 0, []
    for recording in recordings:
        scenario, nodes = scenario_of(recording, grip)
        counted += len(nodes) + 1
        resting = nodes[is_at_rest(recording, scenario.times)]
        if len(resting):
            off.append(_distances(resting, resting.mean(axis=0)).ravel())
    complete = sum(int(is_complete(r).sum()) for r in recordings)
    noise = float(np.concatenate(off).mean()) if off else float("nan")
    return Quality(sum(len(r.nodes) for r in recordings), complete, counted, noise)
