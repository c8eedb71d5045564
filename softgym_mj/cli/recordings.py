"""The commands `softgym-mj validate rags|garments|markers`: what a user's recordings say of it."""

import dataclasses
import pathlib
from collections.abc import Iterable, Mapping, Sequence
from typing import Annotated, Any

import rich.box
import rich.table
import typer

from softgym_mj.cli.console import console
from softgym_mj.cli.validation import app
from softgym_mj.entities.sheet import Fabric
from softgym_mj.exceptions import InvalidArgumentError, check_name
from softgym_mj.jobs.files import make_folder, read_json

Folder = Annotated[pathlib.Path, typer.Argument(help="Where the data set is.")]
FabricName = Annotated[str, typer.Option(help="Name of a fabric of cloth.fabrics.")]
Parameters = Annotated[
    pathlib.Path | None,
    typer.Option(help="JSON of attributes of entities.Fabric that replace the named one's."),
]
Out = Annotated[
    pathlib.Path | None,
    typer.Option(help="Folder for frames.csv, report.json, curves.png and a film of each case."),
]
Film = Annotated[bool, typer.Option(help="Whether cases are filmed.")]
# Of garments.
AnyFabricName = Annotated[
    str | None, typer.Option(help="Name of a fabric; else what the benchmark says.")
]
Actions = Annotated[
    list[str] | None, typer.Option(help="fling, fold or grasp, once for each; else all.")
]
MeshFile = Annotated[
    pathlib.Path | None, typer.Option(help="An OBJ; else the benchmark's in DIR/meshes.")
]
Held = Annotated[
    list[int] | None,
    typer.Option(help="Vertex of the OBJ that the left, then the right arm holds."),
]
Window = Annotated[
    tuple[float, float, float] | None,
    typer.Option(help="Delay of the camera, begin and end, in s; else the benchmark's."),
]
Swapped = Annotated[bool, typer.Option(help="Whether the left arm's base is at Y = -0.25 m.")]


@app.command()
def rags(
    folder: Folder,
    fabric: FabricName = "white_dots",
    parameters: Parameters = None,
    cloth: Annotated[
        list[str] | None, typer.Option(help="chequered, cotton or linen, once for each; else all.")
    ] = None,
    primitive: Annotated[
        list[str] | None, typer.Option(help="dynamic or quasi_static, once for each; else both.")
    ] = None,
    repeat: Annotated[
        list[int] | None, typer.Option(help="0, 1 or 2, once for each; else all.")
    ] = None,
    archive: Annotated[
        pathlib.Path | None, typer.Option(help="The downloaded archive, to compare its SHA-256.")
    ] = None,
    frames: Annotated[
        int | None, typer.Option(help="Of each sequence, if they are not the published ones.")
    ] = None,
    spacing: Annotated[float, typer.Option(help="Of the mesh [m].")] = 0.028,
    sampled: Annotated[float, typer.Option(help="Spacing of points on surfaces [m].")] = 0.005,
    published: Annotated[
        bool, typer.Option(help="Whether grippers stop for 10 ms, as in the benchmark's samples.")
    ] = False,
    out: Out = None,
    film: Film = True,
) -> None:
    """Three rags, two primitives: Blanco-Mulero et al., RA-L 2024. Nothing is downloaded."""
    from softgym_mj.reality import rag_scene
    from softgym_mj.reality import rags as data
    from softgym_mj.reality.validation import rag_cases
    from softgym_mj.reality.validation.baselines import RAGS

    sheet = made_of(fabric, parameters)
    found = rag_cases.check(
        folder, cloth or data.CLOTHS, primitive or tuple(data.FRAMES), repeat or data.REPEATS
    )
    if archive is not None:
        data.check_archive(archive)
    missing = ["/".join((f"{c}_{i}", name)) for c, i, name in found.missing]
    _say_missing(missing, rag_cases.WHERE)
    cases = rag_cases.run(
        folder, found, sheet, frames=frames, spacing=spacing, sampled=sampled,
        published=published,
    )  # fmt: skip
    settings = {
        "fabric": dataclasses.asdict(sheet),
        "spacing": spacing,
        "sampled": sampled,
        "published_samples": published,
        "archive": "SHA-256 is the published one" if archive else "not checked",
    }
    _report(cases, rag_cases.PRIMARY, RAGS, settings, missing, out, film, rag_scene.TABLE)


@app.command()
def garments(
    folder: Folder,
    fabric: AnyFabricName = None,
    parameters: Parameters = None,
    garment: Annotated[
        list[str] | None, typer.Option(help="Name of a garment, once for each; else all.")
    ] = None,
    action: Actions = None,
    mesh: MeshFile = None,
    held: Held = None,
    window: Window = None,
    swapped: Swapped = False,
    place: Annotated[
        tuple[float, float], typer.Option(help="X and Y of the origin of meshes [m].")
    ] = (0.1, 0.0),
    sampled: Annotated[float, typer.Option(help="Spacing of points on surfaces [m].")] = 0.005,
    out: Out = None,
    film: Film = True,
) -> None:
    """Garments in two arms' hands: RGBench, AAAI 2026. Nothing is downloaded."""
    from softgym_mj.reality import garment_scene
    from softgym_mj.reality import garments as data
    from softgym_mj.reality.garment_windows import Window
    from softgym_mj.reality.validation import garment_cases
    from softgym_mj.reality.validation.baselines import GARMENTS

    for name in garment or ():
        check_name("garment", name, data.GARMENTS)
    for name in action or ():
        check_name("action", name, data.ACTIONS)
    if fabric is None and parameters is not None:
        raise InvalidArgumentError("fabric", None, "the name of a fabric beside parameters")
    sheet = None
    if fabric is not None:
        thin = dataclasses.replace(Fabric.named(fabric), thickness=garment_scene.THICKNESS)
        sheet = _replaced(thin, parameters)
    found = garment_cases.check(folder, garment or data.GARMENTS, action or data.ACTIONS)
    _say_missing(found.missing, garment_cases.WHERE)
    cases = garment_cases.run(
        folder, found, fabric=sheet, mesh=mesh, held=tuple(held) if held else None,
        window=Window(*window) if window else None, swapped=swapped, place=place, sampled=sampled,
    )  # fmt: skip
    settings = {
        "fabric": dataclasses.asdict(sheet) if sheet else garment_cases.FABRICS,
        "mesh": str(mesh) if mesh else "the benchmark's",
        "held": held,
        "window": window,
        "swapped": swapped,
        "place": place,
        "sampled": sampled,
    }
    missing = found.missing
    _report(cases, garment_cases.PRIMARY, GARMENTS, settings, missing, out, film, 0.0)


