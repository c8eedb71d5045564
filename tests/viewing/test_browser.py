"""The browser viewer: its meshes, its address, and what a Chromium shows and does."""

import socket

import mujoco
import numpy as np
import pytest

import softgym_mj
from softgym_mj.entities.sheet import BACK_COLOR, FRONT_COLOR
from softgym_mj.entities.views import FIELD_OF_VIEW
from softgym_mj.exceptions import InvalidArgumentError, UnavailableError
from softgym_mj.rendering.offscreen import refresh_poses
from softgym_mj.viewing import browser, scene
from tests.viewing import chromium
from tests.viewing.test_teleoperation import unhurried

WIDTH, HEIGHT = 900, 560  # [pixels] Size of the window.
LOAD_TIME = 150.0  # [s] Within which a busy machine without a GPU has shown the first picture.
NOTICES = ".mantine-Notifications-root"  # Such as that there is no GPU.
# Ranges of hue [deg] as seen: the cloth's two sides, water and rope.
CREAM, RASPBERRY, BLUE = (28, 50), (330, 355), (190, 230)

with_chromium = pytest.mark.skipif(
    chromium.path() is None, reason="no Chromium on PATH: apt-get install chromium"
)


# ---------------------------------------------------------------------- meshes


def test_the_sides_of_a_cloth_and_its_strip_have_two_colors():
    env = softgym_mj.load("fold_cloth", split="all")
    parts = scene.skin_parts(env.physics.model.ptr, 0)
    colors = np.array([rgba[:3] for rgba, _ in parts])
    for own in FRONT_COLOR, BACK_COLOR:
        assert np.abs(colors - own[:3]).max(axis=1).min() < 0.2
    assert len(parts) == 2
    sizes = [len(faces) for _, faces in parts]
    assert sum(sizes) == env.physics.model.ptr.skin_facenum[0]
    assert min(sizes) > 0.45 * sum(sizes)  # The strip changes places.


# ---------------------------------------------------------------------- address


def test_a_port_that_is_taken_is_an_error():
    with socket.socket() as taken:
        taken.bind(("127.0.0.1", 0))
        taken.listen()
        refuses(UnavailableError, r"127\.0\.0\.1:\d+: .*--port", port=taken.getsockname()[1])


def test_an_address_that_does_not_exist_is_an_error():
    refuses(InvalidArgumentError, "port=65536 .*65535", port=65536)
    refuses(UnavailableError, r"203\.0\.113\.7:.*--host", host="203.0.113.7", port=0)


def refuses(error, words, **address):
    with pytest.raises(error, match=words), browser.open_server(**address):
        pass


@pytest.mark.parametrize(
    ("task", "actor", "parts"),
    [("fold_cloth", "picker", 2), ("rope_configuration", "franka", 2), ("pour_water", "cup", 1)],
)
def test_tasks_are_shown_and_driven(monkeypatch, task, actor, parts):
    """Without a browser: an episode in which everything is rebuilt once."""
    monkeypatch.setattr(browser, "PICTURE_INTERVAL", 0.0)
    with browser.open_server(port=0) as server:
        session = unhurried(task, actor=actor, fidelity="fast")
        shown = browser.Browser(session, server)
        session.advance()
        shown._drag(parts - 1, session.teleoperation.targets[-1] + [0.05, 0, 0.02, 0], "end")
        shown._frame()
        gizmo = shown._gizmos[-1]
        np.testing.assert_allclose(gizmo.position, session.teleoperation.targets[-1, :3])
        before = shown._scene
        session.play_next()
        shown._frame()
        assert shown._scene is not before  # Sizes, marks or water differ.
        session.play("scripted")
        shown._frame()
        assert shown._gizmos == []


# ---------------------------------------------------------------------- pictures


@pytest.fixture(name="page", scope="module")
def _page(tmp_path_factory):
    page = chromium.Chromium(tmp_path_factory.mktemp("profile"), WIDTH, HEIGHT)
    yield page
    page.close()


def hues(image):
    """Hue (height, width) [deg] and saturation of an image."""
    red, green, blue = np.moveaxis(image[..., :3] / 255.0, -1, 0)
    largest = image[..., :3].max(axis=-1) / 255.0
    chroma = largest - image[..., :3].min(axis=-1) / 255.0
    safe = np.maximum(chroma, 1e-9)
    hue = np.where(
        largest == red,
        (green - blue) / safe % 6,
        np.where(largest == green, (blue - red) / safe + 2, (red - green) / safe + 4),
    )
    return 60.0 * hue, chroma / np.maximum(largest, 1e-9)


