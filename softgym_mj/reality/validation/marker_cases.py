"""Markers: a folder of CSV files, each replayed with its upper corners held."""

import pathlib
from collections.abc import Iterator, Sequence

import numpy as np

from softgym_mj.entities.sheet import Fabric
from softgym_mj.exceptions import StoreError
from softgym_mj.reality import marker_scene
from softgym_mj.reality.markers import MARKERS, read_markers
from softgym_mj.reality.metrics import marker_error
from softgym_mj.reality.validation.cases import PERSISTENCE, Case, jitter_of, of_simulation

PRIMARY = "marker_error"
ALL = "marker_error_all"
WHERE = (
    "Zenodo record 14644526 (it names two licences, CC BY-SA and CC BY-NC-SA: keep to the "
    "stricter one): CSV files with the columns Frame, Time, X1, Y1, Z1, X2, ..."
)
KINDS = ("twist", "shake")  # In names of files, for what is published of them.
SIZES = {number: size for size, number in MARKERS.items()}


def check(folder: pathlib.Path) -> list[pathlib.Path]:
    """The recordings below a folder.

    Raises:
        StoreError: if there is none; it says where they are to be had.
    """
    files = sorted(folder.rglob("*.csv"))
    if not files:
        raise StoreError(f"{folder}: no CSV file is below it; they are in {WHERE}")
    return files


def run(
    folder: pathlib.Path,
    files: Sequence[pathlib.Path],
    fabric: Fabric,
    *,
    unit: float = 1.0,
    held: tuple[int, ...] | None = None,
    spacing: float = marker_scene.SPACING,
    after: float = 0.0,
    floor: float | None = None,
) -> Iterator[Case]:
    """Replays recordings and measures them, one after the other.

    Args:
        folder: of the data.
        files: below it.
        fabric: what sheets are made of.
        unit, held, spacing: as of `marker_scene.scene`.
        after: seconds of each recording that do not count.
        floor: height [m] of a plane; None for none.

    Raises:
        StoreError: with the name of the file, if one is damaged or its markers in another order.
    """
    for file in files:
        name = file.relative_to(folder).with_suffix("").as_posix()
        scene = marker_scene.scene(
            read_markers(file), unit=unit, held=held, spacing=spacing, name=str(file)
        )
        found = scene.replay(fabric, floor)
        simulated, real = found.positions[:, scene.vertices], scene.positions
        free = scene.free
        rows: dict[str, list[float]] = {PRIMARY: [], ALL: [], f"{PERSISTENCE}{PRIMARY}": []}
        for ours, theirs in zip(simulated, real, strict=True):
            finite = np.isfinite(ours).all()
            rows[PRIMARY].append(marker_error(ours[free], theirs[free]) if finite else np.nan)
            rows[ALL].append(marker_error(ours, theirs) if finite else np.nan)
            rows[f"{PERSISTENCE}{PRIMARY}"].append(marker_error(real[0, free], theirs[free]))
        counted = scene.times >= scene.times[0] + after
        columns = {column: np.array(values) for column, values in rows.items()}
        kind = next((kind for kind in KINDS if kind in name.lower()), None)
        yield Case(
            name=name,
            group=f"{name}/{kind}" if kind else name,
            times=scene.times,
            counted=counted,
            columns=columns | of_simulation(found),
            jitter=jitter_of(found.positions[counted], scene.times[counted]),
            failures=found.failures,
            notes=_notes(scene, floor),
            positions=found.positions,
            clouds=list(real),
            colors=None,
            mesh=scene.mesh,
            held=tuple(int(vertex) for vertex in scene.vertices[list(scene.held)]),
        )


def _notes(scene: marker_scene.MarkerScene, floor: float | None) -> tuple[str, ...]:
    rows, columns = scene.shape
    held = " and ".join(str(marker + 1) for marker in scene.held)
    return (
        f"{rows} x {columns} markers ({SIZES[rows * columns]}) row by row, their distance at rest "
        "from the recording, no cloth beyond them",
        f"markers {held} are held, Z is up, and it starts at rest",
        "there is no floor and nothing else to touch" if floor is None else f"floor at {floor} m",
    )
