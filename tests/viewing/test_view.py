"""The viewers: keys and mouse become targets, and what is shown is what is simulated."""

import contextlib
import pathlib
import sys
import types

import mujoco
import numpy as np
import pytest

from softgym_mj.exceptions import InvalidArgumentError, UnavailableError
from softgym_mj.viewing import camera, keys, window
from tests.command import error_of, output_of
from tests.viewing.test_teleoperation import unhurried

# ---------------------------------------------------------------------- keys, mouse, window


def pressing(task, right=(1.0, 0.0, 0.0), **settings):
    session = unhurried(task, **settings)
    keyboard = keys.Keyboard(session, lambda: np.array(right))

    def press(key, i=0):
        keyboard.press(key.codes[i])
        session.advance()

    return session, keyboard, press


def test_keys_are_free_in_the_viewer():
    taken = {ord(c) for entry in (*mujoco.mjVISSTRING, *mujoco.mjRNDSTRING) for c in entry[2]}
    taken |= {ord(c) for c in "012345[]"} | {256, 258, 266} | set(range(290, 297))
    for hand in (types.SimpleNamespace(turns=True, can_grip=True, names=("a", "b")), None):
        codes = [code for key in keys.keys_of(hand) for code in key.codes]
        assert len(codes) == len(set(codes)) and not taken & set(codes)


@pytest.mark.parametrize(
    ("right", "expected"),
    [
        ((1.0, 0.1, 0.0), [(-1, 0), (1, 0), (0, 1), (0, -1)]),
        ((-0.2, 0.9, 0.0), [(0, -1), (0, 1), (-1, 0), (1, 0)]),
        ((0.1, -1.0, 0.0), [(0, 1), (0, -1), (1, 0), (-1, 0)]),
    ],
)
def test_arrows_are_as_seen(right, expected):
    session, _, press = pressing("straighten_rope", right)
    for i, way in enumerate(expected):
        before = session.teleoperation.targets
        press(keys.MOVE, i)
        moved = session.teleoperation.targets - before
        np.testing.assert_allclose(moved[0], [*(0.05 * np.array(way)), 0.0, 0.0], atol=1e-12)
        assert not moved[1].any()


def test_keys_drive_either_or_both():
    session, keyboard, press = pressing("straighten_rope")
    press(keys.OTHER)
    press(keys.GRIP)
    assert keyboard.driven == [1] and session.teleoperation.grips == [False, True]
    press(keys.OTHER)
    press(keys.GRIP)
    assert keyboard.driven == [0, 1] and session.teleoperation.grips == [True, True]
    press(keys.STEP, 0)
    before = session.teleoperation.targets
    press(keys.LIFT, 0)
    np.testing.assert_allclose(session.teleoperation.targets - before, [[0, 0, 0.02, 0]] * 2)
    press(keys.GRIP)
    press(keys.OTHER)
    assert keyboard.driven == [0] and session.teleoperation.grips == [False, False]


def test_keys_start_and_stop():
    session, _, press = pressing("straighten_rope", variation=999)
    press(keys.PAUSE)
    assert session.paused
    press(keys.NEXT)
    assert session.variation == 0
    press(keys.EXPERT)
    assert session.policy == "scripted"
    press(keys.MOVE)  # Has no effect.
    press(keys.EXPERT)
    assert session.policy == "teleoperate"
    press(keys.MOVE)
    start = session.teleoperation.commanded()
    assert np.any(session.teleoperation.targets != start)
    press(keys.RESET)
    np.testing.assert_array_equal(session.teleoperation.targets, start)


def test_a_cup_is_tipped_by_keys():
    session, _, press = pressing("pour_water", fidelity="fast")
    press(keys.LIFT, 0)
    press(keys.TIP, 1)
    np.testing.assert_allclose(session.teleoperation.targets, [[0, 0, 0.05, np.deg2rad(5)]])


