"""Server of the page. It accepts connections of this machine only, and only messages of the page.

viser accepts every client and every message, and a message may open a tunnel to another host. Its server is
therefore made with a connection guard: hosts and origins other than this machine are refused (a foreign
page cannot reach it, nor by a name that it has turned to 127.0.0.1), so is every message that is not a page's
in form, and the page may load nothing from other hosts. Other accounts of this machine have no access: a
browser needs the token of the printed address, and has a cookie from then on.
"""

from __future__ import annotations

import asyncio
import contextlib
import http
import io
import logging
import socket
from collections import Counter
from collections.abc import Callable, Mapping
from functools import partial
from typing import Any
from urllib.parse import parse_qs, parse_qsl, urlsplit

import viser
import websockets.asyncio.server as servers
from websockets.datastructures import Headers
from websockets.http11 import Request, Response

from spheretwin.models.base.errors import InputError, without_breaks
from spheretwin.viz.bench.access import Access
from spheretwin.viz.bench.connections import CONTROL, Control, PageConnection, serve_control
from spheretwin.viz.bench.viser_internals import SUBPROTOCOL, ServerArguments, with_guard, with_head

HOST = "127.0.0.1"

MOST_PAGES = 64

CONTROL_PATH = "/control"

LARGEST_MESSAGE = 16_384

NO_ACCESS = (
    "No access. Open the address with a token that the bench has printed. It works once; after that the bench"
    " prints a new one."
)

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


Answers = Mapping[str, Callable[[Mapping[str, str]], bytes]]
"""Functions that answer the requests of the page's own script, by path; each takes the query."""


def serve(
    listening: socket.socket,
    title: str,
    access: Access,
    control: Control,
    answers: Answers | None = None,
) -> viser.ViserServer:
    """Start the server of the page.

    Parameters
    ----------
    listening : socket.socket
        Socket from `listen`; the server owns it from now on.
    title : str
        Title of the page.
    access : Access
        Decides which browsers are admitted.
    control : callable
        Takes STOP and the heartbeats of the pages, see `serve_control`.
    answers : Answers, optional
        Answers to requests of the page's own script.
    """
    guard = partial(_ConnectionGuard, listening, title, access, control, answers or {})
    with with_guard(guard), contextlib.redirect_stdout(io.StringIO()):  # viser prints its address
        server = viser.ViserServer(host=HOST, port=listening.getsockname()[1], verbose=False)
    server.get_event_loop().set_exception_handler(_ignore_exception)
    return server


def stop(server: viser.ViserServer) -> None:
    """Stop the server."""
    with contextlib.redirect_stdout(io.StringIO()):
        server.stop()


def address(server: viser.ViserServer, access: Access) -> str:
    """Return the address of the page for the next browser."""
    return f"http://{HOST}:{server.get_port()}/?token={access.token}"


