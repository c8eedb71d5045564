"""Who may connect to the viewer: other web pages may not, by real sockets."""

import http.client
import socket
import time

import msgspec
import pytest
import viser
import websockets.asyncio.server
from websockets.exceptions import InvalidStatus
from websockets.sync.client import connect

from softgym_mj.exceptions import InvalidArgumentError, UnavailableError
from softgym_mj.viewing import browser
from tests.viewing.chromium import wait_until
from tests.viewing.test_teleoperation import unhurried

PROXY = "https://hub.example.com"
OWN = "http://127.0.0.1:{port}"  # Origin of the viewer's own page.


@pytest.fixture(name="port", scope="module")
def _port():
    with browser.open_server(port=0, allow_origin=[PROXY]) as server:
        yield server.get_port()


def opens(port, host, origin):
    """Whether a WebSocket opens and stays open; by the address that a browser would find."""
    with socket.create_connection(("127.0.0.1", port)) as raw:
        try:
            with connect(
                f"ws://{host}",
                sock=raw,
                origin=origin,
                subprotocols=[f"viser-v{viser.__version__}"],
                compression=None,
                open_timeout=20,
            ) as client:
                return bool(client.recv(timeout=20))
        except InvalidStatus as refused:
            assert refused.response.status_code == 403
            assert b"--allow-origin" in refused.response.body
            return False


@pytest.mark.parametrize(
    ("host", "origin"),
    [
        ("127.0.0.1:{port}", OWN),
        ("localhost:{port}", "http://localhost:{port}"),
        ("LOCALHOST:{port}", "http://localhost:{port}"),
        ("[::1]:{port}", "http://[::1]:{port}"),
        ("localhost:9000", "http://localhost:9000"),  # ssh -L 9000:localhost:{port}.
        ("192.168.7.8:{port}", "http://192.168.7.8:{port}"),  # With --host 0.0.0.0.
        (f"{socket.gethostname()}:{{port}}", f"http://{socket.gethostname()}:{{port}}".lower()),
        ("127.0.0.1:{port}", PROXY),  # A proxy that says who it forwards to,
        ("hub.example.com", PROXY),  # and one that does not.
        ("127.0.0.1:{port}", None),  # No browser.
    ],
)
def test_its_own_page_connects(host, origin, port):
    assert opens(port, host.format(port=port), origin and origin.format(port=port))


@pytest.mark.parametrize(
    ("host", "origin"),
    [
        ("127.0.0.1:{port}", "http://evil.example"),
        ("127.0.0.1:{port}", "http://evil.example:{port}"),
        ("127.0.0.1:{port}", "null"),  # A file, or a frame of any page.
        ("127.0.0.1:{port}", ""),
        ("127.0.0.1:{port}", "http://127.0.0.1"),  # Another server of this machine,
        ("localhost:{port}", "http://localhost:3000"),
        ("localhost:{port}", "http://127.0.0.1:{port}"),
        ("localhost:{port}", "http://localhost:{port}.evil.example"),
        ("localhost:{port}", "http://user@localhost:{port}"),
        ("evil.example:{port}", "http://evil.example:{port}"),  # whose name points here.
        ("127.0.0.1.evil.example:{port}", "http://127.0.0.1.evil.example:{port}"),
        ("localhost.evil.example:{port}", "http://localhost.evil.example:{port}"),
        ("evil.example:{port}", None),
        ("127.0.0.1:{port}", "http://hub.example.com"),  # Not the proxy's scheme.
        ("127.0.0.1:{port}", "https://hub.example.com.evil.example"),
        ("hub.example.com", "https://evil.example"),
        ("localhost:{port}", "https://localhost:{port}"),  # Not the viewer's scheme.
        ("localhost:{port}", "file://localhost:{port}"),
    ],
)
def test_other_pages_do_not(host, origin, port):
    assert not opens(port, host.format(port=port), origin and origin.format(port=port))


@pytest.mark.parametrize(("host", "status"), [("localhost", 200), ("evil.example", 403)])
def test_the_page_itself_is_served_by_known_names(host, status, port):
    connection = http.client.HTTPConnection("127.0.0.1", port, timeout=20)
    connection.request("GET", "/", headers={"Host": f"{host}:{port}"})
    answer = connection.getresponse()
    assert answer.status == status and (b"<html" in answer.read()) == (status == 200)


