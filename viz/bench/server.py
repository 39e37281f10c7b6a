"""Server of the page. It accepts connections of this machine only, and only messages of the page.

viser accepts every client and every message, and a message may open a tunnel to another host. Its server is
therefore made with a connection guard: hosts and origins other than this machine are refused (a foreign
page cannot reach it, nor by a name that it has turned to 127.0.0.1), so is every message that is not a page's
in form, and the page may load nothing from other hosts.
"""

from __future__ import annotations

import asyncio
import contextlib
import http
import io
import logging
import socket
from functools import partial
from typing import Any

import viser
import websockets.asyncio.server as servers
from websockets.datastructures import Headers
from websockets.http11 import Request, Response

from spheretwin.models.base.errors import InputError, without_breaks
from spheretwin.viz.bench.viser_internals import (
    SUBPROTOCOL,
    ServerArguments,
    is_page_message,
    with_guard,
    with_head,
)

HOST = "127.0.0.1"

MOST_PAGES = 64

# A person sends far less; a flood waits in its own socket.
MOST_MESSAGES_PER_S = 300.0

LARGEST_MESSAGE = 16_384

POLICY = (
    "default-src 'self' data: blob: 'unsafe-inline' 'unsafe-eval' 'wasm-unsafe-eval'; "
    "connect-src 'self' ws://{host} data: blob:; frame-ancestors 'none'; form-action 'none'"
)


def listen(port: int) -> socket.socket:
    """Bind a port of this machine exclusively.

    Parameters
    ----------
    port : int
        Port; 0 for any free port.

    Raises
    ------
    InputError
        The port is in use or invalid.
    """
    listening = socket.socket()
    listening.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
    try:
        listening.bind((HOST, port))
        listening.listen()  # now: another process may take a bound port until it listens
    except (OSError, OverflowError) as error:
        listening.close()
        raise InputError(f"bench: expected a free port, received {port}: {without_breaks(error)}") from None
    return listening


def serve(listening: socket.socket, title: str) -> viser.ViserServer:
    """Start the server of the page.

    Parameters
    ----------
    listening : socket.socket
        Socket from `listen`; the server owns it from now on.
    title : str
        Title of the page.
    """
    guard = partial(_ConnectionGuard, listening, title)
    with with_guard(guard), contextlib.redirect_stdout(io.StringIO()):  # viser prints its address
        server = viser.ViserServer(host=HOST, port=listening.getsockname()[1], verbose=False)
    server.get_event_loop().set_exception_handler(_ignore_exception)
    return server


def stop(server: viser.ViserServer) -> None:
    """Stop the server."""
    with contextlib.redirect_stdout(io.StringIO()):
        server.stop()


def address(server: viser.ViserServer) -> str:
    """Return the address of the page."""
    return f"http://{HOST}:{server.get_port()}"


class _ConnectionGuard(servers.serve):
    """Connection guard: the server that viser starts in place of its own."""

    def __init__(self, listening: socket.socket, title: str, arguments: ServerArguments) -> None:
        port = listening.getsockname()[1]
        self._hosts = {f"{name}:{port}" for name in (HOST, "localhost")}
        self._title, self._serve_file = title, arguments.process_request
        self._pages = 0
        super().__init__(
            self._counted(arguments.handler),
            sock=listening,
            process_request=self._answer,
            subprotocols=arguments.subprotocols,
            select_subprotocol=arguments.select_subprotocol,
            create_connection=_PageConnection,
            max_size=LARGEST_MESSAGE,
            compression=None,
            # A browser opens spare sockets that send nothing: they must not delay the end.
            open_timeout=1.0,
            close_timeout=1.0,
            logger=_SILENT,
            server_header=None,
        )

    def _counted(self, handler: Any) -> Any:
        async def counted(connection: Any) -> None:
            self._pages += 1
            try:
                await handler(connection)
            finally:
                self._pages -= 1

        return counted

    def _answer(self, connection: Any, request: Request) -> Response | None:
        hosts = request.headers.get_all("Host")
        if len(hosts) != 1 or hosts[0] not in self._hosts:
            return _refusal(http.HTTPStatus.MISDIRECTED_REQUEST)
        if any(origin not in self._origins() for origin in request.headers.get_all("Origin")):
            return _refusal(http.HTTPStatus.FORBIDDEN)
        if request.headers.get_all("Upgrade"):
            return self._admission(request)
        return self._file(connection, request, hosts[0])

    def _origins(self) -> set[str]:
        return {f"http://{host}" for host in self._hosts}

    def _admission(self, request: Request) -> Response | None:
        """Return a refusal, or None if a socket is admitted: its page must have the version of the server."""
        if request.headers.get_all("Sec-WebSocket-Protocol") != [SUBPROTOCOL]:
            return _refusal(http.HTTPStatus.BAD_REQUEST)
        return _refusal(http.HTTPStatus.SERVICE_UNAVAILABLE) if self._pages >= MOST_PAGES else None

    def _file(self, connection: Any, request: Request, host: str) -> Response:
        plain = Request(request.path, Headers())
        try:
            response = self._serve_file(connection, plain)
        except (ValueError, OSError):  # no file can have the requested name
            response = None
        if response is None or response.status_code != http.HTTPStatus.OK:
            return _refusal(http.HTTPStatus.NOT_FOUND)
        if response.headers["Content-Type"].startswith("text/html"):
            response.body = with_head(response.body, self._title)
            del response.headers["Content-Length"]
            response.headers["Content-Length"] = str(len(response.body))
        response.headers["Content-Security-Policy"] = POLICY.format(host=host)
        response.headers["X-Content-Type-Options"] = "nosniff"
        response.headers["Referrer-Policy"] = "no-referrer"
        response.headers["Cache-Control"] = "no-store"
        return response


class _PageConnection(servers.ServerConnection):
    """Socket of a page: it passes only messages of the forms of a page, at a limited rate."""

    _due = 0.0

    async def recv(self, decode: bool | None = None) -> Any:
        while True:
            raw = await super().recv(decode)
            now = asyncio.get_running_loop().time()
            self._due = max(self._due + 1 / MOST_MESSAGES_PER_S, now - 1.0)
            if self._due > now:
                await asyncio.sleep(self._due - now)
            if isinstance(raw, bytes) and is_page_message(raw):
                return raw


def _refusal(status: http.HTTPStatus) -> Response:
    body = f"{status.phrase}\n".encode()
    headers = Headers({"Content-Type": "text/plain", "Content-Length": str(len(body)), "Connection": "close"})
    return Response(status, status.phrase, headers, body)


_SILENT = logging.getLogger("spheretwin.bench")
_SILENT.addHandler(logging.NullHandler())
_SILENT.propagate = False


def _ignore_exception(loop: asyncio.AbstractEventLoop, context: dict[str, Any]) -> None:
    """Ignore an exception that a message of a page raised in viser; only that message is lost."""
