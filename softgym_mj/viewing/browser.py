"""`Browser`: a session in web browsers, by viser, for machines without a display."""

import contextlib
import socket
import time
from collections.abc import Callable, Iterator, Sequence
from typing import Any

import numpy as np

from softgym_mj.exceptions import UnavailableError, check_count, import_extra
from softgym_mj.variations.indices import NUM_VARIATIONS
from softgym_mj.viewing.camera import orbit, pose
from softgym_mj.viewing.origins import check_origins, guarded
from softgym_mj.viewing.scene import EXTRA, Scene
from softgym_mj.viewing.session import TELEOPERATE, Session

PICTURE_INTERVAL = 0.04  # [s] Between pictures: smooth enough for slow connections.
TEXT_INTERVAL = 0.25  # [s] Between changes of the text.
GRIPPER_GIZMO, CUP_GIZMO = 0.15, 0.25  # [m] Size of the draggable gizmos.
BACK = 0.3  # [m] Distance behind the overview camera, because the panel hides a part of the view.
YOU = "you"  # Name of the teleoperating user in the panel.


@contextlib.contextmanager
def open_server(
    host: str = "127.0.0.1", port: int = 8080, allow_origin: Sequence[str] = ()
) -> Iterator[Any]:
    """Context of a `viser.ViserServer`, which is stopped at its end.

    Args:
        host: address to listen at; "0.0.0.0" for all of this machine's.
        port: 1..65535, or 0 for any free one.
        allow_origin: further origin of its page, such as a proxy's "https://hub.example.com": see
            `viewing.origins`.

    Raises:
        UnavailableError: if it cannot listen there; if viser is missing.
        InvalidArgumentError: for a port that does not exist, or an invalid origin.
    """
    viser = import_extra("viser", "viser", EXTRA)
    check_count("port", port, 0, 65535)
    allowed = check_origins(allow_origin)
    # viser would silently take the next free port, which a tunnel would miss.
    with socket.socket() as probe:
        probe.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        try:
            probe.bind((host, port))
        except OSError as error:
            raise UnavailableError(
                f"cannot listen at {host}:{port}: {error.strerror}; "
                "choose another --port, 0 for any free one, or --host"
            ) from error
        port = probe.getsockname()[1]
    with guarded(host, allowed):
        server = viser.ViserServer(host=host, port=port, label="softgym_mj", verbose=False)
    try:
        yield server
    finally:
        server.stop()


