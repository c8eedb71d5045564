"""Calibration of cameras against what lies where in their images."""

import mujoco
import numpy as np
import pytest

import softgym_mj
from softgym_mj.entities import Arena
from softgym_mj.rendering.observables import EXTERNAL
from softgym_mj.rendering.offscreen import CameraView
from tests.kinds import by_kind

SIZE = (160, 200)
CAMERAS = ("task", "overview", *EXTERNAL)
RADIUS = 0.03  # [m] Radius of balls.
BALLS = np.array([[0.0, 0.0, 0.1], [0.25, 0.1, 0.05], [-0.2, 0.15, 0.3], [-0.15, -0.25, 0.05]])


def seen(physics, name, geom):
    """A calibration, the depth image, and which pixels show a geom."""
    view = CameraView(name, *SIZE)
    shown, depth = view.surfaces(physics)
    kind, index = shown[..., 1], shown[..., 0]
    mask = (kind == int(mujoco.mjtObj.mjOBJ_GEOM)) & (index == physics.model.ptr.geom(geom).id)
    return view.calibration(physics), depth, mask


@pytest.fixture(name="scene", scope="module")
def _scene():
    """Balls and a box on the table, without an object."""
    arena = Arena("cloth")
    for i, place in enumerate(BALLS):
        arena.add_solid("sphere", name=f"ball_{i}", size=(RADIUS,), pos=place)
    arena.add_solid("box", name="box", size=(0.1, 0.06, 0.04), pos=(0.1, -0.2, 0.04))
    return arena.compile(0.01)


@pytest.mark.parametrize("camera", CAMERAS)
def test_balls_are_seen_where_they_are(scene, camera):
    for i, place in enumerate(BALLS):
        calibration, depth, mask = seen(scene, camera, f"ball_{i}")
        ((middle,), (distance,)) = calibration.project(place[None])
        rows, columns = np.nonzero(mask)
        assert len(rows) > 20
        outline = [(side.min() + side.max()) / 2 for side in (columns, rows)]
        np.testing.assert_allclose(outline, middle, atol=0.75)
        ray = np.linalg.norm(np.append((middle - calibration.intrinsics[:2, 2]), 1e-9))
        ray = np.hypot(1.0, ray / calibration.intrinsics[0, 0]) * distance  # To the ball's middle.
        column, row = middle.round().astype(int)
        assert depth[row, column] == pytest.approx(distance * (1 - RADIUS / ray), abs=2e-3)


@pytest.mark.parametrize("camera", CAMERAS)
def test_depths_lie_on_the_faces_of_a_box(scene, camera):
    calibration, depth, mask = seen(scene, camera, "box")
    rows, columns = np.nonzero(mask)
    points = calibration.unproject(np.column_stack([columns, rows]), depth[rows, columns])
    geom = scene.model.ptr.geom("box")
    outside = (np.abs(points - geom.pos) - geom.size).max(axis=1)
    assert len(points) > 200
    assert np.abs(outside).max() < 1e-4


@pytest.mark.parametrize("camera", CAMERAS)
def test_unproject_inverts_project(scene, camera):
    calibration = CameraView(camera, *SIZE).calibration(scene)
    pixels, depths = calibration.project(BALLS)
    np.testing.assert_allclose(calibration.unproject(pixels, depths), BALLS, atol=1e-12)
    turn = calibration.extrinsics[:3, :3]
    np.testing.assert_allclose(turn @ turn.T, np.eye(3), atol=1e-12)
    assert np.linalg.det(turn) == pytest.approx(1.0)


def test_cameras_face_each_other_across_the_scene(scene):
    left, right = (CameraView(name, *SIZE).calibration(scene) for name in EXTERNAL)
    places = [-c.extrinsics[:3, :3].T @ c.extrinsics[:3, 3] for c in (left, right)]
    task = CameraView("task", *SIZE).calibration(scene)
    columns = task.project(np.array(places) * [1.0, 1.0, 0.0])[0][:, 0]
    assert columns[0] < SIZE[1] / 2 - 50 and columns[1] > SIZE[1] / 2 + 50
    np.testing.assert_allclose(places[0][:2], -places[1][:2], atol=1e-9)


@pytest.mark.parametrize("task", by_kind())
def test_external_cameras_see_all_of_the_object(task):
    own = {} if "rope" in task else {"fidelity": "fast"}
    env = softgym_mj.load(task, split="all", observation="external_depth", **own)
    images = env.reset(805).observation["external_depth"]
    for depth, calibration in zip(images, env.cameras().values(), strict=True):
        pixels, depths = calibration.project(env.task.points())
        columns, rows = pixels.round().astype(int).T
        assert min(columns.min(), rows.min()) >= 0 and max(columns.max(), rows.max()) < len(depth)
        if task in ("fold_cloth", "straighten_rope"):  # Which hides little of itself.
            assert np.median(np.abs(depths - depth[rows, columns])) < 0.01
