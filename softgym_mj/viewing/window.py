"""`Window`: MuJoCo's own viewer of a `Session`; needs a display."""

import threading
import time
import warnings
from collections.abc import Callable
from typing import Any

import mujoco
import mujoco.viewer
import numpy as np

from softgym_mj.envs.environment import Environment
from softgym_mj.exceptions import UnavailableError
from softgym_mj.rendering.offscreen import refresh
from softgym_mj.rendering.opengl import load_triton_first
from softgym_mj.robots.picker import Picker
from softgym_mj.viewing.camera import orbit, pose
from softgym_mj.viewing.keys import Keyboard, Mouse, keys_of
from softgym_mj.viewing.session import Session

TEXT_INTERVAL = 0.2  # [s] Between changes of the text: each waits for the window to be drawn.
CLOSE_TIME = 5.0  # [s] Timeout for closing a window.
# [m] Radius of the balls at targets, or factor on a picker's radius, whose shell they are.
TARGET_RADIUS, SHELL = 0.012, 1.15
# Colors of targets that the keys control, and of others.
DRIVEN_COLOR, OTHER_COLOR = (0.1, 0.9, 0.3, 0.4), (0.9, 0.9, 0.2, 0.2)


def place_camera(camera: Any, env: Environment) -> None:
    """Sets a free `mujoco.MjvCamera` to the view of the camera "task" of the arena."""
    _, axes = pose(env, "task")
    forward, up = -axes[:, 2], axes[:, 1]
    camera.type = mujoco.mjtCamera.mjCAMERA_FREE
    camera.lookat[:], distance = orbit(env, "task")
    # A free camera uses the field of view of the model.
    model = env.physics.model.ptr
    angles = np.deg2rad([model.camera("task").fovy[0], model.vis.global_.fovy]) / 2
    camera.distance = distance * np.tan(angles[0]) / np.tan(angles[1])
    # For a view straight down, the picture's upward direction defines the azimuth.
    ahead = forward if np.hypot(*forward[:2]) > 1e-3 else up
    camera.azimuth = np.rad2deg(np.arctan2(ahead[1], ahead[0]))
    camera.elevation = np.rad2deg(np.arcsin(np.clip(forward[2], -1.0, 1.0)))


def check_display(task: str) -> None:
    """Opens the display.

    Raises:
        UnavailableError: if that fails; the message has what works for `task` without a display.
    """
    import glfw

    with warnings.catch_warnings():
        warnings.simplefilter("ignore", glfw.GLFWError)  # The error below has the remedy.
        is_open = glfw.init()
    if not is_open:
        raise UnavailableError(
            "the viewer needs a display on which this user may draw; use a browser: "
            f"softgym-mj view {task} --browser, "
            f"or make a video: softgym-mj rollout {task} --video videos"
        )
    glfw.terminate()


class Window:
    """Shows a session in MuJoCo's viewer until its window is closed.

    The viewer gets a copy of the state: its interactions, such as pulling at bodies, do not affect
    the episode.
    """

    def __init__(self, session: Session, launch: Callable[..., Any] = mujoco.viewer.launch_passive):
        """Binds the window to a session; `launch` opens it, as `mujoco.viewer.launch_passive`."""
        self._session, self._launch = session, launch
        self._keyboard = Keyboard(session, self._right)
        self._mouse = Mouse(self._keyboard)
        self._texts: Any = None
        self._text_due = 0.0

    def run(self) -> None:
        """Runs until the window is closed; a model of another size opens another window.

        Raises:
            UnavailableError: on macOS, unless Python was started as mjpython.
        """
        while self._show():
            pass

    def _show(self) -> bool:
        """Shows one model; returns whether there is another one to show."""
        session = self._session
        physics = session.env.physics
        self._model = model = physics.model.ptr
        self._data = mujoco.MjData(model)
        self._copy_state()
        others = set(threading.enumerate())
        load_triton_first()
        try:
            window = self._launch(
                model,
                self._data,
                key_callback=self._keyboard.press,
                show_left_ui=False,
                show_right_ui=False,
            )
        except RuntimeError as error:
            raise UnavailableError(f"{error}; or use --browser") from error
        with window:
            self._window, self._texts = window, None
            with window.lock():
                place_camera(window.cam, session.env)
            session.on_frame = self._frame
            while window.is_running() and session.env.physics.model.ptr is model:
                session.advance()
            still_open = window.is_running()
        # The viewer's thread destroys the window after reporting that it is closed. Leaving Python
        # or opening another window before that is an error of the display.
        for thread in set(threading.enumerate()) - others:
            thread.join(CLOSE_TIME)
        return still_open

    def _copy_state(self) -> None:
        mujoco.mj_copyData(self._data, self._model, self._session.env.physics.data.ptr)
        refresh(self._model, self._data)

    def _right(self) -> np.ndarray:
        """Returns the direction (3,) to the right of the picture."""
        camera = self._window.cam
        if camera.type == mujoco.mjtCamera.mjCAMERA_FIXED:
            return self._data.cam_xmat[camera.fixedcamid].reshape(3, 3)[:, 0]
        azimuth = np.deg2rad(camera.azimuth)
        return np.array([np.sin(azimuth), -np.cos(azimuth), 0.0])

    def _frame(self) -> None:
        session, window = self._session, self._window
        teleoperation = session.teleoperation
        with window.lock():
            self._copy_state()
            if teleoperation is not None:
                self._mouse.follow(window.perturb, self._model, teleoperation)
            self._draw_targets(window.user_scn)
        if time.monotonic() >= self._text_due:
            self._text_due = time.monotonic() + TEXT_INTERVAL
            self._write()
        window.sync()

    def _draw_targets(self, scene: Any) -> None:
        teleoperation = self._session.teleoperation
        targets = np.zeros((0, 4)) if teleoperation is None else teleoperation.targets
        actor = self._session.env.task.actor
        radius = SHELL * actor.radius if isinstance(actor, Picker) else TARGET_RADIUS
        scene.ngeom = len(targets)
        for i, target in enumerate(targets):
            rgba = np.array(DRIVEN_COLOR if i in self._keyboard.driven else OTHER_COLOR, np.float32)
            sphere, size = mujoco.mjtGeom.mjGEOM_SPHERE, np.full(3, radius)
            mujoco.mjv_initGeom(scene.geoms[i], sphere, size, target[:3], np.eye(3).ravel(), rgba)

    def _write(self) -> None:
        """Shows the status and the keys, if they have changed."""
        session = self._session
        rows = session.status()
        teleoperation = session.teleoperation
        if teleoperation is not None:
            driven = " and ".join(teleoperation.names[part] for part in self._keyboard.driven)
            rows.append(("keys drive", f"{driven}, {100 * self._keyboard.step:.0f} cm a press"))
            if teleoperation.can_grip:
                grips = zip(teleoperation.names, teleoperation.grips, strict=True)
                states = (f"{name} {'closed' if closed else 'open'}" for name, closed in grips)
                rows.append(("grips", ", ".join(states)))
        texts = [(None, mujoco.mjtGridPos.mjGRID_TOPRIGHT, *_columns(rows))]
        if self._keyboard.helping:
            keys = _columns((key.label, key.use) for key in keys_of(teleoperation))
            texts.append((None, mujoco.mjtGridPos.mjGRID_BOTTOMLEFT, *keys))
        if texts != self._texts:
            self._texts = texts
            self._window.set_texts(texts)


def _columns(rows) -> tuple[str, str]:
    """Returns two columns of text."""
    left, right = zip(*rows, strict=True)
    return "\n".join(left), "\n".join(right)
