"""The rags: a folder that the archive was unpacked in, replayed."""

import dataclasses
import pathlib
from collections.abc import Callable, Iterator, Sequence

import numpy as np

from softgym_mj.entities.sheet import Fabric
from softgym_mj.exceptions import StoreError
from softgym_mj.reality import rag_scene, rags
from softgym_mj.reality.clouds import Cloud
from softgym_mj.reality.metrics import rag_distances
from softgym_mj.reality.pictures import camera_at
from softgym_mj.reality.recorder import Replay
from softgym_mj.reality.surfaces import SPACING, sample_surface
from softgym_mj.reality.validation.cases import Case, View, jitter_of, of_clouds, of_simulation

PRIMARY = "chamfer"
WHERE = (
    "Zenodo record 13823986 (its licence is to be read there): unpack its archive, SHA-256 "
    f"{rags.ARCHIVE_SHA256}, so that DIR/{rags.ROOT}/<cloth>_<repeat>/<primitive>/cloud/NNNNN.ply "
    "is there"
)
# Of an Azure Kinect, whose pose and focal length are not part of the data: about where the
# benchmark's own script puts a virtual one, on the far side of the table.
_CAMERA, _TARGET, _SIZE, _FIELD_OF_VIEW = (
    (-0.05, 1.774, 0.808),
    (0.259, 0.0, 0.6),
    (720, 1280),
    59.0,
)

Name = tuple[str, int, str]


@dataclasses.dataclass(frozen=True)
class Found:
    """Which sequences a folder has.

    Attributes:
        sequences: (cloth, repeat, primitive), in order.
        missing: those that it lacks.
    """

    sequences: tuple[Name, ...]
    missing: tuple[Name, ...]


def view() -> View:
    """Where the camera is assumed to have been."""
    calibration = camera_at(np.array(_CAMERA), np.array(_TARGET), _SIZE, _FIELD_OF_VIEW)
    return View(calibration, _SIZE, "the camera's pose and focal length are assumed")


def check(
    folder: pathlib.Path,
    cloths: Sequence[str] = rags.CLOTHS,
    primitives: Sequence[str] = tuple(rags.FRAMES),
    repeats: Sequence[int] = rags.REPEATS,
) -> Found:
    """Which of the sequences of these cloths, primitives and repeats are there.

    Raises:
        InvalidArgumentError: for a sequence that there is not.
        StoreError: if none of them is; it says where they are to be had.
    """
    wanted = [(cloth, i, name) for name in primitives for cloth in cloths for i in repeats]
    there = tuple(s for s in wanted if rags.sequence_folder(folder, *s).is_dir())
    missing = tuple(s for s in wanted if s not in there)
    if not there:
        places = rags.sequence_folder(folder, *wanted[0])
        raise StoreError(f"{folder}: no sequence is there, e.g. {places}; they are in {WHERE}")
    return Found(there, missing)


def replays(fabric: Fabric, frames: int | None, *, spacing: float, published: bool) -> Callable:
    """A function that replays each primitive once: of its name, what the rag does at the frames."""
    mesh, done = rag_scene.rag(spacing), dict[str, Replay]()

    def replayed(primitive: str) -> Replay:
        if primitive not in done:
            times = np.arange(frames or rags.FRAMES[primitive]) / rags.FRAME_RATE
            done[primitive] = rag_scene.replay_rag(
                fabric, primitive, times, mesh=mesh, published=published
            )
        return done[primitive]

    return replayed


def run(
    folder: pathlib.Path,
    found: Found,
    fabric: Fabric,
    *,
    frames: int | None = None,
    spacing: float = rag_scene.SPACING,
    sampled: float = SPACING,
    published: bool = False,
) -> Iterator[Case]:
    """Replays sequences and measures them, one after the other.

    Args:
        folder: of the data.
        found: which sequences.
        fabric: what the rag is made of.
        frames: how many each sequence has, if it is not the published number.
        spacing: of the mesh [m].
        sampled: how far apart points of its surface are [m].
        published: as of `rag_scene.hands`.

    Raises:
        StoreError: with the name of the file, if frames are missing or damaged.
    """
    replayed = replays(fabric, frames, spacing=spacing, published=published)
    mesh, camera = rag_scene.rag(spacing), view()
    surface = sample_surface(mesh.points, mesh.triangles, sampled)
    read: dict[Name, list[Cloud]] = {}
    for sequence in found.sequences:
        cloth, repeat, primitive = sequence
        alike = [s for s in found.sequences if (s[0], s[2]) == (cloth, primitive)]
        read = {s: clouds for s, clouds in read.items() if s in alike}
        read |= {s: rags.read_sequence(folder, *s, frames) for s in alike if s not in read}
        clouds = [cloud.points for cloud in read[sequence]]
        result = replayed(primitive)
        columns = of_clouds(
            result.positions,
            clouds,
            lambda simulated, real: dataclasses.asdict(rag_distances(simulated, real)),
            triangles=mesh.triangles,
            surface=surface,
            view=camera,
            repeats=[[c.points for c in read[s]] for s in alike if s != sequence],
        )
        counted = np.arange(len(clouds)) < rags.counted_frames(cloth, repeat, primitive)
        colors = [cloud.colors for cloud in read[sequence] if cloud.colors is not None]
        yield Case(
            name=f"{cloth}_{repeat}/{primitive}",
            group=f"{cloth}/{primitive}",
            times=result.times,
            counted=counted,
            columns=columns | of_simulation(result),
            jitter=jitter_of(result.positions[counted], result.times[counted]),
            failures=result.failures,
            notes=(camera.assumed, *_notes(primitive, published)),
            positions=result.positions,
            clouds=clouds,
            colors=colors if len(colors) == len(clouds) else None,
            mesh=mesh,
            held=rag_scene.corners(mesh),
        )


def _notes(primitive: str, published: bool) -> tuple[str, ...]:
    """What is not known of how the arms moved."""
    if primitive != "dynamic":
        return ()
    how = "as the benchmark samples them" if published else "as functions of time"
    return (
        f"grippers move {how}; the benchmark's own samples stop for 10 ms at 1.1 s, and what the "
        "arms were sent is not known",
    )
