"""Data sets of the three layouts: read as they were written, bit by bit, and damage by its file."""

import hashlib
import json
import struct

import numpy as np
import pytest

from softgym_mj.exceptions import InvalidArgumentError, StoreError
from softgym_mj.reality import clouds, garments, markers, rags

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


def capture_of(rng, garment="green_tshirt", action="fold"):
    angle = 0.3
    camera = np.eye(4)
    camera[:2, :2] = [[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]]
    camera[:3, 3] = rng.normal(size=3)
    names = (*(f"joint{i}" for i in range(1, 7)), "gripper")
    times = 1.763e9 + np.arange(5) / 200
    arms = {
        arm: garments.JointStates(names, times + shift, rng.normal(size=(5, 7)))
        for arm, shift in (("left", 0.001), ("right", 0.0))
    }
    seen = [rng.normal(size=(9 + i, 3)).astype(np.float32) for i in range(3)]
    return garments.Capture(garment, action, camera, arms, times[0] + np.arange(3) / 30, seen)


@pytest.fixture(name="capture_folder")
def _capture_folder(tmp_path):
    folder = tmp_path / "green_tshirt" / "green_tshirt_fold_2025-11-18-17-55-38"
    capture = capture_of(np.random.default_rng(1))
    garments.write_capture(folder, capture)
    return folder, capture


@pytest.fixture(name="marker_file")
def _marker_file(tmp_path):
    rng = np.random.default_rng(2)
    times = np.arange(6) / markers.FRAME_RATE
    recording = markers.Markers(np.arange(6), times, rng.normal(size=(6, 12, 3)))
    markers.write_markers(tmp_path / "shake.csv", recording)
    return tmp_path / "shake.csv", recording


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


def test_an_archive_is_known_by_its_hash(tmp_path):
    path = tmp_path / "data.zip"
    path.write_bytes(b"abc" * 1_000_000)
    rags.check_archive(path, hashlib.sha256(b"abc" * 1_000_000).hexdigest())
    with pytest.raises(StoreError, match=r"data\.zip: SHA-256 .* published is 268d07d9"):
        rags.check_archive(path)
    with pytest.raises(StoreError, match=r"other\.zip: missing"):
        rags.check_archive(tmp_path / "other.zip")


def test_captures_come_back_bit_by_bit(capture_folder):
    folder, written = capture_folder
    read = garments.read_capture(folder)
    assert (read.garment, read.action) == ("green_tshirt", "fold")
    assert read.camera.tobytes() == written.camera.tobytes()
    assert read.times.tobytes() == written.times.tobytes()
    for before, after in zip(written.clouds, read.clouds, strict=True):
        assert after.dtype == before.dtype
        assert after.tobytes() == before.tobytes()
    for arm in garments.ARMS:
        assert read.arms[arm].names == written.arms[arm].names
        assert read.arms[arm].times.tobytes() == written.arms[arm].times.tobytes()
        assert read.arms[arm].positions.tobytes() == written.arms[arm].positions.tobytes()


def test_clouds_go_back_to_the_world_and_times_to_the_simulation(capture_folder):
    folder, written = capture_folder
    capture = garments.read_capture(folder)
    turn, place = written.camera[:3, :3], written.camera[:3, 3]
    for world, cloud in zip(capture.world_clouds(), capture.clouds, strict=True):
        np.testing.assert_allclose(world @ turn.T + place, cloud, atol=1e-6)
    # The right arm's first stamp is the first cloud's time.
    np.testing.assert_allclose(capture.simulated_times(0.05), np.arange(3) / 30 + 0.05, atol=1e-6)


@pytest.mark.parametrize("kind", [np.float32, np.float64])
def test_pcds_of_text_and_with_other_fields_are_read(tmp_path, kind):
    points = np.random.default_rng(3).normal(size=(5, 3)).astype(kind)
    clouds.write_pcd(tmp_path / "binary.pcd", points)
    assert clouds.read_pcd(tmp_path / "binary.pcd").points.tobytes() == points.tobytes()
    lines = "\n".join(f"7 {x!r} {y!r} {z!r}" for x, y, z in points.astype(float).tolist())
    (tmp_path / "text.pcd").write_text(
        "# .PCD v0.7\nVERSION 0.7\nFIELDS rgb x y z\nSIZE 4 4 4 4\nTYPE U F F F\nCOUNT 1 1 1 1\n"
        f"WIDTH 5\nHEIGHT 1\nVIEWPOINT 0 0 0 1 0 0 0\nPOINTS 5\nDATA ascii\n{lines}\n"
    )
    np.testing.assert_array_equal(clouds.read_pcd(tmp_path / "text.pcd").points, points)


def test_markers_come_back_bit_by_bit(marker_file):
    path, written = marker_file
    assert path.read_text().startswith("Frame,Time,X1,Y1,Z1,X2,")
    read = markers.read_markers(path)
    assert read.frames.tolist() == written.frames.tolist()
    assert read.times.tobytes() == written.times.tobytes()
    assert read.positions.tobytes() == written.positions.tobytes()


def replaced(path, old, new):
    text = path.read_text()
    assert old in text
    path.write_text(text.replace(old, new, 1))


