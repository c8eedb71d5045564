"""Recordings of five cables: Chen et al., "Differentiable Discrete Elastic Rods", CoRL 2024.

Their files are `data_set/DLO<1 to 5>/<train or eval>/<number>.pkl` of `SOURCE`: nested lists of
marker positions in meters, frame by axis by marker, 100 frames a second, Z up. Two robots hold the
first two and the last two markers. Nothing is downloaded here.
"""

import dataclasses
import io
import pathlib
import pickle
from collections.abc import Sequence

import numpy as np

from softgym_mj.exceptions import StoreError, check_name
from softgym_mj.reality.folders import no_recordings
from softgym_mj.storage.files import read_whole

SOURCE = "github.com/roahmlab/DEFORM, commit b73b8b8"
GUIDE = (
    f"the folder `data_set` of {SOURCE}, with DLO1/eval/*.pkl and so on; this command downloads "
    "nothing, and that repository has no license file"
)
CABLES = ("DLO1", "DLO2", "DLO3", "DLO4", "DLO5")
SPLITS = ("train", "eval")
FRAME_TIME = 0.01  # [s]
HELD = (0, 1, -2, -1)  # Markers that the robots hold.
FEWEST_MARKERS = 6  # Two of them free.
FEWEST_FRAMES = 3  # Two are the start.


@dataclasses.dataclass(frozen=True)
class Recording:
    """Recorded motion of a cable.

    Attributes:
        cable: Name of the cable.
        name: Name of the recording.
        markers: (f, n, 3) [m] marker positions in each frame, along the cable.
    """

    cable: str
    name: str
    markers: np.ndarray


class _PlainUnpickler(pickle.Unpickler):
    """Reads lists, numbers and the like; a pickle that names any class or function is refused."""

    def find_class(self, module, name):
        raise pickle.UnpicklingError(f"it names {module}.{name}, which could run code")


def read_recording(cable: str, file: pathlib.Path) -> Recording:
    """Reads a file; the objects in it are numbers in lists.

    Raises:
        StoreError: If the file is missing, damaged, of another layout, not finite, or names a class
            or a function.
    """
    content = read_whole(file)
    try:
        markers = np.array(_PlainUnpickler(io.BytesIO(content)).load(), dtype=float)
    except Exception as error:  # Damaged pickles raise almost anything.
        raise StoreError(f"{file} is not a recording: {error}") from error
    if (
        markers.ndim != 3
        or markers.shape[0] < FEWEST_FRAMES
        or markers.shape[1] != 3
        or markers.shape[2] < FEWEST_MARKERS
    ):
        valid = f"(frames >= {FEWEST_FRAMES}, 3, markers >= {FEWEST_MARKERS})"
        raise StoreError(f"{file} is not a recording: shape {markers.shape}, not {valid}")
    if not np.isfinite(markers).all():
        raise StoreError(f"{file} is not a recording: positions are not finite")
    return Recording(cable, file.stem, np.ascontiguousarray(markers.transpose(0, 2, 1)))


def read_recordings(folder: pathlib.Path | None, cable: str, split: str) -> list[Recording]:
    """Reads all recordings of a cable, in the order of their numbers.

    Args:
        folder: The folder `data_set` of `SOURCE`.
        cable, split: Of `CABLES` and `SPLITS`.

    Raises:
        InvalidArgumentError: For an unknown name, or a folder without recordings of this cable.
        StoreError: For a file that is no recording, or with another number of markers.
    """
    check_name("cable", cable, CABLES)
    check_name("split", split, SPLITS)
    files = [] if folder is None else sorted((folder / cable / split).glob("*.pkl"), key=_order)
    if not files:
        raise no_recordings(folder, GUIDE)
    recordings = [read_recording(cable, file) for file in files]
    _check_alike(files, recordings)
    return recordings


def _order(file: pathlib.Path) -> tuple[int, str]:
    return int(file.stem) if file.stem.isdecimal() else -1, file.stem


def _check_alike(files: Sequence[pathlib.Path], recordings: Sequence[Recording]) -> None:
    expected = recordings[0].markers.shape[1]
    for file, recording in zip(files, recordings, strict=True):
        if recording.markers.shape[1] != expected:
            found = recording.markers.shape[1]
            raise StoreError(f"{file} has {found} markers, {files[0]} has {expected}")
