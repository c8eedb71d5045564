"""`Case`: a recording and what was replayed of it, frame by frame."""

import dataclasses
from collections.abc import Callable, Mapping, Sequence

import numpy as np

from softgym_mj.exceptions import InvalidArgumentError
from softgym_mj.reality import metrics
from softgym_mj.reality.meshes import Mesh
from softgym_mj.reality.recorder import Failure, Replay
from softgym_mj.reality.surfaces import SurfaceSamples, seen
from softgym_mj.rendering.calibration import Calibration

# A published measure: of simulated points (n, 3) and real ones (m, 3) [m], by names of columns.
Measure = Callable[[np.ndarray, np.ndarray], Mapping[str, float]]

SURFACE, VISIBLE, PERSISTENCE, REAL = "surface_", "symmetric_visible", "persistence_", "real_"


@dataclasses.dataclass(frozen=True)
class View:
    """A camera that saw a recording.

    Attributes:
        calibration: of the camera.
        size: (height, width) of its images [pixels].
        assumed: what of it is not published; empty if nothing.
    """

    calibration: Calibration
    size: tuple[int, int]
    assumed: str = ""


@dataclasses.dataclass(frozen=True)
class Case:
    """A recording beside its replay.

    Attributes:
        name: of the recording.
        group: of the recordings that repeat each other.
        times: (f,) [s] of its frames, in the simulation.
        counted: (f,) bool, which of them the published means are of.
        columns: (f,) numbers by name, lengths in metres; NaN where there is none.
        jitter: mean norm of the second difference of simulated positions [m/s^2].
        failures: of the replay.
        notes: what is known to be wrong or assumed; nothing of it was repaired.
        positions: (f, n, 3) [m] of the simulated vertices.
        clouds: (k, 3) [m] of each frame, in the simulation's frame.
        colors: (k, 3) uint8 of each, or None.
        mesh: the simulated one.
        held: vertices that were held.
    """

    name: str
    group: str
    times: np.ndarray
    counted: np.ndarray
    columns: dict[str, np.ndarray]
    jitter: float
    failures: tuple[Failure, ...]
    notes: tuple[str, ...]
    positions: np.ndarray
    clouds: Sequence[np.ndarray]
    colors: Sequence[np.ndarray] | None
    mesh: Mesh
    held: tuple[int, ...]

    def mean(self, column: str) -> float:
        """Mean of a column over the frames that count; NaN if one of these has no number.

        Between recordings it is the mean over the frames that another one has, too.
        """
        values = self.columns[column][self.counted]
        if column.startswith(REAL):
            values = values[np.isfinite(values)]
        return float(np.mean(values)) if len(values) else np.nan


def of_simulation(found: Replay) -> dict[str, np.ndarray]:
    """Columns (f,) of a replay: strain, lowest vertex [m] and CPU time of a step [ms].

    Strain and lowest vertex are those of the step that ends at the frame or after it, time is the
    mean over the steps since the frame before.
    """
    steps = found.steps
    if not len(steps.times):
        none = np.full(len(found.times), np.nan)
        return {"strain_99": none, "lowest": none, "milliseconds": none}
    index = np.searchsorted(steps.times, found.times - 1e-9)
    reached = index < len(steps.times)
    index = np.minimum(index, len(steps.times) - 1)
    first = np.concatenate([[0], index[:-1] + 1])
    spent = np.concatenate([[0.0], np.cumsum(steps.milliseconds)])
    number = np.maximum(index + 1 - first, 1)
    each = np.where(index + 1 > first, (spent[index + 1] - spent[first]) / number, np.nan)
    columns = {
        "strain_99": steps.strain_99[index],
        "lowest": steps.lowest[index],
        "milliseconds": each,
    }
    return {name: np.where(reached, column, np.nan) for name, column in columns.items()}


def of_clouds(
    positions: np.ndarray,
    clouds: Sequence[np.ndarray],
    measure: Measure,
    *,
    triangles: np.ndarray,
    surface: SurfaceSamples,
    view: View,
    repeats: Sequence[Sequence[np.ndarray]],
    first: int = 0,
) -> dict[str, np.ndarray]:
    """Columns (f,) of distances [m] between simulated sheets and real clouds.

    By the published measure: of the vertices, under its own names; of points of the surface,
    "surface_..."; of the cloud of the frame `first`, held still, "persistence_..."; and the mean
    over other recordings of the same, "real_...". And "symmetric_visible": half the sum of mean
    Euclidean distances both ways between the cloud and what of the surface the camera sees.

    Args:
        positions: (f, n, 3) [m] of the vertices.
        clouds: (k, 3) [m] of each frame.
        measure: the published one.
        triangles: (m, 3) of the mesh.
        surface: points of it.
        view: the camera.
        repeats: clouds of each frame of other recordings of the same; shorter ones end early.
        first: the frame whose cloud is held still.
    """
    rows: list[dict[str, float]] = []
    for i, cloud in enumerate(clouds):
        row: dict[str, float] = {}
        others = [repeat[i] for repeat in repeats if i < len(repeat)]
        row |= {f"{PERSISTENCE}{k}": v for k, v in measure(clouds[first], cloud).items()}
        real = [measure(other, cloud) for other in others]
        row |= {f"{REAL}{k}": float(np.mean([r[k] for r in real])) for k in (real or [{}])[0]}
        if np.isfinite(positions[i]).all():
            points = surface.points(positions[i])
            row |= measure(positions[i], cloud)
            row |= {f"{SURFACE}{k}": v for k, v in measure(points, cloud).items()}
            row[VISIBLE] = _visible(points, positions[i], triangles, view, cloud)
        rows.append(row)
    names = dict.fromkeys(name for row in rows for name in row)
    return {name: np.array([row.get(name, np.nan) for row in rows]) for name in names}


def _visible(
    points: np.ndarray, vertices: np.ndarray, triangles: np.ndarray, view: View, cloud: np.ndarray
) -> float:
    """Symmetric distance [m] of a cloud from the points (n, 3) that a camera sees; NaN if none."""
    try:
        visible = seen(points, vertices, triangles, view.calibration, view.size)
    except InvalidArgumentError:
        return np.nan  # The sheet reaches behind the camera.
    return metrics.symmetric_distance(points[visible], cloud) if visible.any() else np.nan


def jitter_of(positions: np.ndarray, times: np.ndarray) -> float:
    """Mean norm of the second difference [m/s^2] of positions (f, n, 3) [m]; NaN if there is none.

    The time between frames is their median.
    """
    if len(times) < 3 or not np.isfinite(positions).all():
        return np.nan
    return metrics.jitter(positions, float(np.median(np.diff(times))))