@app.command()
def markers(
    folder: Folder,
    fabric: FabricName = "white_dots",
    parameters: Parameters = None,
    unit: Annotated[float, typer.Option(help="Metres in a unit of the files.")] = 1.0,
    held: Annotated[
        list[int] | None,
        typer.Option(help="Number of a marker that is held, from 1; else the two upper corners."),
    ] = None,
    after: Annotated[
        float, typer.Option(help="Seconds of each recording that do not count.")
    ] = 0.0,
    floor: Annotated[float | None, typer.Option(help="Height of a plane [m]; else none.")] = None,
    spacing: Annotated[float, typer.Option(help="Of the mesh, at most [m].")] = 0.025,
    out: Out = None,
    film: Film = True,
) -> None:
    """Cloths by motion capture: Coltraro et al., IJRR 2025. Nothing is downloaded."""
    from softgym_mj.reality.validation import marker_cases
    from softgym_mj.reality.validation.baselines import MARKERS

    sheet = made_of(fabric, parameters)
    files = marker_cases.check(folder)
    numbers = tuple(number - 1 for number in held) if held else None
    cases = marker_cases.run(
        folder, files, sheet, unit=unit, held=numbers, spacing=spacing, after=after, floor=floor
    )
    settings = {
        "fabric": dataclasses.asdict(sheet),
        "unit": unit,
        "held": held,
        "after": after,
        "floor": floor,
        "spacing": spacing,
    }
    _report(cases, marker_cases.PRIMARY, MARKERS, settings, [], out, film, floor)


def made_of(name: str, parameters: pathlib.Path | None) -> Fabric:
    """The named fabric with some attributes replaced."""
    return _replaced(Fabric.named(name), parameters)


def _replaced(fabric: Fabric, parameters: pathlib.Path | None) -> Fabric:
    """A fabric with the attributes of a file."""
    if parameters is None:
        return fabric
    values = read_json(parameters)
    valid = [field.name for field in dataclasses.fields(Fabric)]
    for key in values:
        if key not in valid:
            raise InvalidArgumentError(str(parameters), key, valid)
    bent = fabric.bent(values.get("bend_stiffness", fabric.bend_stiffness))
    return dataclasses.replace(bent, **values)


def _say_missing(missing: Sequence[str], where: str) -> None:
    if missing:
        console.print(f"Missing: {', '.join(missing)}. They are in {where}.")


def _report(
    cases: Iterable[Any],
    primary: str,
    baselines: Mapping[str, Mapping[str, float]],
    settings: Mapping[str, Any],
    missing: Sequence[str],
    out: pathlib.Path | None,
    films: bool,
    floor: float | None,
) -> None:
    """Measures cases one by one, shows the groups, and writes all if there is a folder for it."""
    from softgym_mj.reality.validation import pictures, report

    if out is not None:
        make_folder(out)
    done = []
    for case in cases:
        kinds = ", ".join(failure.kind for failure in case.failures) or "no failure"
        console.print(f"{case.name}: {1e3 * case.mean(primary):.1f} mm, {kinds}")
        if out is not None and films:
            pictures.film(case, floor).write(out / f"{case.name.replace('/', '_')}.mp4")
        done.append(case)
    found = report.summary(done, primary, baselines, settings, missing)
    console.print(_table(found))
    for note in dict.fromkeys(note for case in done for note in case.notes):
        console.print(f"Note: {note}.")
    if out is not None:
        files = [*report.write(done, found, out), out / "curves.png"]
        pictures.curves(done, primary, files[-1])
        console.print(f"wrote {', '.join(map(str, files))}{' and films' if films else ''}")


def _table(found: Mapping[str, Any]) -> rich.table.Table:
    """Groups: the primary distance, what it is compared with, and its rank among the published."""
    primary = found["primary"]
    columns = {
        primary: primary,
        f"surface_{primary}": "of the surface",
        "symmetric_visible": "visible side",
        f"real_{primary}": "between repeats",
        f"persistence_{primary}": "first frame held",
    }
    table = rich.table.Table(box=rich.box.SIMPLE, title="means of frames that count [mm]")
    table.add_column("group", overflow="fold")
    for title in (*columns.values(), "rank"):
        table.add_column(title, justify="right")
    for name, group in found["groups"].items():
        cells = []
        for column in columns:
            value = group["columns"].get(column, {"mean": None, "sd": None})
            shown = "-" if value["mean"] is None else f"{1e3 * value['mean']:.1f}"
            cells.append(shown + ("" if value["sd"] is None else f" ± {1e3 * value['sd']:.1f}"))
        ranked = group["ranked"]
        place = "-" if ranked is None or ranked["rank"] is None else str(ranked["rank"])
        table.add_row(name, *cells, place if ranked is None else f"{place} of {ranked['of']}")
    return table
