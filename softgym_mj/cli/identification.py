"""The commands `softgym-mj identify ...`: fabrics, ropes and cloth from recordings."""

import contextlib
import dataclasses
import functools
import pathlib
from collections.abc import Iterator, Mapping
from typing import Annotated, Any

import rich.box
import rich.progress
import rich.table
import typer

from softgym_mj.cli.console import (
    CableRecordings,
    Cables,
    ClothRecordings,
    Ray,
    console,
    progress_bar,
)
from softgym_mj.entities.fabric import Fabric
from softgym_mj.exceptions import InvalidArgumentError
from softgym_mj.storage.files import make_folder, read_json, write_json

app = typer.Typer(
    help="Fits parameters of fabrics, ropes and cloth to recordings.", no_args_is_help=True
)

_MM = 1e3


@app.callback()
def identify() -> None:
    """Fits a fabric (`rags`), a rope (`rope`) or a cloth on a tool (`cloth`) to recordings.

    docs/identification.md and docs/reality.md describe the recordings.
    """


@app.command()
def rags(
    folder: Annotated[pathlib.Path, typer.Argument(help="Folder of the data set.")],
    cloth: Annotated[str, typer.Option(help="chequered, cotton or linen.")] = "linen",
    fabric: Annotated[str, typer.Option(help="Name of a fabric of cloth.fabrics.")] = "white_dots",
    parameters: Annotated[
        pathlib.Path | None,
        typer.Option(
            help="JSON file with attributes of entities.Fabric that replace the fabric's."
        ),
    ] = None,
    density: Annotated[
        float | None,
        typer.Option(help="Measured mass per area in kg/m^2; default: the fabric's."),
    ] = None,
    width: Annotated[
        float, typer.Option(help="Width of the rag between the grippers, in meters.")
    ] = 0.478,
    length: Annotated[float, typer.Option(help="Hanging length of the rag, in meters.")] = 0.63,
    table: Annotated[float, typer.Option(help="Height of the table top, in meters.")] = 0.2,
    spacing: Annotated[float, typer.Option(help="Vertex spacing of the mesh, in meters.")] = 0.0263,
    camera: Annotated[
        tuple[float, float, float] | None,
        typer.Option(help="Position of the camera, in meters; default: an assumed one."),
    ] = None,
    blind: Annotated[
        bool, typer.Option("--blind", help="Ignore the camera: use measured points only.")
    ] = False,
    seeds: Annotated[int, typer.Option(help="Number of searches.", min=1)] = 3,
    evaluations: Annotated[int, typer.Option(help="Evaluations of each search.", min=12)] = 240,
    jobs: Annotated[
        int, typer.Option(help="Worker processes; the result does not depend on them.")
    ] = 1,
    ray: Ray = None,
    out: Annotated[
        pathlib.Path,
        typer.Option(help="Folder for identification.json, fabric.json and intermediate results."),
    ] = pathlib.Path("identification"),
) -> None:
    """Fits fabric parameters to point clouds of a hanging rag: values and 95 % intervals.

    Repeat 0 of both motions is fitted, the others are held out. Each seed runs a least-squares
    search. The same command continues one that was stopped.
    """
    from softgym_mj.parallel.executors import make_executor
    from softgym_mj.reality.identification import rag_data
    from softgym_mj.reality.identification.identify import identify, open_store
    from softgym_mj.reality.identification.unknowns import THICKNESS, fabric_of

    base = dataclasses.replace(_replaced(Fabric.named(fabric), parameters), thickness=THICKNESS)
    if density is not None:
        base = dataclasses.replace(base, density=density)
    place = None if blind else camera or rag_data.CAMERA
    task = rag_data.read_task(
        folder, cloth, base, size=(width, length), spacing=spacing, table=table, camera=place
    )
    make_folder(out)
    settings = {
        "layout": "rags", "folder": str(folder), "cloth": cloth, "size": (width, length),
        "table": table, "spacing": spacing, "camera": place,
        "base": dataclasses.asdict(task.base), "evaluations": evaluations,
    }  # fmt: skip
    store = open_store(out / "searches", settings)
    try:
        with _progress(seeds * evaluations) as progress, make_executor(jobs, ray) as executor:
            result = identify(task, executor, tuple(range(seeds)), evaluations, store, progress)
    except KeyboardInterrupt:
        message = f"{out} has the finished part: the same command continues from it"
        raise KeyboardInterrupt(message) from None
    write_json(out / "identification.json", {**result, "settings": {**settings, "seeds": seeds}})
    values = {name: entry["value"] for name, entry in result["parameters"].items()}
    write_json(out / "fabric.json", dataclasses.asdict(fabric_of(values, task.base)))
    _show(result)
    console.print(f"wrote {out / 'identification.json'} and {out / 'fabric.json'}")


def _replaced(fabric: Fabric, parameters: pathlib.Path | None) -> Fabric:
    """Returns a fabric with the attributes of a JSON file."""
    if parameters is None:
        return fabric
    values = read_json(parameters)
    valid = [field.name for field in dataclasses.fields(Fabric)]
    for key in values:
        if key not in valid:
            raise InvalidArgumentError(str(parameters), key, valid)
    bent = fabric.bent(values.get("bend_stiffness", fabric.bend_stiffness))
    return dataclasses.replace(bent, **values)


@contextlib.contextmanager
def _progress(total: int) -> Iterator[Any]:
    """Shows a bar of evaluations and the least loss."""
    with progress_bar(rich.progress.TextColumn("{task.fields[note]}", markup=False)) as bar:
        shown = bar.add_task("evaluations", total=total, note="")

        def on_generation(best: dict[Any, tuple[int, float]]) -> None:
            made = sum(number for number, _ in best.values())
            least = min(loss for _, loss in best.values())
            bar.update(shown, completed=made, note=f"{_MM * least:.2f} mm")

        yield on_generation
        bar.update(shown, completed=total)


def _show(result: dict[str, Any]) -> None:
    table = rich.table.Table(box=rich.box.SIMPLE, padding=(0, 1, 0, 0), pad_edge=False)
    for title in ("parameter", "unit"):
        table.add_column(title, no_wrap=True)
    for title in ("start", "value", "95 %"):
        table.add_column(title, justify="right", no_wrap=True)
    table.add_column("", overflow="fold")
    for name, entry in result["parameters"].items():
        numbers = (f"{entry[key]:.3g}" for key in ("start", "value"))
        interval = f"{entry['low']:.3g} to {entry['high']:.3g}"
        table.add_row(name, entry["unit"], *numbers, interval, _remark(entry))
    console.print(table)
    for title, name in (("fitted", "fit"), ("held out", "held_out")):
        if result[name]["found"] is not None:
            here, start = (_MM * result[name][key] for key in ("found", "start"))
            console.print(f"{title}: {here:.2f} mm, before {start:.2f} mm")
    for name, clock in result["clocks"].items():
        if clock["is_clock_off"]:
            console.print(f"{name}: its clock is off by {_MM * clock['clock_error']:+.0f} ms")


def _remark(entry: Mapping[str, Any]) -> str:
    if entry["is_identified"]:
        return ""
    for key, words in (("at_least", "at least"), ("at_most", "at most")):
        if key in entry:
            return f"not identified: {words} {entry[key]:.3g}"
    return "not identified"


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
