"""The layout of the rags: read as it was written, bit by bit, and damage by its file."""

import struct

import numpy as np
import pytest

from softgym_mj.exceptions import InvalidArgumentError, StoreError
from softgym_mj.reality import clouds, rags

FRAMES = 4


def colored(rng, number=20):
    points, colors = rng.normal(size=(number, 3)), rng.integers(0, 256, (number, 3), np.uint8)
    return clouds.Cloud(points, colors)


@pytest.fixture(name="rag_folder")
def _rag_folder(tmp_path):
    rng = np.random.default_rng(0)
    written = [colored(rng, 20 + i) for i in range(FRAMES)]
    rags.write_sequence(tmp_path, "linen", 2, "dynamic", written)
    return tmp_path, written


def test_rags_come_back_bit_by_bit(rag_folder):
    folder, written = rag_folder
    read = rags.read_sequence(folder, "linen", 2, "dynamic", frames=FRAMES)
    for before, after in zip(written, read, strict=True):
        assert after.points.tobytes() == before.points.tobytes()
        assert after.colors.tobytes() == before.colors.tobytes()


def test_a_ply_has_the_published_bytes(tmp_path):
    cloud = clouds.Cloud(np.array([[0.1, -2.0, 3.5]]), np.array([[1, 2, 255]], np.uint8))
    clouds.write_ply(tmp_path / "one.ply", cloud)
    header = (
        "ply\nformat binary_little_endian 1.0\nelement vertex 1\nproperty double x\n"
        "property double y\nproperty double z\nproperty uchar red\nproperty uchar green\n"
        "property uchar blue\nend_header\n"
    )
    data = struct.pack("<3d3B", 0.1, -2.0, 3.5, 1, 2, 255)
    assert (tmp_path / "one.ply").read_bytes() == header.encode() + data
    commented = header.replace("element", "comment of a library\nelement")
    (tmp_path / "two.ply").write_bytes(commented.encode() + data)
    np.testing.assert_array_equal(clouds.read_ply(tmp_path / "two.ply").points, cloud.points)


def test_the_sequences_are_the_published_ones(tmp_path):
    counts = [
        rags.counted_frames(cloth, repeat, "dynamic")
        for cloth in rags.CLOTHS
        for repeat in rags.REPEATS
    ]
    assert counts == [95, 95, 99, 99, 98, 99, 90, 89, 89]
    assert rags.counted_frames("linen", 1, "quasi_static") == 420
    place = rags.sequence_folder(tmp_path, "cotton", 1, "quasi_static")
    assert place.relative_to(tmp_path).as_posix() == (
        "Benchmarking_cloth/cotton_1/quasi_static/cloud"
    )
    for wrong in (("silk", 0, "dynamic"), ("linen", 3, "dynamic"), ("linen", 0, "fling")):
        with pytest.raises(InvalidArgumentError, match="valid choices"):
            rags.sequence_folder(tmp_path, *wrong)


RAG_DAMAGE = {
    "missing frame": (lambda path: path.unlink(), "missing frame"),
    "truncated": (lambda path: path.write_bytes(path.read_bytes()[:-5]), "bytes of points"),
    "cut in the header": (
        lambda path: path.write_bytes(path.read_bytes()[:40]),
        "not a number of points",
    ),
    "empty": (
        lambda path: path.write_bytes(
            path.read_bytes().split(b"end_header\n")[0].replace(b"vertex 21", b"vertex 0")
            + b"end_header\n"
        ),
        "empty cloud",
    ),
    "NaN": (
        lambda path: path.write_bytes(
            path.read_bytes()[: -21 * 27] + struct.pack("<d", np.nan) + path.read_bytes()[-559:]
        ),
        "point 0 is not finite",
    ),
    "one too many": (
        lambda path: path.with_name("00099.ply").write_bytes(path.read_bytes()),
        "too many",
    ),
}


@pytest.mark.parametrize("damage", RAG_DAMAGE)
def test_damage_of_rags_is_named(rag_folder, damage):
    folder, _ = rag_folder
    path = rags.sequence_folder(folder, "linen", 2, "dynamic") / "00001.ply"
    harm, words = RAG_DAMAGE[damage]
    harm(path)
    name = "00099" if damage == "one too many" else "00001"
    with pytest.raises(StoreError, match=rf"{name}\.ply: .*{words}"):
        rags.read_sequence(folder, "linen", 2, "dynamic", frames=FRAMES)