RAG_DAMAGE = {
    "missing frame": (lambda path: path.unlink(), "missing frame"),
    "truncated": (lambda path: path.write_bytes(path.read_bytes()[:-5]), "bytes of points"),
    "cut in the header": (
        lambda path: path.write_bytes(path.read_bytes()[:40]),
        "no number of points",
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


def first_cloud(folder):
    """The first by its name: ten points."""
    return min((folder / "segment_pcds").iterdir())


def emptied(folder):
    path = first_cloud(folder)
    header = path.read_bytes().split(b"DATA binary\n")[0]
    path.write_bytes(header.replace(b"POINTS 10", b"POINTS 0") + b"DATA binary\n")


def unsorted(folder):
    path = folder / "joints" / "left_arm_joint_states_and_end_pose.csv"
    lines = path.read_text().splitlines()
    path.write_text("\n".join([lines[0], lines[2], lines[1], *lines[3:]]))


LEFT = "joints/left_arm_joint_states_and_end_pose.csv"
CAPTURE_DAMAGE = {
    "shape": (
        lambda folder: (folder / garments.TRANSFORM).write_text(json.dumps([[1, 0], [0, 1]])),
        r"world_to_camera_transform\.json: .*shape \(2, 2\)",
    ),
    "no rotation": (
        lambda folder: (folder / garments.TRANSFORM).write_text(
            json.dumps(np.diag([2, 1, 1, 1]).tolist())
        ),
        r"world_to_camera_transform\.json: no rigid transform",
    ),
    "no transform": (
        lambda folder: (folder / garments.TRANSFORM).unlink(),
        r"world_to_camera_transform\.json: missing",
    ),
    "unsorted": (unsorted, r"left_arm.*\.csv: unsorted stamps at row 1"),
    "other columns": (
        lambda folder: replaced(folder / LEFT, "position", "effort"),
        r"left_arm.*\.csv: lacks the columns position",
    ),
    "other order of joints": (
        lambda folder: replaced(folder / LEFT, "'joint1', 'joint2'", "'joint2', 'joint1'"),
        r"left_arm.*\.csv: line 3 has other joints",
    ),
    "NaN": (
        lambda folder: (first_cloud(folder)).write_bytes(
            first_cloud(folder).read_bytes()[:-4] + struct.pack("<f", np.nan)
        ),
        r"pointcloud_.*\.pcd: point 9 is not finite",
    ),
    "truncated": (
        lambda folder: first_cloud(folder).write_bytes(first_cloud(folder).read_bytes()[:-4]),
        r"pointcloud_.*\.pcd: has 116 bytes of points instead of 120",
    ),
    "compressed": (
        lambda folder: first_cloud(folder).write_bytes(
            first_cloud(folder).read_bytes().replace(b"DATA binary", b"DATA binary_compressed")
        ),
        r"pointcloud_.*\.pcd: DATA binary_compressed",
    ),
    "empty": (emptied, r"pointcloud_.*\.pcd: an empty cloud"),
    "other name": (
        lambda folder: first_cloud(folder).rename(folder / "segment_pcds" / "cloud.pcd"),
        r"cloud\.pcd: expected pointcloud_",
    ),
}


@pytest.mark.parametrize("damage", CAPTURE_DAMAGE)
def test_damage_of_captures_is_named(capture_folder, damage):
    folder, _ = capture_folder
    harm, words = CAPTURE_DAMAGE[damage]
    harm(folder)
    with pytest.raises(StoreError, match=words):
        garments.read_capture(folder)


def test_an_unknown_garment_is_named(capture_folder):
    folder, capture = capture_folder
    other = folder.rename(folder.with_name("purple_poncho_fold_2025"))
    with pytest.raises(StoreError, match=r"purple_poncho_fold_2025: unknown garment.*green_tshirt"):
        garments.read_capture(other)
    with pytest.raises(InvalidArgumentError, match="green_tshirt_fold_<stamp>"):
        garments.write_capture(other, capture)


MARKER_DAMAGE = {
    "other order": (("X1,Y1,Z1", "Y1,X1,Z1"), "columns"),
    "NaN": (("\r\n1,", "\r\n1,nan,"), "line 3 has 39 columns"),
    "unsorted": (("\r\n2,", "\r\n0,"), "unsorted stamps at row 2"),
    "no number": (("\r\n2,", "\r\ntwo,"), "two"),
}


@pytest.mark.parametrize("damage", MARKER_DAMAGE)
def test_damage_of_markers_is_named(marker_file, damage):
    path, _ = marker_file
    change, words = MARKER_DAMAGE[damage]
    path.write_bytes(path.read_bytes().replace(*(part.encode() for part in change), 1))
    with pytest.raises(StoreError, match=rf"shake\.csv: .*{words}"):
        markers.read_markers(path)


def test_markers_that_are_lost_are_named(marker_file):
    path, written = marker_file
    written.positions[3, 2, 1] = np.nan
    markers.write_markers(path, written)
    with pytest.raises(StoreError, match=r"shake\.csv: row 3, column 9 .* not finite"):
        markers.read_markers(path)
