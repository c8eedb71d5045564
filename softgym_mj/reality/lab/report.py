"""Runs the experiments of the lab for fabrics, and writes the results."""

import csv
import itertools
import pathlib
from collections.abc import Callable, Iterator, Sequence

from softgym_mj.cloth.fabrics import FABRICS
from softgym_mj.entities.fabric import Fabric
from softgym_mj.exceptions import check_name
from softgym_mj.reality.lab import experiments
from softgym_mj.reality.lab.experiments import BOUNDS, Measurement
from softgym_mj.reality.lab.meshes import MESHES
from softgym_mj.storage.files import whole, write_json

LOADS = (0.5, 5.0, 50.0)
# Lengths of cantilevers in cells, all of them and those with the spacing of sheets.
CELLS, ALL_CELLS, CELLS_OF_SHEETS = (12,), (6, 12, 40), (6, 12)


def run(
    names: Sequence[str], chosen: Sequence[str] = tuple(BOUNDS), is_thorough: bool = False
) -> Iterator[Measurement]:
    """Runs experiments with fabrics, one after the other.

    Strips of true size have the measured shear stiffness, others the default of sheets of the
    fabric.

    Args:
        names: names of fabrics in `softgym_mj.cloth.fabrics.FABRICS`.
        chosen: experiments, of `BOUNDS`.
        is_thorough: whether cantilevers are 6, 12 and 40 cells long, and 6 and 12 with the spacing
            of sheets; else 12.

    Raises:
        InvalidArgumentError: for an unknown name.
    """
    for experiment in chosen:
        check_name("experiment", experiment, BOUNDS)
    for name in names:
        check_name("fabric", name, FABRICS)
    return (m for name in names for m in _run(name, chosen, is_thorough))


def _run(name: str, chosen: Sequence[str], is_thorough: bool) -> Iterator[Measurement]:
    fabric = Fabric.named(name)
    sheared = Fabric.named(name, measured_shear=True)
    lengths: tuple[int, ...] = ALL_CELLS if is_thorough else CELLS
    if "cantilever" in chosen:
        for mesh, cells, load in itertools.product(MESHES, lengths, LOADS):
            yield experiments.cantilever(sheared, name, mesh, cells, load)
    if "cantilever_sheet" in chosen:
        lengths = CELLS_OF_SHEETS if is_thorough else CELLS
        for mesh, cells, load in itertools.product(MESHES, lengths, LOADS):
            yield experiments.cantilever(fabric, name, mesh, cells, load, experiments.SPACING)
    for experiment, is_fine in (("hanging", True), ("hanging_sheet", False)):
        if experiment in chosen:
            yield experiments.hanging(fabric, name, is_fine=is_fine)
    simple: dict[str, Callable[[Fabric, str], Measurement]] = {
        "falling": experiments.falling,
        "swinging": experiments.swinging,
        "tilting": experiments.tilting,
        "sliding": experiments.sliding,
    }
    for experiment, do in simple.items():
        if experiment in chosen and not (experiment in _IN_AIR and fabric.drag == 0.0):
            yield do(fabric, name)


_IN_AIR = ("falling", "swinging")  # Experiments that need drag.


def record(measurement: Measurement) -> dict[str, object]:
    """Returns a measurement as a JSON object, with its settings among the other names."""
    return {
        "experiment": measurement.experiment,
        "fabric": measurement.fabric,
        "mesh": measurement.mesh,
        "quantity": measurement.quantity,
        "value": measurement.value,
        "expected": measurement.expected,
        "error": measurement.error,
        "bound": measurement.bound,
        "passed": measurement.passed,
        **measurement.settings,
    }


def write(measurements: Sequence[Measurement], folder: pathlib.Path) -> tuple[pathlib.Path, ...]:
    """Writes `lab.json` and `lab.csv` with the same numbers; returns the two files.

    Raises:
        StoreError: if they cannot be written.
    """
    rows = [_rounded(record(m)) for m in measurements]
    as_json, as_csv = folder / "lab.json", folder / "lab.csv"
    write_json(as_json, {"measurements": rows})
    names = list(dict.fromkeys(name for row in rows for name in row))
    with whole(as_csv) as partial, partial.open("w", newline="", encoding="utf-8") as file:
        writer = csv.DictWriter(file, names)
        writer.writeheader()
        writer.writerows(rows)
    return as_json, as_csv


def _rounded(row: dict[str, object]) -> dict[str, object]:
    """Returns a record whose numbers are rounded to significant digits."""
    return {k: float(f"{v:.6g}") if isinstance(v, float) else v for k, v in row.items()}