class Browser:
    """Shows a session to all browsers connected to a server; any of them may control it.

    A gizmo at every gripper or cup is dragged to its target. Event handlers are coroutines, because
    viser runs these in order, but functions in a thread pool.
    """

    def __init__(self, session: Session, server: Any):
        """Builds scene and panel of a session in a `viser.ViserServer`."""
        self._session, self._server = session, server
        self._picture_due = self._text_due = 0.0
        self._shown: tuple[str, int, bool] | None = None
        server.gui.configure_theme(show_logo=False, show_share_button=False)
        self._add_panel()
        self._grips: list[Any] = []
        self._rebuild()
        self._place_camera()
        session.on_frame = self._frame

    def run(self) -> None:
        """Runs until it is interrupted."""
        with contextlib.suppress(KeyboardInterrupt):
            while True:
                self._session.advance()

    # ------------------------------------------------------------------ scene

    def _rebuild(self) -> None:
        """Shows another model, or other controllable parts."""
        self._scene = Scene(self._server, self._session.env.physics)
        self._driven_by = teleoperation = self._session.teleoperation
        names = () if teleoperation is None else teleoperation.names
        self._gizmos = [self._add_gizmo(part) for part in range(len(names))]
        self._dragged: set[int] = set()
        self._shown_grips: list[bool] = []
        for box in self._grips:
            box.remove()
        can_grip = teleoperation is not None and teleoperation.can_grip
        self._grip_folder.visible = can_grip
        self._grips = [self._add_grip(*part) for part in enumerate(names)] if can_grip else []

    def _place_camera(self) -> None:
        """Sets the initial view of browsers to that of the overview camera."""
        env = self._session.env
        position, axes = pose(env, "overview")
        camera = self._server.initial_camera
        camera.position = position + BACK * axes[:, 2]
        camera.look_at, _ = orbit(env, "overview")
        camera.fov = np.deg2rad(env.physics.model.ptr.camera("overview").fovy[0])

    def _add_gizmo(self, part: int) -> Any:
        teleoperation = self._driven_by
        assert teleoperation is not None
        gizmo = self._server.scene.add_transform_controls(
            f"/targets/{part}",
            scale=GRIPPER_GIZMO if teleoperation.can_grip else CUP_GIZMO,
            active_axes=teleoperation.axes,
            disable_rotations=not teleoperation.turns,
            depth_test=False,
        )

        @gizmo.on_update
        async def _(event: Any) -> None:
            x, y, z = event.target.position
            w, _, turn, _ = event.target.wxyz
            target = np.array([x, y, z, 2.0 * np.arctan2(turn, w)])
            phase = event.phase
            self._session.post(lambda: self._drag(part, target, phase))

        return gizmo

    def _drag(self, part: int, target: np.ndarray, phase: str) -> None:
        if self._session.teleoperation is None or not np.isfinite(target).all():
            return
        self._session.teleoperation.aim(part, target)
        if phase == "end":
            self._dragged.discard(part)
        else:
            self._dragged.add(part)

    # ------------------------------------------------------------------ panel

    def _add_panel(self) -> None:
        session, gui = self._session, self._server.gui
        self._text = gui.add_markdown("")
        others = dict.fromkeys(("scripted", session.policy))
        players = [YOU, *(name for name in others if name != TELEOPERATE)]
        self._player = gui.add_dropdown("played by", players, initial_value=YOU)
        self._pause = gui.add_button("pause")
        again = gui.add_button("start again")
        following = gui.add_button("next variation")
        self._variation = gui.add_number("variation", 0, min=0, max=NUM_VARIATIONS - 1, step=1)
        self._grip_folder = gui.add_folder("grips")

        def play_as(name: str) -> None:
            if name in players:  # A client may send any name, and some names execute code.
                session.play(TELEOPERATE if name == YOU else name)

        self._player.on_update(self._posting(play_as))
        self._pause.on_click(self._posting(lambda _: self._toggle_pause()))
        again.on_click(self._posting(lambda _: session.play()))
        following.on_click(self._posting(lambda _: session.play_next()))
        self._variation.on_update(self._posting(self._play_variation))

    def _play_variation(self, index: Any) -> None:
        if index in range(NUM_VARIATIONS):  # A client may send any number.
            self._session.play(variation=int(index))
        self._shown = None  # Resets the panel to the current episode.

    def _posting(self, function: Callable[[Any], object]) -> Callable[[Any], Any]:
        """Returns a handler that posts a function with the selected value to the session."""

        async def handle(event: Any) -> None:
            value = event.target.value
            if event.client is not None:
                self._session.post(lambda: function(value))

        return handle

    def _add_grip(self, part: int, name: str) -> Any:
        def close(closed: bool) -> None:
            if self._session.teleoperation is not None:
                self._session.teleoperation.grips[part] = bool(closed)

        with self._grip_folder:
            box = self._server.gui.add_checkbox(f"{name} closed", False)
        box.on_update(self._posting(close))
        return box

    def _toggle_pause(self) -> None:
        self._session.paused = not self._session.paused

    # ------------------------------------------------------------------ pictures

    def _frame(self) -> None:
        now = time.monotonic()
        if now < self._picture_due:
            return
        self._picture_due = now + PICTURE_INTERVAL
        session = self._session
        physics = session.env.physics
        if session.teleoperation is not self._driven_by or not self._scene.shows(physics):
            self._rebuild()
        elif self._server.get_clients():
            self._scene.update(physics)
        self._place_gizmos()
        if now >= self._text_due:
            self._text_due = now + TEXT_INTERVAL
            self._write()

    def _place_gizmos(self) -> None:
        """Moves gizmos that are not being dragged, and grip checkboxes, to the current state."""
        teleoperation = self._driven_by
        if teleoperation is None:
            return
        placed = zip(self._gizmos, teleoperation.targets, strict=True)
        for part, (gizmo, target) in enumerate(placed):
            if part not in self._dragged:
                half = target[3] / 2.0
                gizmo.position = target[:3]
                gizmo.wxyz = np.array([np.cos(half), 0.0, np.sin(half), 0.0])
        if self._grips and teleoperation.grips != self._shown_grips:
            self._shown_grips = list(teleoperation.grips)
            for box, closed in zip(self._grips, self._shown_grips, strict=True):
                self._set(box, closed)

    def _set(self, widget: Any, value: Any) -> None:
        """Sets a widget of the panel.

        In the thread of the server: in another one, the value would replace that of a user between
        its receipt and the call of its handler, which would then never learn of it.
        """
        self._server.get_event_loop().call_soon_threadsafe(setattr, widget, "value", value)

    def _write(self) -> None:
        session = self._session
        lines = (f"| {name} | **{value}** |" for name, value in session.status())
        self._text.content = "\n".join(["| | |", "|---|---|", *lines])
        # Only changes are sent: a user may just have selected something else.
        shown = session.policy, session.variation, session.paused
        if shown != self._shown:
            self._shown = shown
            self._set(self._player, YOU if session.policy == TELEOPERATE else session.policy)
            self._set(self._variation, session.variation)
            self._pause.label = "go on" if session.paused else "pause"
