"""Files of point clouds: binary PLY as rags have it, PCD as garments have it."""

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
_PCD_KEYS = (
    "VERSION",
    "FIELDS",
    "SIZE",
    "TYPE",
    "COUNT",
    "WIDTH",
    "HEIGHT",
    "VIEWPOINT",
    "POINTS",
    "DATA",
)
_PCD_KINDS = {"F": "f", "U": "u", "I": "i"}


@dataclasses.dataclass(frozen=True)
class Cloud:
    """Points that a camera saw.

    Attributes:
        points: (n, 3) [m], of the kind of number that the file has.
        colors: (n, 3) uint8, red, green and blue; None if the file has none.
    """

    points: np.ndarray
    colors: np.ndarray | None = None


def write_ply(path: pathlib.Path, cloud: Cloud) -> None:
    """Writes a cloud with colours as doubles and bytes, little-endian.

    Raises:
        InvalidArgumentError: if colours are missing or of another number.
    """
    points, colors = _points(cloud), cloud.colors
    if colors is None or colors.shape != points.shape:
        shape = None if colors is None else colors.shape
        raise InvalidArgumentError("colors", shape, f"a shape {points.shape}")
    rows = np.empty(len(points), _PLY_POINT)
    rows["xyz"], rows["rgb"] = points, colors
    path.write_bytes(b"\n".join(_PLY_HEADER) % len(points) + b"\n" + rows.tobytes())


def read_ply(path: pathlib.Path) -> Cloud:
    """Reads what `write_ply` writes; comments in the header are passed over.

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


def write_pcd(path: pathlib.Path, points: np.ndarray) -> None:
    """Writes points (n, 3) [m] of single or double precision as binary PCD.

    Raises:
        InvalidArgumentError: for another shape or kind of number.
    """
    points = _points(Cloud(points))
    size = points.dtype.itemsize
    if points.dtype not in (np.dtype("<f4"), np.dtype("<f8")):
        raise InvalidArgumentError("points", points.dtype, "float32 or float64")
    values = dict.fromkeys(("WIDTH", "POINTS"), str(len(points))) | {
        "VERSION": "0.7",
        "FIELDS": "x y z",
        "SIZE": " ".join([str(size)] * 3),
        "TYPE": "F F F",
        "COUNT": "1 1 1",
        "HEIGHT": "1",
        "VIEWPOINT": "0 0 0 1 0 0 0",
        "DATA": "binary",
    }
    header = "".join(f"{key} {values[key]}\n" for key in _PCD_KEYS)
    path.write_bytes(header.encode() + np.ascontiguousarray(points).tobytes())


def read_pcd(path: pathlib.Path) -> Cloud:
    """Reads the points of a PCD, binary or as text, whatever other fields it has.

    Raises:
        StoreError: if the file is missing, truncated, compressed, of another layout, empty or not
            finite.
    """
    header, data = _pcd_header(path, _content(path))
    names = header["FIELDS"]
    try:
        sizes, counts = ([int(word) for word in header[key]] for key in ("SIZE", "COUNT"))
        kinds = [_PCD_KINDS[word] for word in header["TYPE"]]
        layout = np.dtype(
            [
                (f"{i} {name}", f"<{kind}{size}", (count,))
                for i, (name, kind, size, count) in enumerate(
                    zip(names, kinds, sizes, counts, strict=True)
                )
            ]
        )
        places = [f"{names.index(axis)} {axis}" for axis in "xyz"]
    except (ValueError, KeyError, TypeError):
        raise StoreError(f"{path}: its header does not describe points x, y, z") from None
    number = _number(path, header["POINTS"][0].encode())
    if header["DATA"] == ["binary"]:
        if len(data) != number * layout.itemsize:
            wanted = number * layout.itemsize
            raise StoreError(f"{path}: has {len(data)} bytes of points instead of {wanted}")
        rows = np.frombuffer(data, layout)
        points = np.concatenate([rows[place] for place in places], axis=1)
    elif header["DATA"] == ["ascii"]:
        firsts = np.cumsum(counts) - counts
        try:
            table = np.array([line.split() for line in data.splitlines()], float)
            table = table.reshape(number, sum(counts))
        except ValueError:
            raise StoreError(f"{path}: not {number} lines of {sum(counts)} numbers") from None
        points = table[:, [firsts[names.index(axis)] for axis in "xyz"]]
    else:
        raise StoreError(f"{path}: DATA {' '.join(header['DATA'])}; binary or ascii can be read")
    return _checked(path, Cloud(points))


def _pcd_header(path: pathlib.Path, content: bytes) -> tuple[dict[str, list[str]], bytes]:
    """The words of each line, and what follows."""
    header: dict[str, list[str]] = {}
    while "DATA" not in header:
        line, newline, content = content.partition(b"\n")
        words = line.decode("ascii", "replace").split()
        if not newline or (words and not words[0].startswith("#") and words[0] not in _PCD_KEYS):
            raise StoreError(f"{path}: the header of a PCD ends before DATA")
        if words and words[0] in _PCD_KEYS:
            header[words[0]] = words[1:]
    header.setdefault("COUNT", ["1"] * len(header.get("FIELDS", ())))
    missing = [key for key in ("FIELDS", "SIZE", "TYPE", "POINTS") if not header.get(key)]
    if missing:
        raise StoreError(f"{path}: the header of a PCD lacks {', '.join(missing)}")
    return header, content


def _content(path: pathlib.Path) -> bytes:
    try:
        return path.read_bytes()
    except OSError as error:
        raise StoreError(f"{path}: missing or unreadable ({error.strerror})") from error


def _number(path: pathlib.Path, word: bytes) -> int:
    if not word.isdigit():
        raise StoreError(f"{path}: {word!r} is no number of points")
    return int(word)


def _points(cloud: Cloud) -> np.ndarray:
    """Points that can be written."""
    points = np.asarray(cloud.points)
    if points.ndim != 2 or points.shape[1] != 3 or len(points) == 0:
        raise InvalidArgumentError("points", points.shape, "a shape (1 or more, 3)")
    return points


def _checked(path: pathlib.Path, cloud: Cloud) -> Cloud:
    """A cloud that has points, all of them somewhere."""
    if len(cloud.points) == 0:
        raise StoreError(f"{path}: an empty cloud")
    wrong = np.flatnonzero(~np.isfinite(cloud.points).all(axis=1))
    if len(wrong):
        raise StoreError(f"{path}: point {wrong[0]} is not finite")
    return cloud
