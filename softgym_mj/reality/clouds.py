"""Files of point clouds: binary PLY with colors."""

import dataclasses
import pathlib

import numpy as np

from softgym_mj.exceptions import InvalidArgumentError, StoreError

_PLY_POINT = np.dtype([("xyz", "<f8", 3), ("rgb", "u1", 3)])
_PLY_HEADER = (
    b"ply",
    b"format binary_little_endian 1.0",
    b"element vertex %d",
    *(b"property double " + axis for axis in (b"x", b"y", b"z")),
    *(b"property uchar " + color for color in (b"red", b"green", b"blue")),
    b"end_header",
)


@dataclasses.dataclass(frozen=True)
class Cloud:
    """Points observed by a camera.

    Attributes:
        points: (n, 3) [m].
        colors: (n, 3) uint8, red, green and blue.
    """

    points: np.ndarray
    colors: np.ndarray


def write_ply(path: pathlib.Path, cloud: Cloud) -> None:
    """Writes a cloud with colors as doubles and bytes, little-endian.

    Raises:
        InvalidArgumentError: if there are no points, or another number of colors.
    """
    points, colors = np.asarray(cloud.points), np.asarray(cloud.colors)
    if points.ndim != 2 or points.shape[1] != 3 or len(points) == 0:
        raise InvalidArgumentError("points", points.shape, "a shape (1 or more, 3)")
    if colors.shape != points.shape:
        raise InvalidArgumentError("colors", colors.shape, f"a shape {points.shape}")
    rows = np.empty(len(points), _PLY_POINT)
    rows["xyz"], rows["rgb"] = points, colors
    path.write_bytes(b"\n".join(_PLY_HEADER) % len(points) + b"\n" + rows.tobytes())


def read_ply(path: pathlib.Path) -> Cloud:
    """Reads a file of `write_ply`; comments in the header are ignored.

    Raises:
        StoreError: if the file is missing, truncated, of another layout, empty or not finite.
    """
    content = _content(path)
    header, mark, data = content.partition(b"end_header\n")
    lines = [line.rstrip() for line in (header + mark).splitlines()]
    lines = [line for line in lines if not line.startswith((b"comment", b"obj_info"))]
    number = _number(path, lines[2].rpartition(b" ")[2]) if len(lines) > 2 else 0
    if b"\n".join(lines) != b"\n".join(_PLY_HEADER) % number:
        raise StoreError(f"{path}: not a binary little-endian PLY of double xyz and uchar rgb")
    if len(data) != number * _PLY_POINT.itemsize:
        wanted = number * _PLY_POINT.itemsize
        raise StoreError(f"{path}: has {len(data)} bytes of points instead of {wanted}")
    rows = np.frombuffer(data, _PLY_POINT)
    return _checked(path, Cloud(rows["xyz"].astype(float), rows["rgb"].copy()))


def _content(path: pathlib.Path) -> bytes:
    try:
        return path.read_bytes()
    except OSError as error:
        raise StoreError(f"{path}: missing or unreadable ({error.strerror})") from error


def _number(path: pathlib.Path, word: bytes) -> int:
    if not word.isdigit():
        raise StoreError(f"{path}: {word!r} is not a number of points")
    return int(word)


def _checked(path: pathlib.Path, cloud: Cloud) -> Cloud:
    """Returns a cloud after checking that it has points, all finite."""
    if len(cloud.points) == 0:
        raise StoreError(f"{path}: an empty cloud")
    wrong = np.flatnonzero(~np.isfinite(cloud.points).all(axis=1))
    if len(wrong):
        raise StoreError(f"{path}: point {wrong[0]} is not finite")
    return cloud