def test_two_hosts_are_none(port):
    with socket.create_connection(("127.0.0.1", port), timeout=20) as raw:
        raw.sendall(b"GET / HTTP/1.1\r\nHost: localhost\r\nHost: localhost\r\n\r\n")
        assert b" 403 " in raw.recv(1000).splitlines()[0]


CAMERA = {
    "type": "ViewerCameraMessage", "wxyz": [1.0, 0.0, 0.0, 0.0], "position": [1.0, 0.0, 0.0],
    "fov": 1.0, "near": 0.1, "far": 10.0, "image_height": 10, "image_width": 10,
    "look_at": [0.0, 0.0, 0.0], "up_direction": [0.0, 0.0, 1.0],
}  # fmt: skip


@pytest.fixture(name="viewer")
def _viewer():
    """A session, the server that shows it, and its panel."""
    session = unhurried("straighten_rope")
    with browser.open_server(port=0) as server:
        yield session, server, browser.Browser(session, server)


def drives(session, server, handle, value, condition, seconds=20.0, origin=OWN):
    """Whether a page's change of what is on the panel is of effect within some seconds."""
    change = {"type": "GuiUpdateMessage", "uuid": handle._impl.uuid, "updates": {"value": value}}
    with connect(
        f"ws://127.0.0.1:{server.get_port()}",
        origin=origin.format(port=server.get_port()),
        subprotocols=[f"viser-v{viser.__version__}"],
    ) as client:
        client.send(msgspec.msgpack.encode(CAMERA))
        wait_until(server.get_clients, 20)
        client.send(msgspec.msgpack.encode(change))
        end = time.monotonic() + seconds
        while time.monotonic() < end and not condition():
            session.advance()
    return condition()


def test_only_its_own_page_drives(viewer):
    session, server, panel = viewer
    pause = session, server, panel._pause, True, lambda: session.paused
    with pytest.raises(InvalidStatus):
        drives(*pause, origin="http://evil.example")
    assert not session.paused and not server.get_clients()
    assert drives(*pause)


def test_values_that_the_panel_does_not_offer_change_nothing(viewer):
    session, server, panel = viewer
    for value in (-1, 1000, 2.5, float("nan"), 1e300, "x", None, [1]):
        panel._play_variation(value)
        assert session.variation == 800
    assert drives(session, server, panel._variation, 7, lambda: session.variation == 7)


def test_a_change_that_arrives_while_the_panel_is_written_is_kept(viewer, monkeypatch):
    """Its receipt takes so long that the session writes the variation that it plays."""
    session, server, panel = viewer
    monkeypatch.setattr(panel._variation._impl, "sync_cb", lambda *update: time.sleep(0.5))
    assert drives(session, server, panel._variation, 7, lambda: session.variation == 7, 5.0)


@pytest.mark.long
def test_nobody_names_other_policies(viewer, tmp_path, monkeypatch):
    """As on the command line, which is the user's own, a name could be that of any module."""
    monkeypatch.syspath_prepend(tmp_path)
    (tmp_path / "strange.py").write_text("import pathlib\npathlib.Path(__file__ + '.run').touch()")
    session, server, panel = viewer
    assert not drives(session, server, panel._player, "strange:make",
                      lambda: list(tmp_path.glob("*.run")), 3.0)  # fmt: skip


@pytest.mark.parametrize("origin", ["hub.example.com", "*", "", "https://hub.example.com/", "a://"])
def test_what_is_no_origin(origin):
    words = r"allow_origin=.*https://NAME"
    with (
        pytest.raises(InvalidArgumentError, match=words),
        browser.open_server(port=0, allow_origin=[origin]),
    ):
        pass


def test_a_server_that_cannot_be_guarded_is_not_opened(monkeypatch):
    monkeypatch.setattr(viser, "ViserServer", lambda **settings: None)
    before = websockets.asyncio.server.serve
    with (
        pytest.raises(UnavailableError, match="cannot check the origin"),
        browser.open_server(port=0),
    ):
        pass
    assert websockets.asyncio.server.serve is before
