"""The commands `softgym-mj identify ...`: ropes and cloth from recordings."""

import dataclasses
import functools
import pathlib
from typing import Annotated

import typer

from softgym_mj.cli.console import CableRecordings, Cables, ClothRecordings, console
from softgym_mj.storage.files import make_folder, write_json

app = typer.Typer(help="Fits parameters of ropes and cloth to recordings.", no_args_is_help=True)


@app.callback()
def identify() -> None:
    """Fits a rope (`rope`) or a cloth on a tool (`cloth`) to recordings.

    docs/reality.md describes the recordings.
    """


@app.command()
def rope(
    folder: CableRecordings = None,
    cable: Cables = None,
    recordings: Annotated[int, typer.Option(help="Number of train recordings, 5 or more.")] = 8,
    out: Annotated[pathlib.Path, typer.Option(help="JSON file.")] = pathlib.Path("rope.json"),
) -> None:
    """Fits stiffness, damping and length of a rope to recorded cables.

    One cable takes a minute or two on one core.
    """
    from softgym_mj.reality.fitting import spread
    from softgym_mj.reality.rope.identification import identify
    from softgym_mj.reality.rope.recordings import CABLES, read_recordings

    chosen = {
        name: spread(read_recordings(folder, name, "train"), recordings) for name in cable or CABLES
    }
    make_folder(out.parent)
    found = {}
    for name, own in chosen.items():
        result = identify(own, functools.partial(_echo_of, name))
        found[name] = dataclasses.asdict(result)
        write_json(out, found)
    console.print(f"wrote {out}")


def _echo_of(cable: str, line: str) -> None:
    typer.echo(f"{cable}: {line}")


@app.command()
def cloth(
    folder: ClothRecordings = None,
    out: Annotated[pathlib.Path, typer.Option(help="JSON file.")] = pathlib.Path("cloth.json"),
) -> None:
    """Fits a cloth held by a robot's tool to three of four recordings; the others are held out.

    30 recordings take three minutes on one core.
    """
    from softgym_mj.reality.cloth.experiment import split
    from softgym_mj.reality.cloth.identification import identify
    from softgym_mj.reality.cloth.recordings import read_recordings

    first, _ = split(read_recordings(folder))
    make_folder(out.parent)
    write_json(out, dataclasses.asdict(identify(first, typer.echo)))
    console.print(f"wrote {out}")