def mask(image, *ranges):
    """Returns which pixels left of the panel have a hue in one of the ranges."""
    hue, saturation = hues(image)
    chosen = np.zeros(hue.shape, bool)
    for low, high in ranges:
        chosen |= (hue > low) & (hue < high) & (saturation > 0.15)
    height, width = chosen.shape
    return chosen[height // 6 : -height // 6, : width - 340]


def expected(session, server, height, width):
    """MuJoCo's own picture from where browsers start."""
    camera, start = mujoco.MjvCamera(), server.initial_camera
    way = start.look_at - start.position
    camera.lookat, camera.distance = start.look_at, np.linalg.norm(way)
    camera.azimuth = np.rad2deg(np.arctan2(way[1], way[0]))
    camera.elevation = np.rad2deg(np.arcsin(way[2] / camera.distance))
    physics = session.env.physics
    refresh_poses(physics)
    model = physics.model.ptr
    assert model.vis.global_.fovy == FIELD_OF_VIEW
    option = mujoco.MjvOption()
    option.flexgroup[4] = 0
    with mujoco.Renderer(model, height, width) as renderer:
        renderer.update_scene(physics.data.ptr, camera, option)
        return renderer.render()


def pixel(server, point, height, width):
    """Returns where a point (3,) [m] is in the initial view: x, y [pixels]."""
    start = server.initial_camera
    forward = start.look_at - start.position
    forward /= np.linalg.norm(forward)
    right = np.cross(forward, [0.0, 0.0, 1.0])
    right /= np.linalg.norm(right)
    x, y, z = np.stack([right, np.cross(forward, right), forward]) @ (point - start.position)
    scale = height / 2 / np.tan(start.fov / 2)
    return np.array([width / 2 + scale * x / z, height / 2 + scale * y / z])


@with_chromium
@pytest.mark.parametrize(
    ("task", "ranges", "likeness"),
    [
        ("fold_cloth", (CREAM, RASPBERRY), 0.9),
        pytest.param("pour_water", (BLUE,), 0.75, marks=pytest.mark.slow),
    ],
)
@pytest.mark.long
def test_chromium_shows_what_mujoco_draws(page, task, ranges, likeness):
    session = unhurried(task)
    session.paused = True
    with browser.open_server(port=0) as server:
        browser.Browser(session, server)
        page.open(f"http://127.0.0.1:{server.get_port()}")
        chromium.wait_until(lambda: session.advance() or server.get_clients(), LOAD_TIME)
        page.hide(NOTICES)

        def alike():
            session.advance()
            image = page.screenshot()
            seen = mask(image, *ranges)
            wanted = mask(expected(session, server, *image.shape[:2]), *ranges)
            assert wanted.mean() > 0.005
            return (seen & wanted).sum() > likeness * (seen | wanted).sum()

        chromium.wait_until(alike, LOAD_TIME)
        for part in range(len(session.teleoperation.names)):
            session.teleoperation.shift(part, [-0.2, 0.0, 0.2, 0.0])
        session.paused = False
        for _ in range(8):
            session.advance()
        session.paused = True
        chromium.wait_until(alike, LOAD_TIME)


@pytest.mark.slow
@with_chromium
def test_chromium_drives(page):
    """A gizmo is dragged, a grip closed, the next variation chosen, time stopped."""
    session = unhurried("straighten_rope")
    session.paused = True
    with browser.open_server(port=0) as server:
        browser.Browser(session, server)
        page.open(f"http://127.0.0.1:{server.get_port()}")

        def until(condition):
            chromium.wait_until(lambda: session.advance() or condition(), LOAD_TIME)

        until(server.get_clients)
        until(lambda: mask(page.screenshot(), BLUE).mean() > 1e-3)
        start = session.teleoperation.targets
        height, width = page.screenshot().shape[:2]
        arrow = start[1, :3] + [0.8 * browser.GRIPPER_GIZMO, 0.0, 0.0]
        page.drag(*(pixel(server, arrow + [way, 0, 0], height, width) for way in (0.0, 0.15)))
        until(lambda: session.teleoperation.targets[1, 0] > start[1, 0] + 0.1)
        moved = session.teleoperation.targets - start
        np.testing.assert_allclose(moved[1], [0.15, 0.0, 0.0, 0.0], atol=0.02)
        assert not moved[0].any()
        assert page.click("picker 1 closed")
        until(lambda: session.teleoperation.grips == [True, False])
        assert page.click("go on")
        until(lambda: not session.paused)
        until(lambda: session.env.task.actor.positions()[1, 0] > start[1, 0] + 0.1)
        assert page.click("next variation")
        until(lambda: session.variation == 801)
        until(lambda: page.click("pause"))
        until(lambda: session.paused)
