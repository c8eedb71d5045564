"""Who may connect to the viewer: browsers that show its own page, and no other page they show.

Any web page can open a WebSocket to any address that its reader's machine can reach, the loopback
address included. Browsers say which page it is (`Origin`) and by which name it found the server
(`Host`), and pages cannot change that. As both are compared with each other and not with the port
listened at, tunnels with other ports work. A page whose name was made to point at this machine
(DNS rebinding) is told by that name: only addresses and this machine's own names are served.
Programs that are no browsers send no `Origin`, and could send any; nothing here holds them back.
"""

import contextlib
import http
import ipaddress
import socket
from collections.abc import Iterator, Mapping, Sequence
from typing import Any
from urllib.parse import urlsplit

from softgym_mj.exceptions import InvalidArgumentError, UnavailableError, import_extra
from softgym_mj.viewing.scene import EXTRA


def check_origins(origins: Sequence[str]) -> frozenset[str]:
    """Origins as browsers send them: "https://hub.example.com", or with a port.

    Raises:
        InvalidArgumentError: for what is none.
    """
    for origin in origins:
        parts = urlsplit(origin)
        if not parts.netloc or origin.lower() != f"{parts.scheme}://{parts.netloc}".lower():
            valid = "https://NAME or http://NAME, with :PORT if there is one, and no path"
            raise InvalidArgumentError("allow_origin", origin, valid)
    return frozenset(map(str.lower, origins))


def may_connect(headers: Any, listening: str, allowed: frozenset[str]) -> bool:
    """Whether a request is one of the viewer's own page.

    Args:
        headers: of the request, `websockets.Headers`.
        listening: the host that the server was told to listen at.
        allowed: further origins, of proxies, as `check_origins` returns them.
    """
    hosts, origins = headers.get_all("Host"), headers.get_all("Origin")
    if len(hosts) != 1 or len(origins) > 1:
        return False
    host, origin = hosts[0].lower(), origins[0].lower() if origins else None
    if origin in allowed:
        return True
    known = {listening.lower(), socket.gethostname().lower(), "localhost"}
    if not _is_name_of(host, known) and host not in {urlsplit(name).netloc for name in allowed}:
        return False
    return origin is None or origin == f"http://{host}"  # The server speaks no TLS.


def _is_name_of(host: str, known: set[str]) -> bool:
    """Whether a host, with or without a port, is an IP address or one of the known names."""
    with contextlib.suppress(ValueError):
        name = urlsplit(f"//{host}").hostname or ""
        if name in known:
            return True
        ipaddress.ip_address(name)
        return True
    return False


@contextlib.contextmanager
def guarded(listening: str, allowed: frozenset[str]) -> Iterator[None]:
    """Has the server that viser starts meanwhile refuse what `may_connect` does.

    viser has no argument for that, so this is in front of what it passes to `websockets`.

    Raises:
        UnavailableError: if it started a server in another way, which is not guarded.
    """
    websockets = import_extra("websockets.asyncio.server", "viser", EXTRA)
    serve, served = websockets.serve, []

    def guarded_serve(*args: Any, process_request: Any, **settings: Mapping) -> Any:
        def process(connection: Any, request: Any) -> Any:
            if may_connect(request.headers, listening, allowed):
                return process_request(connection, request)
            reason = "This page may not connect to softgym_mj; see --allow-origin.\n"
            return connection.respond(http.HTTPStatus.FORBIDDEN, reason)

        served.append(process)
        return serve(*args, process_request=process, **settings)

    websockets.serve = guarded_serve
    try:
        yield
    finally:
        websockets.serve = serve
    if not served:
        raise UnavailableError("this version of viser cannot be guarded against other web pages")
