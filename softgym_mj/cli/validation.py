"""The command `softgym-mj validate lab`: simulated cloth against theory."""

import pathlib
from typing import Annotated

import typer

from softgym_mj.cli.console import console
from softgym_mj.storage.files import make_folder

app = typer.Typer(help="Simulated cloth against theory.", no_args_is_help=True)

_TITLES = "measured", "theory", "off %", "bound %"
_LINE = "{:<36} {:<21} {:>10} {:>10} {:>7} {}"
_TOLD = ("cells", "load")  # Of an experiment's settings.


@app.callback()
def validate() -> None:
    """Simulated cloth against theory."""


@app.command()
def lab(
    fabric: Annotated[
        list[str] | None,
        typer.Option(help="Name of a fabric, once for each; all of cloth.fabrics if not given."),
    ] = None,
    experiment: Annotated[
        list[str] | None,
        typer.Option(
            help="cantilever, cantilever_sheet, hanging, hanging_sheet, falling, swinging, tilting "
            "or sliding, once for each; else all."
        ),
    ] = None,
    thorough: Annotated[
        bool, typer.Option("--thorough", help="Cantilevers of 6 to 40 cells; else of 12.")
    ] = False,
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
    typer.echo(_LINE.format("experiment, mesh, cells, load", "fabric", *_TITLES))
    result = []
    for m in run(fabric or list(FABRICS), experiment or list(BOUNDS), thorough):
        result.append(m)
        how = [m.experiment, m.mesh, *(f"{m.settings[k]:g}" for k in _TOLD if k in m.settings)]
        numbers = f"{m.value:.4g}", f"{m.expected:.4g}", f"{100 * m.error:+.1f}"
        bound = f"{100 * m.bound:.0f}{'' if m.passed else ' FAILED'}"
        typer.echo(_LINE.format(" ".join(how), m.fabric, *numbers, bound))
    failed = sum(not m.passed for m in result)
    console.print(f"{len(result) - failed} of {len(result)} within their bounds")
    if out is not None:
        console.print(f"wrote {' and '.join(map(str, write(result, out)))}")
    if failed:
        raise typer.Exit(1)
