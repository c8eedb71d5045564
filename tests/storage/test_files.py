"""Files: what is none is refused, what cannot be written leaves what was there."""

import multiprocessing
import os
import pathlib
import socket

import numpy as np
import pytest

from softgym_mj.exceptions import StoreError
from softgym_mj.rendering.offscreen import Video, write_picture
from softgym_mj.storage.files import read_json, read_whole, whole, write_json, write_whole

LARGE = np.random.default_rng(0).integers(0, 256, (4, 512, 512, 3), np.uint8)  # 3 MB.
WRITERS = {
    "bytes": lambda file: write_whole(file, LARGE.tobytes()),
    "json": lambda file: write_json(file, {"a": LARGE[0].tolist()}),
    "picture": lambda file: write_picture(LARGE[0].repeat(2, axis=0), file),
    "video": lambda file: Video(LARGE, 5.0).write(file),
}


def odd(kind, path):
    """Makes what is no file."""
    if kind == "pipe":
        os.mkfifo(path)
    elif kind == "socket":
        with socket.socket(socket.AF_UNIX) as server:
            server.bind(str(path))
    elif kind == "folder":
        path.mkdir()
    elif kind == "device":
        path.symlink_to("/dev/zero")
    elif kind == "loop":
        path.symlink_to(path)
    elif kind == "in a file":
        path.parent.joinpath("file").touch()
        return path.parent / "file" / "x"
    elif kind == "long name":
        return path.with_name("x" * 5000)
    elif kind == "null byte":
        return path.with_name("x\0y")
    return path


ODD = ("pipe", "socket", "folder", "device", "loop", "in a file", "long name", "null byte")


@pytest.mark.parametrize("kind", (*ODD, "missing"))
@pytest.mark.parametrize("read", [read_whole, read_json])
def test_what_is_no_file_is_not_read(kind, read, tmp_path):
    path = odd(kind, tmp_path / "name")
    with pytest.raises(StoreError) as error:
        read(path)
    assert str(error.value).startswith(f"{path} cannot be read: ")


@pytest.mark.parametrize("kind", ODD)
def test_what_is_no_file_is_not_replaced(kind, tmp_path):
    """Least of all a device: root's `--out /dev/null` must not make a file of it."""
    path = odd(kind, tmp_path / "name")
    before = sorted(tmp_path.iterdir())
    if kind == "loop":  # A link is replaced, not followed.
        write_whole(path, b"new")
        assert path.read_bytes() == b"new"
        return
    with pytest.raises(StoreError) as error:
        write_whole(path, b"new")
    assert str(error.value).startswith(f"{path} cannot be written: ")
    assert sorted(tmp_path.iterdir()) == before


@pytest.mark.parametrize("content", [b"{", b"[1]", b"\xff\xfe\xfa", b"[" * 10**6, b""])
def test_what_is_no_json_object(content, tmp_path):
    file = tmp_path / "a.json"
    file.write_bytes(content)
    with pytest.raises(StoreError, match=r"a\.json cannot be read: "):
        read_json(file)


@pytest.mark.parametrize("kind", WRITERS)
@pytest.mark.parametrize("trouble", ["full", "read-only"])
def test_what_cannot_be_written_leaves_the_old_file(kind, trouble, disk):
    file = disk.path / "out.mp4"
    file.write_bytes(b"old")
    if trouble == "full":
        disk.fill(left=64 << 10)
    else:
        disk.set_writable(False)
    names = sorted(os.listdir(disk.path))
    with pytest.raises(StoreError) as error:
        WRITERS[kind](file)
    reason = {"full": "No space left on device", "read-only": "Read-only file system"}[trouble]
    assert str(error.value).startswith(f"{file} cannot be written: ") and reason in str(error.value)
    assert file.read_bytes() == b"old" and sorted(os.listdir(disk.path)) == names
    with pytest.raises(StoreError):
        WRITERS[kind](disk.path / "new" / "out.mp4")
    assert not (disk.path / "new" / "out.mp4").exists()


def test_an_interruption_leaves_the_old_file(tmp_path):
    file = tmp_path / "file"
    file.write_bytes(b"old")
    for error in (KeyboardInterrupt, SystemExit, ArithmeticError):
        with pytest.raises(error), whole(file) as partial:
            partial.write_bytes(b"new")
            raise error
    assert [path.name for path in tmp_path.iterdir()] == ["file"] and file.read_bytes() == b"old"


def write_often(folder, number):
    for _ in range(200):
        write_whole(pathlib.Path(folder) / "file", bytes([number]) * 1000)


def test_many_writers_of_one_folder(tmp_path):
    context = multiprocessing.get_context("spawn")
    processes = [context.Process(target=write_often, args=(tmp_path, i)) for i in range(2)]
    for process in processes:
        process.start()
    for process in processes:
        process.join()
        assert process.exitcode == 0
    (file,) = tmp_path.iterdir()
    assert len(file.read_bytes()) == 1000 and len(set(file.read_bytes())) == 1
