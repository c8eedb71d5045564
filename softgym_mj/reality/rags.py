"""Recordings of three rags under two primitives: Blanco-Mulero et al., RA-L 9(3), 2024.

They are Zenodo record 13823986, which states the license; nothing is downloaded here. Its archive
unpacks to `Benchmarking_cloth/<cloth>_<repeat>/<primitive>/cloud/NNNNN.ply`, 30 frames a second.
"""

import pathlib
from collections.abc import Sequence

from softgym_mj.exceptions import InvalidArgumentError, StoreError, check_count, check_name
from softgym_mj.reality.clouds import Cloud, read_ply, write_ply

ROOT = "Benchmarking_cloth"
FRAME_RATE = 30.0  # [1/s]
CLOTHS = ("chequered", "cotton", "linen")  # Tables call cotton "towel".
REPEATS = (0, 1, 2)
FRAMES = {"dynamic": 130, "quasi_static": 420}  # Frames of each sequence.
# Number of frames of "dynamic", in each repeat, over which the published distances are averaged:
# those before the rag touches the table. Of "quasi_static" all count.
FRAMES_BEFORE_CONTACT = {"chequered": (95, 95, 99), "cotton": (99, 98, 99), "linen": (90, 89, 89)}


def counted_frames(cloth: str, repeat: int, primitive: str) -> int:
    """Returns the number of frames of a sequence over which the published distances are averaged.

    Raises:
        InvalidArgumentError: for an unknown sequence.
    """
    _check(cloth, repeat, primitive)
    everything = FRAMES[primitive]
    return FRAMES_BEFORE_CONTACT[cloth][repeat] if primitive == "dynamic" else everything


def sequence_folder(folder: pathlib.Path, cloth: str, repeat: int, primitive: str) -> pathlib.Path:
    """Returns the folder of a sequence's clouds below the folder of the unpacked archive.

    Raises:
        InvalidArgumentError: for an unknown sequence.
    """
    _check(cloth, repeat, primitive)
    return folder / ROOT / f"{cloth}_{repeat}" / primitive / "cloud"


def read_sequence(
    folder: pathlib.Path, cloth: str, repeat: int, primitive: str, frames: int | None = None
) -> list[Cloud]:
    """Reads the clouds of a sequence, in the frame of the published gripper positions.

    Args:
        folder: folder of the unpacked archive.
        cloth, repeat, primitive: of `CLOTHS`, `REPEATS`, `FRAMES`.
        frames: expected number of frames; None for `FRAMES`.

    Raises:
        InvalidArgumentError: for an unknown sequence.
        StoreError: with the name of the file, if frames are missing, too many or damaged.
    """
    clouds = sequence_folder(folder, cloth, repeat, primitive)
    number = FRAMES[primitive] if frames is None else check_count("frames", frames, 1)
    paths = [clouds / f"{i:05d}.ply" for i in range(number)]
    for path in paths:
        if not path.is_file():
            raise StoreError(f"{path}: a missing frame; there have to be {number}")
    beyond = sorted(set(clouds.glob("*.ply")) - set(paths))
    if beyond:
        raise StoreError(f"{beyond[0]}: a frame too many; there have to be {number}")
    return [read_ply(path) for path in paths]


def write_sequence(
    folder: pathlib.Path, cloth: str, repeat: int, primitive: str, clouds: Sequence[Cloud]
) -> None:
    """Writes clouds in the format of `read_sequence`.

    Raises:
        InvalidArgumentError: for an unknown sequence, or clouds without colors.
    """
    target = sequence_folder(folder, cloth, repeat, primitive)
    target.mkdir(parents=True, exist_ok=True)
    for i, cloud in enumerate(clouds):
        write_ply(target / f"{i:05d}.ply", cloud)


def _check(cloth: str, repeat: int, primitive: str) -> None:
    check_name("cloth", cloth, CLOTHS)
    check_name("primitive", primitive, FRAMES)
    if repeat not in REPEATS:
        raise InvalidArgumentError("repeat", repeat, REPEATS)
