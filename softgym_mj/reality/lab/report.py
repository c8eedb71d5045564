"""Runs the experiments of the lab for fabrics, and writes what they measured."""

import csv
import pathlib
from collections.abc import Callable, Iterator, Sequence

from softgym_mj.entities.sheet import Fabric
from softgym_mj.exceptions import check_name
from softgym_mj.jobs.files import whole, write_json
from softgym_mj.reality.lab import experiments
from softgym_mj.reality.lab.experiments import BOUNDS, Measurement


def run(names: Sequence[str], chosen: Sequence[str] = tuple(BOUNDS)) -> Iterator[Measurement]:
    """Does experiments with fabrics, one after the other.

    Args:
        names: of fabrics, of `softgym_mj.cloth.fabrics.FABRICS`.
        chosen: which experiments, of `BOUNDS`.

    Raises:
        InvalidArgumentError: for a name that is none of these.
    """
    for experiment in chosen:
        check_name("experiment", experiment, BOUNDS)
    made_of = {name: Fabric.named(name) for name in names}
    return (m for name, fabric in made_of.items() for m in _run(fabric, name, chosen))


def _run(fabric: Fabric, name: str, chosen: Sequence[str]) -> Iterator[Measurement]:
    if "cantilever" in chosen:
        for load in (0.5, 5.0, 50.0):
            yield experiments.cantilever(fabric, name, load=load)
    simple: dict[str, Callable[[Fabric, str], Measurement]] = {
        "hanging": experiments.hanging,
        "falling": experiments.falling,
        "tilting": experiments.tilting,
        "sliding": experiments.sliding,
    }
    for experiment, do in simple.items():
        if experiment in chosen and not (experiment == "falling" and fabric.drag == 0.0):
            yield do(fabric, name)


def record(measurement: Measurement) -> dict[str, object]:
    """A measurement as a JSON object, its settings among the other names."""
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
    """Writes `lab.json` and `lab.csv` with the same numbers; returns these files.

    Raises:
        StoreError: if they cannot be written.
    """
    rows = [record(m) for m in measurements]
    as_json, as_csv = folder / "lab.json", folder / "lab.csv"
    write_json(as_json, {"measurements": rows})
    names = list(dict.fromkeys(name for row in rows for name in row))
    with whole(as_csv) as partial, partial.open("w", newline="", encoding="utf-8") as file:
        writer = csv.DictWriter(file, names)
        writer.writeheader()
        writer.writerows(rows)
    return as_json, as_csv
