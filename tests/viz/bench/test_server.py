"""Server of the bench's page: admission of clients."""

import asyncio
import gc
import socket
from urllib.parse import urlsplit

import msgspec
import pytest
from websockets.exceptions import InvalidStatus

from spheretwin.models.base.errors import InputError
from spheretwin.viz.bench import server
from spheretwin.viz.bench.access import Access
from spheretwin.viz.bench.connections import CONTROL
from spheretwin.viz.bench.viser_internals import ServerArguments
from tests.viz.bench import fake
from tests.viz.bench.clients import CAMERA, PROTOCOL, cookie, get, is_alive, port, raw_get, socket_to


def test_the_page_is_served_to_this_machine(page):
    status, headers, body = get(page)
    assert status == 200
    assert b"<title>bench</title>" in body
    assert "connect-src 'self' ws://127.0.0.1" in headers["Content-Security-Policy"]


@pytest.mark.parametrize("host", ["evil.example", "evil.example:80", "127.0.0.1.evil.example", "0.0.0.0", ""])
def test_another_name_for_this_machine_is_refused(page, host):
    """What a foreign page would have its own name mean: DNS rebinding."""
    assert get(page, Host=host and f"{host.partition(':')[0]}:{port(page)}")[0] == 421


@pytest.mark.parametrize("origin", ["http://evil.example", "null", "http://127.0.0.1:1", "https://localhost"])
def test_a_foreign_origin_is_refused(page, origin):
    assert get(page, Origin=origin)[0] == 403
    with pytest.raises(InvalidStatus) as refusal:
        socket_to(page, origin=origin)
    assert refusal.value.response.status_code == 403


def test_the_own_origin_is_admitted(page):
    with socket_to(page, origin=f"http://localhost:{port(page)}") as visitor:
        assert visitor.recv()


def test_a_page_of_another_version_is_refused(page, capfd):
    with pytest.raises(InvalidStatus) as refusal:
        socket_to(page, protocol="viser-v0.0.1")
    assert refusal.value.response.status_code == 400
    assert capfd.readouterr() == ("", "")


@pytest.mark.parametrize("path", ["/no.js", "/..%2f..%2fetc/passwd", "/%00", "/" + "a" * 5000, "//", "/%ff"])
def test_a_path_gives_the_page_or_nothing(page, path):
    status, _, body = get(page, path)
    assert (status, b"<title>bench" in body) in ((404, False), (200, True))


def test_a_port_in_use_is_refused(page):
    with pytest.raises(InputError, match=f"expected a free port, received {port(page)}"):
        server.listen(port(page))


def test_two_benches_run_at_once(page):
    one = page
    with fake.shown(fake.Bench()) as other:
        assert one.address != other.address
        assert is_alive(one)
        assert is_alive(other)


def test_fifty_pages_connect_and_disconnect(page):
    pages = [socket_to(page) for _ in range(50)]
    for visitor in pages:
        visitor.send(msgspec.msgpack.encode(CAMERA))
    assert all(visitor.recv() for visitor in pages)
    for visitor in pages[::2]:
        visitor.socket.shutdown(socket.SHUT_RDWR)  # as a process that is killed does
    assert is_alive(page)
    for visitor in pages:
        visitor.close()


def test_one_page_more_than_there_is_room_for_is_refused(page, monkeypatch):
    monkeypatch.setattr(server, "MOST_PAGES", 2)
    with socket_to(page), socket_to(page):
        with pytest.raises(InvalidStatus) as refusal:
            socket_to(page)
        assert refusal.value.response.status_code == 503


def test_a_token_works_once_and_gives_a_cookie(page):
    address = urlsplit(page.address)
    place = f"{address.path}?{address.query}"
    own = cookie(page)
    assert raw_get(page, "/", Cookie=own)[0] == 200
    assert raw_get(page, place)[0] == 403  # it was used
    status, headers, _ = raw_get(page, place, Cookie=own)  # a page that is opened again by its first address
    assert (status, headers["Location"], headers["Set-Cookie"]) == (303, "/", None)
    assert page.address != address.geturl()
    first, second = own, cookie(page)
    assert first != second
    for known in (first, second):
        assert raw_get(page, "/", Cookie=f"other=1; {known}; bench-1=2")[0] == 200


COOKIES = ("", "bench-1=x", "bench={port}", "bench-{port}=", "bench-{port}=guess", "bench-{port}=ä", "=;")


@pytest.mark.parametrize("path", ["/", "/index.html", "/control", "/?token=", "/?token=guess", "/?token=%ff"])
def test_there_is_no_access_without_cookie(page, path):
    given = [{"Cookie": cookie.format(port=port(page)).encode("latin-1")} for cookie in COOKIES]
    for headers in ({}, *given):
        status, _, body = raw_get(page, path, **headers)
        assert status == 403, headers
        assert b"No access" in body
        assert b"<script" not in body
    for protocol, at in ((PROTOCOL, ""), (CONTROL, "/control")):
        with pytest.raises(InvalidStatus) as refusal:
            socket_to(page, protocol=protocol, path=at, Cookie="bench=1")
        assert refusal.value.response.status_code == 403


def test_a_cookie_is_hidden_from_scripts_and_from_other_sites(page):
    address = urlsplit(page.address)
    _, headers, _ = raw_get(page, f"/?{address.query}")
    attributes = headers["Set-Cookie"].split("; ")[1:]
    assert attributes == ["HttpOnly", "SameSite=Strict", "Path=/"]
    assert headers["Cache-Control"] == "no-store"


@pytest.mark.parametrize("turns", range(6))
def test_a_socket_accepted_while_the_server_closes_is_closed(turns):
    """A browser opens spare sockets at any time, also when the server no longer looks for them."""
    listening = server.listen(0)
    visitor = socket.socket()

    async def visited():
        nothing = ServerArguments(None, None, None, None)
        access = Access(listening.getsockname()[1])
        async with server._ConnectionGuard(listening, "bench", access, lambda *_: None, {}, nothing):
            visitor.connect(listening.getsockname())
            for _ in range(turns):
                await asyncio.sleep(0)

    loop = asyncio.new_event_loop()  # asyncio.run would end what is left
    with visitor:
        loop.run_until_complete(visited())
        loop.close()
        gc.collect()  # warnings are errors, and a socket that was left open gives one
