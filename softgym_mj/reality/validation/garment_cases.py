"""Garments: a folder of captures and meshes, each replayed with two vertices that follow hands."""

import dataclasses
import pathlib
from collections.abc import Iterator, Sequence

import numpy as np

from softgym_mj.entities.sheet import Fabric
from softgym_mj.exceptions import StoreError
from softgym_mj.reality import garment_scene, garments
from softgym_mj.reality.garment_windows import MESHES, SHOULDERS, WINDOWS, Window
from softgym_mj.reality.garments import Capture
from softgym_mj.reality.meshes import Mesh
from softgym_mj.reality.metrics import garment_distances
from softgym_mj.reality.pictures import camera_at
from softgym_mj.reality.surfaces import SPACING, sample_surface
from softgym_mj.reality.validation.cases import Case, View, jitter_of, of_clouds, of_simulation
from softgym_mj.rendering.calibration import Calibration

PRIMARY = "chamfer"
WHERE = (
    "the data set RGBench/RGBench-Cloth-Sim2Real-v1 on Hugging Face (6.7 GB, CC-BY 4.0), so that "
    "DIR/<garment>/<garment>_<action>_<stamp> and DIR/meshes are there"
)
FABRICS = {
    "beige_hoodie": "rgbench_hoodie",
    "brown_coat": "rgbench_coat",
    "green_tshirt": "rgbench_t_shirt",
    "grey_pleat_skirt": "rgbench_pleated_skirt",
    "grey_sunwear": "rgbench_sun_jacket",
    "khaki_blazer": "rgbench_blazer",
    "white_cakeskirt": "rgbench_cake_skirt",
    "white_shirt": "rgbench_shirt",
}  # What the benchmark says that they are made of; of the blue dress nothing is stored.
_SIZE, _FIELD_OF_VIEW = (720, 1280), 57.0  # Of a RealSense D455: focal lengths are not in the data.
_FRAMES = 1.5  # How many frames a delay may be and not be noted.
_NEARER = 0.5  # By which factor exchanged arms have to be nearer to the cloud to be noted.


@dataclasses.dataclass(frozen=True)
class Found:
    """What a folder has.

    Attributes:
        captures: folders of captures.
        missing: those of the benchmark's list that it lacks, of the garments and actions asked for.
    """

    captures: tuple[pathlib.Path, ...]
    missing: tuple[str, ...]


def check(
    folder: pathlib.Path,
    chosen: Sequence[str] = garments.GARMENTS,
    actions: Sequence[str] = garments.ACTIONS,
) -> Found:
    """Which captures of these garments and actions are there.

    Raises:
        StoreError: if none of them is; it says where they are to be had.
    """
    there = {}
    for path in sorted(folder.glob("*/*")):
        if (path / "segment_pcds").is_dir():
            garment, action = garments.case(path)
            if garment in chosen and action in actions:
                there[path.name] = path
    wanted = [
        name
        for name in WINDOWS
        if (case := garments.case(pathlib.Path(name)))[0] in chosen and case[1] in actions
    ]
    if not there:
        raise StoreError(f"{folder}: no capture is there; they are in {WHERE}")
    return Found(tuple(there.values()), tuple(name for name in wanted if name not in there))


def mesh_file(folder: pathlib.Path, garment: str) -> pathlib.Path:
    """The OBJ that the benchmark simulates; of a garment that it does not say, the only one.

    Raises:
        StoreError: if it is not there.
    """
    if garment in MESHES:
        path = folder / "meshes" / MESHES[garment]
        if path.is_file():
            return path
        raise StoreError(f"{path}: a missing mesh; it is in {WHERE}")
    alike = [
        path
        for path in (folder / "meshes").glob("*/*.obj")
        if path.parent.name.lower() == garment.lower()
    ]
    if len(alike) == 1:
        return alike[0]
    raise StoreError(f"{folder / 'meshes'}: {len(alike)} meshes of {garment}; expected 1")


def run(
    folder: pathlib.Path,
    found: Found,
    *,
    fabric: Fabric | None = None,
    mesh: pathlib.Path | None = None,
    held: tuple[int, ...] | None = None,
    window: Window | None = None,
    swapped: bool = False,
    place: tuple[float, float] = garment_scene.PLACE,
    sampled: float = SPACING,
) -> Iterator[Case]:
    """Replays captures and measures them, one after the other.

    Args:
        folder: of the data.
        found: which captures.
        fabric: what garments are made of; None for what the benchmark says, with the thickness
            that its meshes allow.
        mesh: an OBJ; None for the benchmark's.
        held: vertices by the order of the OBJ that arms hold; None for the benchmark's.
        window: of what counts; None for the benchmark's.
        swapped: whether the left arm's base is at Y = -0.25 m instead of 0.25 m.
        place: of the origin of meshes, X and Y [m].
        sampled: how far apart points of surfaces are [m].

    Raises:
        StoreError: with the name of the file, if anything is missing or damaged.
    """
    shapes: dict[pathlib.Path, Mesh] = {}
    clouds: dict[str, tuple[np.ndarray, list[np.ndarray]]] = {}
    for path in found.captures:
        capture = garments.read_capture(path)
        counts = window or WINDOWS.get(path.name)
        if counts is None:
            raise StoreError(f"{path}: not in the benchmark's list; say which seconds count")
        file = mesh or mesh_file(folder, capture.garment)
        if file not in shapes:
            shapes[file] = garment_scene.garment_mesh(file)
        pins = held or (SHOULDERS.get(capture.garment) if capture.action == "fling" else None)
        vertices = garment_scene.vertices_of_file(file, shapes[file], pins) if pins else None
        yield _case(
            path, capture, counts, shapes[file], _made_of(fabric, capture), vertices,
            swapped, place, sampled, _others(folder, found, path, capture, clouds),
        )  # fmt: skip


