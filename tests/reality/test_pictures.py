"""Pictures against what a pinhole camera shows of shapes whose image is known."""

import numpy as np
import pytest

from softgym_mj.exceptions import InvalidArgumentError
from softgym_mj.reality import pictures
from softgym_mj.reality.meshes import rectangle
from softgym_mj.reality.pictures import Painter, beside, camera_at

SIZE = (120, 160)
MESH = rectangle(0.4, 0.2, 0.05)
UPRIGHT = MESH.points[:, [0, 2, 1]]  # In the plane y = 0.


def painter(calibration, floor=None):
    return Painter.of(MESH.points, MESH.triangles, calibration, SIZE, floor)


def sheet_pixels(picture):
    return (picture != pictures.BACKGROUND).any(axis=2)


def test_a_camera_shows_a_point_where_it_is():
    calibration = camera_at(np.array([0.0, 2.0, 0.5]), np.array([0.0, 0.0, 0.5]), SIZE, 60.0)
    turn = calibration.extrinsics[:3, :3]
    np.testing.assert_allclose(turn @ turn.T, np.eye(3), atol=1e-12)
    assert np.linalg.det(turn) == pytest.approx(1.0)
    # Seen from +Y, -X is to the right; Z up. 60 deg show 2 tan 30 deg of a metre over 120 pixels.
    points = np.array([[0.0, 0.0, 0.5], [-0.1, 0.0, 0.5], [0.0, 0.0, 0.6]])
    places, depths = calibration.project(points)
    pixels = 0.1 / 2.0 * 60.0 / np.tan(np.radians(30.0))
    np.testing.assert_allclose(depths, 2.0)
    expected = [[79.5, 59.5], [79.5 + pixels, 59.5], [79.5, 59.5 - pixels]]
    np.testing.assert_allclose(places, expected, atol=1e-9)
    with pytest.raises(InvalidArgumentError, match="target"):
        camera_at(np.zeros(3), np.array([0.0, 0.0, -1.0]), SIZE, 60.0)


def test_a_sheet_covers_its_image():
    calibration = camera_at(np.array([0.0, 1.0, 0.0]), np.zeros(3), SIZE, 45.0)
    picture = painter(calibration).sheet(UPRIGHT)
    rows, columns = np.nonzero(sheet_pixels(picture))
    focal = 60.0 / np.tan(np.radians(22.5))
    assert np.ptp(columns) + 1 == pytest.approx(0.4 * focal, abs=4)
    assert np.ptp(rows) + 1 == pytest.approx(0.2 * focal, abs=4)
    assert sheet_pixels(picture)[rows.min() : rows.max(), columns.min() : columns.max()].all()


def test_both_sides_have_their_colours():
    for y, color in ((1.0, pictures.BACK), (-1.0, pictures.FRONT)):
        calibration = camera_at(np.array([0.0, y, 0.0]), np.zeros(3), SIZE, 45.0)
        middle = painter(calibration).sheet(UPRIGHT)[60, 80].astype(float)
        # It faces the camera: the light's share is 1.
        np.testing.assert_allclose(middle, color, rtol=0.02)


def test_what_is_nearer_hides_what_is_farther():
    calibration = camera_at(np.array([0.0, 1.0, 0.6]), np.array([0.0, 0.0, 0.1]), SIZE, 45.0)
    raised = UPRIGHT + [0.0, 0.0, 0.1]
    held = np.array([[0.1, 0.0, 0.1]])
    picture = painter(calibration, floor=0.0).sheet(raised, held)
    (column, row), _ = (x[0] for x in calibration.project(held))
    assert tuple(picture[round(row), round(column)]) == pictures.HAND
    behind = painter(calibration).sheet(raised, held - [0.0, 0.1, 0.0])
    (column, row), _ = (x[0] for x in calibration.project(held - [0.0, 0.1, 0.0]))
    assert tuple(behind[round(row), round(column)]) != pictures.HAND
    assert tuple(picture[-1, 80]) == pictures.GROUND


def test_clouds_have_their_own_colours():
    calibration = camera_at(np.array([0.0, 1.0, 0.0]), np.zeros(3), SIZE, 45.0)
    shown = painter(calibration).cloud(np.zeros((1, 3)), np.array([[9, 200, 7]], np.uint8))
    assert tuple(shown[60, 80]) == (9, 200, 7)
    plain = painter(calibration).cloud(np.zeros((1, 3)))
    assert tuple(plain[60, 80]) == pictures.CLOUD
    both = beside([shown, plain])
    assert both.shape == (120, 160 + 4 + 160, 3)
    np.testing.assert_array_equal(both[:, -160:], plain)