class FakeViewer:
    """MuJoCo's viewer without a window: presses keys and drags, then is closed."""

    def __init__(self, script):
        self.script, self.launched, self.texts, self.balls = list(script), [], [], []

    def __call__(self, model, data, key_callback, **settings):
        self.launched.append(model)
        self.model, self.data, self.press = model, data, key_callback
        self.cam, self.perturb = mujoco.MjvCamera(), mujoco.MjvPerturb()
        self.user_scn = mujoco.MjvScene(model, 100)
        return self

    def __enter__(self):
        return self

    def __exit__(self, *exception):
        pass

    def is_running(self):
        return bool(self.script)

    def lock(self):
        return contextlib.nullcontext()

    def sync(self):
        self.balls.append([self.user_scn.geoms[i].pos.copy() for i in range(self.user_scn.ngeom)])
        if self.script:
            self.script.pop(0)(self)

    def set_texts(self, texts):
        self.texts.append(texts)


def test_the_window_shows_the_state_and_takes_keys(monkeypatch):
    monkeypatch.setattr(window, "TEXT_INTERVAL", 0.0)
    session = unhurried("straighten_rope")
    start = session.teleoperation.targets
    seen = []
    viewer = FakeViewer(
        [
            lambda v: [v.press(code) for code in (keys.MOVE.codes[1], keys.GRIP.codes[0])],
            *[lambda v: seen.append(v.data.xpos[v.model.body("picker/picker_0").id].copy())] * 30,
        ]
    )
    window.Window(session, viewer).run()
    # To the right in the picture, along the nearer axis.
    _, axes = camera.pose(session.env, "task")
    right, back = axes[:, 0], axes[:, 2]
    along = np.abs(right).argmax()
    expected = 0.05 * np.eye(3)[along] * np.sign(right[along])
    np.testing.assert_allclose(seen[-1] - start[0, :3], expected, atol=1e-9)
    np.testing.assert_allclose(viewer.balls[-1], session.teleoperation.targets[:, :3])
    assert viewer.cam.azimuth == pytest.approx(np.rad2deg(np.arctan2(-back[1], -back[0])))
    assert viewer.cam.elevation == pytest.approx(-np.rad2deg(np.arcsin(back[2])))
    place, _ = camera.pose(session.env, "task")
    toward = np.array(viewer.cam.lookat) - place
    np.testing.assert_allclose(toward / np.linalg.norm(toward), -back, atol=1e-9)
    (*_, names, values), (*_, labels, uses) = viewer.texts[-1]
    assert "normalized performance" in names and "picker 1 closed" in values
    assert labels.count("\n") == uses.count("\n") == len(keys.keys_of(session.teleoperation)) - 1


def test_the_window_leaves_the_episode_alone():
    """Whatever the viewer does to the state it was given."""
    session, other = unhurried("straighten_rope"), unhurried("straighten_rope")

    def meddle(viewer):
        viewer.data.xfrc_applied[:] = 100.0
        viewer.data.qpos[:] = 0.0

    viewer = FakeViewer([meddle] * 8)
    window.Window(session, viewer).run()
    for _ in range(2):
        other.advance()
    np.testing.assert_array_equal(session.env.get_state().physics, other.env.get_state().physics)


def test_another_model_opens_another_window():
    session = unhurried("spread_cloth", fidelity="fast")
    viewer = FakeViewer([lambda v: v.press(keys.NEXT.codes[0])] + [lambda v: None] * 9)
    window.Window(session, viewer).run()
    assert len(viewer.launched) == 2 and session.variation == 801
    assert viewer.launched[0].nv != viewer.launched[1].nv


