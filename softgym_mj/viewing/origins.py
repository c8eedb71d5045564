"""Access control of the viewer: only its own page may connect, not other pages in a browser.

Any web page can open a WebSocket to any address that its reader's machine can reach, including the
loopback address. Browsers send the page's address (`Origin`) and the server's name (`Host`), which
pages cannot change. Both are compared with each other and not with the server's port, so tunnels
with other ports work. A page whose name was redirected to this machine (DNS rebinding) is rejected
by that name: only addresses and this machine's own names are served. Other programs send no
`Origin`, or any, and are not restricted.
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
    """Returns origins as browsers send them: "https://hub.example.com", or with a port.

    Raises:
        InvalidArgumentError: for an invalid origin.
    """
    for origin in origins:
        parts = urlsplit(origin)
        if not parts.netloc or origin.lower() != f"{parts.scheme}://{parts.netloc}".lower():
            valid = "https://NAME or http://NAME, with :PORT if there is one, and no path"
            raise InvalidArgumentError("allow_origin", origin, valid)
    return frozenset(map(str.lower, origins))


def may_connect(headers: Any, listening: str, allowed: frozenset[str]) -> bool:
    """Returns whether a request comes from the viewer's own page.

    Args:
        headers: headers of the request, `websockets.Headers`.
        listening: host at which the server listens.
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
    """Returns whether a host, with or without a port, is an IP address or a known name."""
    with contextlib.suppress(ValueError):
        name = urlsplit(f"//{host}").hostname or ""
        if name in known:
            return True
        ipaddress.ip_address(name)
        return True
    return False


@contextlib.contextmanager
def guarded(listening: str, allowed: frozenset[str]) -> Iterator[None]:
    """Context in which a server started by viser rejects requests that `may_connect` rejects.

    viser has no argument for that, so this wraps the handler that it passes to `websockets`.

    Raises:
        UnavailableError: if viser started a server in another way, which is not guarded.
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
        raise UnavailableError("this version of viser cannot check the origin of connections")
