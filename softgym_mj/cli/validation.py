"""The commands `softgym-mj validate ...`: simulations against theory and recordings."""

import dataclasses
import pathlib
from collections.abc import Sequence
from typing import Annotated

import numpy as np
import typer

from softgym_mj.cli.console import (
    CableRecordings,
    Cables,
    ClothRecordings,
    WaterRecordings,
    console,
)
from softgym_mj.exceptions import StoreError
from softgym_mj.storage.files import make_folder, read_json, write_json

app = typer.Typer(
    help="Compares simulations with theory and with recordings.", no_args_is_help=True
)

_TITLES = "measured", "theory", "off %", "bound %"
_LINE = "{:<36} {:<21} {:>10} {:>10} {:>7} {}"
_SHOWN = ("cells", "load")  # Settings of an experiment that are printed.
Results = Annotated[pathlib.Path | None, typer.Option(help="JSON file of the results.")]


@app.callback()
def validate() -> None:
    """Compares simulated cloth with theory, and rope, cloth and water with recordings."""


@app.command()
def lab(
    fabric: Annotated[
        list[str] | None,
        typer.Option(help="Name of a fabric, repeatable; default: all of cloth.fabrics."),
    ] = None,
    experiment: Annotated[
        list[str] | None,
        typer.Option(
            help="cantilever, cantilever_sheet, hanging, hanging_sheet, falling, swinging, tilting "
            "or sliding, repeatable; default: all."
        ),
    ] = None,
    thorough: Annotated[
        bool, typer.Option("--thorough", help="Cantilevers of 6 to 40 cells instead of 12.")
    ] = False,
    out: Annotated[
        pathlib.Path | None, typer.Option(help="Folder for lab.csv and lab.json.")
    ] = None,
) -> None:
    """Compares simulated tests of fabrics with theory; needs no recordings.

    The exit status is 1 if an error exceeds its bound.
    """
    from softgym_mj.cloth.fabrics import FABRICS
    from softgym_mj.reality.lab import BOUNDS, run, write

    if out is not None:
        make_folder(out)
    typer.echo(_LINE.format("experiment, mesh, cells, load", "fabric", *_TITLES))
    result = []
    for m in run(fabric or list(FABRICS), experiment or list(BOUNDS), thorough):
        result.append(m)
        how = [m.experiment, m.mesh, *(f"{m.settings[k]:g}" for k in _SHOWN if k in m.settings)]
        numbers = f"{m.value:.4g}", f"{m.expected:.4g}", f"{100 * m.error:+.1f}"
        bound = f"{100 * m.bound:.0f}{'' if m.passed else ' FAILED'}"
        typer.echo(_LINE.format(" ".join(how), m.fabric, *numbers, bound))
    failed = sum(not m.passed for m in result)
    console.print(f"{len(result) - failed} of {len(result)} within their bounds")
    if out is not None:
        console.print(f"wrote {' and '.join(map(str, write(result, out)))}")
    if failed:
        raise typer.Exit(1)


def _echo(
    line: str, names: Sequence[str], errors: Sequence[float], speed: float, models: Sequence[str]
) -> None:
    """Prints names, errors [m] in mm, and of a simulation its speed and the modeled effects."""
    numbers = [f"{1e3 * error:.1f}" for error in errors]
    typer.echo(line.format(*names, *numbers, f"{speed:.0f}" if models else "", ", ".join(models)))


_ROPE_LINE = "{:<6} {:<38} {:>10} {:>9} {:>8} {:>9} {}"


@app.command()
def rope(
    folder: CableRecordings = None,
    cable: Cables = None,
    split: Annotated[str, typer.Option(help="eval or train.")] = "eval",
    identified: Annotated[
        pathlib.Path | None, typer.Option(help="Properties: a file of `identify rope`.")
    ] = None,
    out: Results = None,
) -> None:
    """Predicts five seconds of cables held by two robots, from downloaded recordings.

    Errors are mean absolute errors per coordinate, open loop.
    """
    from softgym_mj.reality.fitting import read_identified
    from softgym_mj.reality.rope import simulation
    from softgym_mj.reality.rope.cable import Properties
    from softgym_mj.reality.rope.experiment import measure
    from softgym_mj.reality.rope.recordings import CABLES, SOURCE, read_recordings
    from softgym_mj.reality.rope.scenario import EndsInterpolated, NothingMoves, Scenario
    from softgym_mj.reality.solver import Solver

    names = cable or CABLES
    entries = {} if identified is None else read_json(identified)
    found = {name: read_identified(Properties, entries[name]) for name in names if name in entries}
    if identified is not None and not found:
        raise StoreError(f"{identified} has no entry of {' or '.join(names)}")
    recordings = {name: read_recordings(folder, name, split) for name in names}
    titles = "all [mm]", "free [mm]", "worst", "real time", "models"
    typer.echo(_ROPE_LINE.format("cable", "solver", *titles))
    measured = []
    for name, own in recordings.items():
        spacing = simulation.marker_spacing(read_recordings(folder, name, "train"))
        assumed = simulation.CableSolver("rope, assumed", spacing, simulation.ASSUMED)
        solvers: list[Solver[Scenario]] = [NothingMoves(), EndsInterpolated(), assumed]
        if name in found:
            f = found[name]
            spacing = np.array(f.spacing)
            solvers.append(simulation.CableSolver("rope, identified", spacing, f.properties))
        for solver in solvers:
            m = measure(solver, own)
            measured.append(dataclasses.asdict(m))
            errors = m.error, m.free_error, m.worst
            _echo(_ROPE_LINE, (name, m.solver), errors, m.real_time_factor, m.models)
    if out is not None:
        result = {
            "source": SOURCE,
            "split": split,
            "assumed": dataclasses.asdict(simulation.ASSUMED),
            "identified": {name: dataclasses.asdict(f) for name, f in found.items()},
            "measurements": measured,
        }
        write_json(out, result)
        console.print(f"wrote {out}")