def test_a_dragged_picker_follows_the_mouse():
    session = unhurried("straighten_rope")
    targets = session.teleoperation.targets
    place = np.array([0.3, 0.2, 0.1])  # Point that the mouse holds: only its displacement counts.

    def grab(viewer):
        viewer.perturb.select = viewer.model.body("picker/picker_1").id
        viewer.perturb.active = mujoco.mjtPertBit.mjPERT_TRANSLATE
        viewer.perturb.refpos[:], viewer.perturb.refquat[:] = place, [1, 0, 0, 0]

    def drag(viewer):
        viewer.perturb.refpos[:] = place + [0.04, -0.03, 0.02]

    viewer = FakeViewer([grab, drag] + [lambda v: None] * 10)
    shown = window.Window(session, viewer)
    shown.run()
    moved = session.teleoperation.targets - targets
    np.testing.assert_allclose(moved, [[0, 0, 0, 0], [0.04, -0.03, 0.02, 0]], atol=1e-12)
    np.testing.assert_allclose(session.env.task.actor.positions()[1], targets[1, :3] + moved[1, :3])


def test_a_dragged_cup_turns_about_y_only():
    session = unhurried("pour_water", fidelity="fast")
    keyboard = keys.Keyboard(session, lambda: np.array([1.0, 0.0, 0.0]))
    mouse, perturb = keys.Mouse(keyboard), mujoco.MjvPerturb()
    model = session.env.physics.model.ptr
    perturb.select = model.body("cup/cup").id
    perturb.active = mujoco.mjtPertBit.mjPERT_ROTATE
    for angle in (0.1, 0.35):
        perturb.refquat[:] = [np.cos(angle / 2), 0.0, np.sin(angle / 2), 0.0]
        mouse.follow(perturb, model, session.teleoperation)
    np.testing.assert_allclose(session.teleoperation.targets, [[0, 0, 0, 0.25]], atol=1e-9)


def test_a_viewer_that_cannot_start_points_to_the_browser():
    def launch(*arguments, **settings):
        raise RuntimeError("`launch_passive` requires that the Python script be run under mjpython")

    with pytest.raises(UnavailableError, match=r"mjpython.*--browser"):
        window.Window(unhurried("straighten_rope"), launch).run()


# ---------------------------------------------------------------------- the command


def test_without_a_display_the_command_points_to_the_browser(monkeypatch, recwarn):
    monkeypatch.delenv("DISPLAY", raising=False)
    monkeypatch.delenv("WAYLAND_DISPLAY", raising=False)
    error = error_of("view", "pour_water")
    assert isinstance(error, UnavailableError)
    assert "softgym-mj view pour_water --browser" in str(error)
    assert "softgym-mj rollout pour_water --video videos" in str(error)
    assert not [warning for warning in recwarn if "GLFW" in type(warning.message).__name__]


def test_the_command_tells_of_the_keys_and_opens_the_window(monkeypatch):
    played = []
    monkeypatch.setattr(window, "check_display", lambda task: None)
    monkeypatch.setattr(window.Window, "run", lambda self: played.append(self._session))
    command = "view straighten_rope --actor franka --variation 803"
    result = output_of(*command.split())
    (session,) = played
    assert session.teleoperation.names == ("arm 1", "arm 2") and session.variation == 803
    for key in keys.keys_of(session.teleoperation):
        assert key.label in result and key.use in result


def test_a_variation_that_does_not_exist_is_an_error():
    assert isinstance(error_of("view", "pour_water", "--variation", 1000), InvalidArgumentError)


def test_a_missing_extra_is_named(monkeypatch):
    monkeypatch.setitem(sys.modules, "viser", None)
    error = error_of("view", "pour_water", "--browser")
    assert isinstance(error, UnavailableError) and isinstance(error, ImportError)
    assert "pip install '.[viewer]'" in str(error)


def test_the_page_lists_every_key():
    page = (pathlib.Path(__file__).parents[2] / "docs" / "viewer.md").read_text()
    labels = [
        line.split("|")[1].replace("`", "").strip() for line in page.splitlines() if "|" in line
    ]
    hand = types.SimpleNamespace(turns=True, can_grip=True, names=("a", "b"))
    assert labels[2:] == [key.label for key in keys.keys_of(hand) if key.codes]
