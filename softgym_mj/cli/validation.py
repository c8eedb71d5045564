"""The commands `softgym-mj validate ...`: simulated cloth against theory and real recordings."""

import pathlib
from typing import Annotated

import rich.box
import rich.table
import typer

from softgym_mj.cli.console import console
from softgym_mj.jobs.files import make_folder

app = typer.Typer(help="Simulated cloth against theory and real recordings.", no_args_is_help=True)


@app.callback()
def validate() -> None:
    """Simulated cloth against theory and real recordings."""


@app.command()
def lab(
    fabric: Annotated[
        list[str] | None,
        typer.Option(help="Name of a fabric, once for each; all of cloth.fabrics if not given."),
    ] = None,
    experiment: Annotated[
        list[str] | None,
        typer.Option(
            help="cantilever, hanging, falling, tilting or sliding, once for each; else all."
        ),
    ] = None,
    out: Annotated[
        pathlib.Path | None, typer.Option(help="Folder for lab.csv and lab.json.")
    ] = None,
) -> None:
    """Measures named fabrics in experiments whose outcome theory knows; needs no data.

    Exit status 1 if a number is further from theory than its bound.
    """
    from softgym_mj.cloth.fabrics import FABRICS
    from softgym_mj.reality.lab import BOUNDS, run, write

    if out is not None:
        make_folder(out)
    table = rich.table.Table(box=rich.box.SIMPLE, padding=(0, 1, 0, 0), pad_edge=False)
    for title in ("experiment", "fabric", "mesh"):
        table.add_column(title, no_wrap=True)
    for title in ("measured", "theory", "off %", "bound"):
        table.add_column(title, justify="right", no_wrap=True)
    found = []
    for m in run(fabric or list(FABRICS), experiment or list(BOUNDS)):
        found.append(m)
        numbers = f"{m.value:.3g}", f"{m.expected:.3g}", f"{100 * m.error:+.1f}"
        bound = f"{100 * m.bound:.0f}" if m.passed else f"{100 * m.bound:.0f} FAILED"
        table.add_row(m.experiment, m.fabric, m.mesh, *numbers, bound)
    console.print(table)
    failed = sum(not m.passed for m in found)
    console.print(f"{len(found) - failed} of {len(found)} within their bounds")
    if out is not None:
        console.print(f"wrote {' and '.join(map(str, write(found, out)))}")
    if failed:
        raise typer.Exit(1)