def _case(
    path: pathlib.Path,
    capture: Capture,
    window: Window,
    mesh: Mesh,
    fabric: Fabric,
    held: tuple[int, ...] | None,
    swapped: bool,
    place: tuple[float, float],
    sampled: float,
    repeats: list[list[np.ndarray]],
) -> Case:
    """A capture and its replay, over the window."""
    times, inside = _inside(capture, window)
    if not inside.any():
        raise StoreError(f"{path / 'segment_pcds'}: no cloud from {window.begin} to {window.end} s")
    points = [cloud for cloud, i in zip(capture.world_clouds(), inside, strict=True) if i]
    bases = {a: -y if swapped else y for a, y in garment_scene.BASES.items()}
    paths = garment_scene.ends(capture, bases)
    result, vertices = garment_scene.replay_garment(
        mesh, fabric, capture.action, paths, times[inside],
        begin=window.begin, held=held, place=place,
    )  # fmt: skip
    camera = camera_at(np.zeros(3), np.array([1.0, 0.0, 0.0]), _SIZE, _FIELD_OF_VIEW)
    view = View(Calibration(camera.intrinsics, capture.camera), _SIZE)
    columns = of_clouds(
        result.positions,
        points,
        lambda simulated, real: dataclasses.asdict(garment_distances(simulated, real)),
        triangles=mesh.triangles,
        surface=sample_surface(mesh.points, mesh.triangles, sampled),
        view=view,
        repeats=repeats,
    )
    return Case(
        name=path.name,
        group=f"{capture.garment}/{capture.action}",
        times=result.times,
        counted=np.ones(len(points), bool),
        columns=columns | of_simulation(result),
        jitter=jitter_of(result.positions, result.times),
        failures=result.failures,
        notes=_notes(path, capture, window, points, bases, times),
        positions=result.positions,
        clouds=points,
        colors=None,
        mesh=mesh,
        held=vertices,
    )


def _inside(capture: Capture, window: Window) -> tuple[np.ndarray, np.ndarray]:
    """Times of clouds [s] in the simulation, and which are in the window."""
    times = capture.simulated_times(window.delay)
    return times, (times >= window.begin) & (times <= window.end)


def _others(
    folder: pathlib.Path,
    found: Found,
    path: pathlib.Path,
    capture: Capture,
    known: dict[str, tuple[np.ndarray, list[np.ndarray]]],
) -> list[list[np.ndarray]]:
    """Clouds of the other captures of the same, each at the same time after its window's begin."""
    window = WINDOWS.get(path.name)
    if window is None:
        return []
    alike = [p for p in found.captures if garments.case(p) == garments.case(path)]
    for name in [name for name in known if name not in {p.name for p in alike}]:
        del known[name]
    for other in alike:
        if other.name not in known and other.name in WINDOWS:
            read = capture if other == path else garments.read_capture(other)
            own = WINDOWS[other.name]
            times, inside = _inside(read, own)
            clouds = [c for c, i in zip(read.world_clouds(), inside, strict=True) if i]
            known[other.name] = times[inside] - own.begin, clouds
    when = known[path.name][0]
    aligned = []
    for name, (times, clouds) in known.items():
        if name != path.name and len(times):
            during = when[when <= times[-1]]
            aligned.append([clouds[int(np.argmin(np.abs(times - t)))] for t in during])
    return aligned


def _made_of(fabric: Fabric | None, capture: Capture) -> Fabric:
    if fabric is not None:
        return fabric
    if capture.garment not in FABRICS:
        raise StoreError(f"what {capture.garment} is made of is not known: name a fabric")
    named = Fabric.named(FABRICS[capture.garment])
    return dataclasses.replace(named, thickness=garment_scene.THICKNESS)


def _notes(
    path: pathlib.Path,
    capture: Capture,
    window: Window,
    points: Sequence[np.ndarray],
    bases: dict[str, float],
    times: np.ndarray,
) -> tuple[str, ...]:
    """Slips of a capture, none of which is repaired, and what is assumed."""
    notes = [
        "the garment lies flat at the benchmark's default place: its start was not recorded",
        "the camera's focal length is assumed",
    ]
    frame = float(np.median(np.diff(times))) if len(times) > 1 else np.inf
    if window.delay > _FRAMES * frame:
        notes.append(f"{path.name}: a delay of {window.delay} s, at {frame:.3f} s a frame")
    if window.begin < times[0] - frame or window.end > times[-1] + frame:
        notes.append(
            f"{path.name}: counts from {window.begin} to {window.end} s, clouds are from "
            f"{times[0]:.2f} to {times[-1]:.2f} s"
        )
    exchanged = {arm: -y for arm, y in bases.items()}
    own, other = (
        _distance(garment_scene.ends(capture, some), points[0], window.begin)
        for some in (bases, exchanged)
    )
    if other < _NEARER * own:
        notes.append(
            f"{path.name}: hands are {1e3 * own:.0f} mm from the first cloud, with the arms' bases "
            f"exchanged {1e3 * other:.0f} mm"
        )
    return tuple(notes)


def _distance(paths: dict, cloud: np.ndarray, when: float) -> float:
    """Mean distance [m] of the end effectors from a cloud (n, 3) [m] at a time [s]."""
    places = np.concatenate([path(np.array([when]))[0] for path in paths.values()])
    return float(np.mean([np.linalg.norm(cloud - place, axis=1).min() for place in places]))