class _ConnectionGuard(servers.serve):
    """Connection guard: the server that viser starts in place of its own."""

    def __init__(
        self,
        listening: socket.socket,
        title: str,
        access: Access,
        control: Control,
        answers: Answers,
        arguments: ServerArguments,
    ) -> None:
        port = listening.getsockname()[1]
        self._listening, self._access, self._control = listening, access, control
        self._select = arguments.select_subprotocol
        self._hosts = {f"{name}:{port}" for name in (HOST, "localhost")}
        self._title, self._answers, self._serve_file = title, answers, arguments.process_request
        self._sockets: Counter[str] = Counter()
        super().__init__(
            self._counted(arguments.handler),
            sock=listening,
            process_request=self._answer,
            subprotocols=arguments.subprotocols,
            select_subprotocol=self._select_subprotocol,
            create_connection=PageConnection,
            max_size=LARGEST_MESSAGE,
            compression=None,
            # A browser opens spare sockets that send nothing: they must not delay the end.
            open_timeout=1.0,
            close_timeout=1.0,
            logger=_SILENT,
            server_header=None,
        )

    async def __aexit__(self, *exception: Any) -> None:
        """Accept no socket any more, then close: asyncio 3.11 leaves one open that it accepts meanwhile."""
        with contextlib.suppress(NotImplementedError):  # loops of Windows
            asyncio.get_running_loop().remove_reader(self._listening)
        for _ in range(2):  # in two turns an accepted socket has its transport, and that its connection
            await asyncio.sleep(0)
        await super().__aexit__(*exception)

    def _counted(self, handler: Any) -> Any:
        async def counted(connection: Any) -> None:
            self._sockets[connection.subprotocol] += 1
            try:
                if connection.subprotocol == CONTROL:
                    await serve_control(connection, self._control)
                else:
                    await handler(connection)
            finally:
                self._sockets[connection.subprotocol] -= 1

        return counted

    def _select_subprotocol(self, connection: Any, offered: Any) -> Any:
        return CONTROL if CONTROL in offered else self._select(connection, offered)

    def _answer(self, connection: Any, request: Request) -> Response | None:
        hosts = request.headers.get_all("Host")
        if len(hosts) != 1 or hosts[0] not in self._hosts:
            return _refusal(http.HTTPStatus.MISDIRECTED_REQUEST)
        if any(origin not in self._origins() for origin in request.headers.get_all("Origin")):
            return _refusal(http.HTTPStatus.FORBIDDEN)
        if token := parse_qs(urlsplit(request.path).query).get("token"):
            return self._redirection(request, token[0])
        if not self._access.admits(request.headers.get_all("Cookie")):
            return _refusal(http.HTTPStatus.FORBIDDEN, NO_ACCESS)
        if request.headers.get_all("Upgrade"):
            return self._admission(request)
        return self._file(connection, request, hosts[0])

    def _origins(self) -> set[str]:
        return {f"http://{host}" for host in self._hosts}

    def _redirection(self, request: Request, token: str) -> Response:
        """Admit a browser by the token, and show the page at an address without it."""
        cookie = self._access.redeem(token)
        if not cookie and not self._access.admits(request.headers.get_all("Cookie")):
            return _refusal(http.HTTPStatus.FORBIDDEN, NO_ACCESS)
        response = _refusal(http.HTTPStatus.SEE_OTHER)
        response.headers["Location"], response.headers["Cache-Control"] = "/", "no-store"
        if cookie:
            response.headers["Set-Cookie"] = cookie
        return response

    def _admission(self, request: Request) -> Response | None:
        """Return a refusal, or None if a socket is admitted: its page must have the version of the server."""
        expected = CONTROL if urlsplit(request.path).path == CONTROL_PATH else SUBPROTOCOL
        if request.headers.get_all("Sec-WebSocket-Protocol") != [expected]:
            return _refusal(http.HTTPStatus.BAD_REQUEST)
        return (
            _refusal(http.HTTPStatus.SERVICE_UNAVAILABLE) if self._sockets[expected] >= MOST_PAGES else None
        )

    def _file(self, connection: Any, request: Request, host: str) -> Response:
        path, _, query = request.path.partition("?")
        if answer := self._answers.get(path):
            return _data(answer(dict(parse_qsl(query))))
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


def _data(body: bytes) -> Response:
    headers = {"Content-Type": "application/octet-stream", "Content-Length": str(len(body))}
    headers |= {"Cache-Control": "no-store", "X-Content-Type-Options": "nosniff", "Connection": "close"}
    return Response(http.HTTPStatus.OK, "OK", Headers(headers), body)


def _refusal(status: http.HTTPStatus, text: str | None = None) -> Response:
    body = f"{text or status.phrase}\n".encode()
    headers = Headers(
        {"Content-Type": "text/plain; charset=utf-8", "Content-Length": str(len(body)), "Connection": "close"}
    )
    return Response(status, status.phrase, headers, body)


_SILENT = logging.getLogger("spheretwin.bench")
_SILENT.addHandler(logging.NullHandler())
_SILENT.propagate = False


def _ignore_exception(loop: asyncio.AbstractEventLoop, context: dict[str, Any]) -> None:
    """Ignore an exception that a message of a page raised in viser; only that message is lost."""