_CLOTH_LINE = "{:<26} {:>9} {:>9} {:>8} {:>7} {:>9} {}"


@app.command()
def cloth(
    folder: ClothRecordings = None,
    identified: Annotated[
        pathlib.Path | None, typer.Option(help="Properties: a file of `identify cloth`.")
    ] = None,
    out: Results = None,
) -> None:
    """Predicts a cloth from the motion of the tool that holds it, from downloaded recordings.

    Errors are mean distances of tracked nodes in every fourth recording, open loop.
    """
    from softgym_mj.reality.cloth import experiment, simulation
    from softgym_mj.reality.cloth.recordings import SOURCE, read_recordings
    from softgym_mj.reality.cloth.scenario import NothingMoves, RigidSheet, Scenario, grip_of
    from softgym_mj.reality.fitting import read_identified
    from softgym_mj.reality.solver import Solver

    found = None
    if identified is not None:
        found = read_identified(simulation.Properties, read_json(identified))
    recordings = read_recordings(folder)
    first, test = experiment.split(recordings)
    grip = grip_of(first)
    quality = experiment.quality(recordings, grip)
    console.print(
        f"{len(recordings)} recordings, {quality.frames} frames: {quality.complete} have all nodes,"
        f" {quality.counted} of these count; noise at rest {1e3 * quality.noise:.1f} mm"
    )
    solvers: list[Solver[Scenario]] = [NothingMoves(), RigidSheet()]
    solvers.append(simulation.ClothSolver("cloth, assumed", grip, simulation.ASSUMED))
    if found is not None:
        solvers.append(simulation.ClothSolver("cloth, identified", grip, found.properties))
    titles = "mean [mm]", "held edge", "far edge", "worst", "real time", "models"
    typer.echo(_CLOTH_LINE.format("solver", *titles))
    measured = []
    for solver in solvers:
        m = experiment.measure(solver, test, grip)
        measured.append(dataclasses.asdict(m))
        errors = m.error, m.held_error, m.far_error, m.worst
        _echo(_CLOTH_LINE, (m.solver,), errors, m.real_time_factor, m.models)
    if out is not None:
        result = {
            "source": SOURCE,
            "tests": [recording.name for recording in test],
            "quality": dataclasses.asdict(quality),
            "pitch": grip.pitch,
            "lengths": grip.lengths.tolist(),
            "assumed": dataclasses.asdict(simulation.ASSUMED),
            "identified": None if found is None else dataclasses.asdict(found),
            "measurements": measured,
        }
        write_json(out, result)
        console.print(f"wrote {out}")


_WATER_LINE = "{:<20} {:<28} {:>5} {:>9} {:<30} {:>7} {:>7} {:>8} {:>6}"


@app.command()
def water(
    folder: WaterRecordings = None,
    experiment: Annotated[
        list[str] | None,
        typer.Option(
            help="koshizuka_oka, koshizuka_oka_sudden, koshizuka_oka_mps, martin_moyce_29, "
            "martin_moyce_57, spheric_2, faltinsen or bouscasse, repeatable; default: all."
        ),
    ] = None,
    cells: Annotated[
        list[int] | None,
        typer.Option(
            help="Particles over the depth of the water at rest, repeatable; default: two or "
            "three numbers for each experiment."
        ),
    ] = None,
    out: Results = None,
) -> None:
    """Compares dam breaks and sloshing tanks with downloaded recordings.

    The exit status is 1 if an error of simulated water exceeds its bound.
    """
    from softgym_mj.reality.water.comparison import EXPERIMENTS, PLAIN, measure
    from softgym_mj.reality.water.recordings import SOURCES
    from softgym_mj.tasks import transport_water

    liquids = {
        "water without wall friction": PLAIN,
        "water of TransportWater": transport_water.LIQUID,
    }
    titles = "cells", "particles", "quantity", "error %", "mean %", "bound %", "CPU s"
    typer.echo(_WATER_LINE.format("experiment", "solution", *titles))
    measured = []
    for m in measure(folder, experiment or list(EXPERIMENTS), liquids, cells or ()):
        measured.append(m)
        size = (m.cells, m.particles) if m.cells else ("", "")
        numbers = f"{100 * m.error.value:+.1f}", f"{100 * m.error.mean:+.1f}"
        bound = "" if m.error.bound is None else f"{100 * m.error.bound:.0f}"
        bound += "" if m.error.passed else "!"
        seconds = f"{m.seconds:.1f}" if m.cells else ""
        line = m.experiment, m.solution, *size, m.error.quantity, *numbers, bound, seconds
        typer.echo(_WATER_LINE.format(*line))
    simulated = [m for m in measured if m.cells and m.error.bound is not None]
    failed = sum(not m.error.passed for m in simulated)
    console.print(f"{len(simulated) - failed} of {len(simulated)} within their bounds (else: !)")
    if out is not None:
        result = {
            "sources": SOURCES,
            "liquids": {title: dataclasses.asdict(liquid) for title, liquid in liquids.items()},
            "measurements": [dataclasses.asdict(m) for m in measured],
        }
        write_json(out, result)
        console.print(f"wrote {out}")
    if failed:
        raise typer.Exit(1)
