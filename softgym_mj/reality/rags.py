"""Recordings of three rags under two primitives: Blanco-Mulero et al., RA-L 9(3), 2024.

Zenodo record 13823986, whose licence is to be read there; nothing is downloaded here. Its archive
unpacks to `Benchmarking_cloth/<cloth>_<repeat>/<primitive>/cloud/NNNNN.ply`, 30 frames a second.
"""

import pathlib
from collections.abc import Sequence

from softgym_mj.exceptions import InvalidArgumentError, StoreError, check_count, check_name
from softgym_mj.reality.clouds import Cloud, read_ply, write_ply

ROOT = "Benchmarking_cloth"
FRAME_RATE = 30.0  # [1/s]
CLOTHS = ("chequered", "cotton", "linen")  # Cotton is the one that tables call towel.
REPEATS = (0, 1, 2)
FRAMES = {"dynamic": 130, "quasi_static": 420}  # Of each sequence.
# How many frames of "dynamic" the published distances are means of, in each repeat: those before
# the rag touches the table. Of "quasi_static" all count.
FRAMES_BEFORE_CONTACT = {"chequered": (95, 95, 99), "cotton": (99, 98, 99), "linen": (90, 89, 89)}


def counted_frames(cloth: str, repeat: int, primitive: str) -> int:
    """How many frames of a sequence, from its first, the published distances are means of.

    Raises:
        InvalidArgumentError: for a sequence that there is not.
    """
    _check(cloth, repeat, primitive)
    everything = FRAMES[primitive]
    return FRAMES_BEFORE_CONTACT[cloth][repeat] if primitive == "dynamic" else everything


def sequence_folder(folder: pathlib.Path, cloth: str, repeat: int, primitive: str) -> pathlib.Path:
    """Where the clouds of a sequence are, below the folder that the archive was unpacked in.

    Raises:
        InvalidArgumentError: for a sequence that there is not.
    """
    _check(cloth, repeat, primitive)
    return folder / ROOT / f"{cloth}_{repeat}" / primitive / "cloud"


def read_sequence(
    folder: pathlib.Path, cloth: str, repeat: int, primitive: str, frames: int | None = None
) -> list[Cloud]:
    """The clouds of a sequence, frame by frame, in the frame of the published gripper positions.

    Args:
        folder: that the archive was unpacked in.
        cloth, repeat, primitive: of `CLOTHS`, `REPEATS`, `FRAMES`.
        frames: how many there have to be; None for `FRAMES`.

    Raises:
        InvalidArgumentError: for a sequence that there is not.
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
    """Writes clouds as `read_sequence` reads them.

    Raises:
        InvalidArgumentError: for a sequence that there is not, or clouds without colours.
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
