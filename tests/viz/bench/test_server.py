"""Server of the page: admission of clients and messages; no message stops it."""

import http.client
import socket
import time

import hypothesis
import msgspec
import numpy as np
import pytest
import viser
from hypothesis import strategies as st
from websockets.exceptions import ConnectionClosed, InvalidStatus
from websockets.sync.client import connect

from spheretwin.models.base.errors import InputError
from spheretwin.viz.bench import server
from spheretwin.viz.bench.event_handlers import LATEST_INTERVAL_S
from spheretwin.viz.bench.viser_internals import is_page_message
from tests.viz.bench import fake
from tests.waiting import PATIENCE_S, wait_for

PROTOCOL = f"viser-v{viser.__version__}"

CAMERA = {
    "type": "ViewerCameraMessage",
    "wxyz": [1.0, 0.0, 0.0, 0.0],
    "position": [0.0, 0.0, 1.0],
    "fov": 1.3,
    "near": 0.01,
    "far": 1000,
    "image_height": 600,
    "image_width": 800,
    "look_at": [0.0, 0.0, 0.0],
    "up_direction": [0.0, 0.0, 1.0],
}


def port(page):
    return int(page.address.rpartition(":")[2])


def get(page, path="/", **headers):
    """Status, headers and body of an answer; a header that is given takes the place of the usual."""
    connection = http.client.HTTPConnection("127.0.0.1", port(page), timeout=PATIENCE_S)
    connection.putrequest("GET", path, skip_host="Host" in headers)
    for name, value in headers.items():
        connection.putheader(name, value)
    connection.endheaders()
    answer = connection.getresponse()
    body = answer.read()
    connection.close()
    return answer.status, answer.headers, body


def socket_to(page, origin=None, host="127.0.0.1", protocol=PROTOCOL):
    at = f"ws://127.0.0.1:{port(page)}"
    headers = {} if host == "127.0.0.1" else {"Host": host}
    return connect(
        at,
        origin=origin,
        subprotocols=[protocol],
        additional_headers=headers,
        max_size=None,
        max_queue=None,
        proxy=None,
    )


def is_alive(page):
    """Whether a page that comes now is served, and heard."""
    with socket_to(page) as visitor:
        visitor.send(msgspec.msgpack.encode(CAMERA))
        return len(visitor.recv(timeout=PATIENCE_S)) > 0


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
        assert visitor.recv(timeout=PATIENCE_S)


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


PLAIN = st.none() | st.booleans() | st.integers(-(2**40), 2**40) | st.floats() | st.text(max_size=20)
ANYTHING = st.recursive(
    PLAIN,
    lambda inside: st.lists(inside, max_size=4) | st.dictionaries(st.text(max_size=8), inside, max_size=4),
)
KINDS = st.sampled_from(
    [
        *["GuiUpdateMessage"] * 6,
        "ViewerCameraMessage",
        "CommandTriggerMessage",
        "SceneNodeClickMessage",
        "SceneNodeDragMessage",
        "TransformControlsUpdateMessage",
        "GuiFormSubmitMessage",
        "ShareUrlRequest",
        "FileTransferStartUpload",
        "RunJavascriptMessage",
        "GuiCloseModalMessage",
    ]
)


@st.composite
def nearly(draw, handles):
    """What a page might send but for a detail."""
    kind = draw(KINDS)
    name = st.sampled_from([*handles, "/tip", "/coils", "no such"])
    three = st.lists(st.floats(), min_size=3, max_size=3)
    fields = {
        "GuiUpdateMessage": {
            "uuid": name,
            "updates": st.fixed_dictionaries({"value": ANYTHING}),
        },
        "CommandTriggerMessage": {"uuid": name},
        "GuiFormSubmitMessage": {"uuid": name},
        "SceneNodeClickMessage": {
            "name": name,
            "instance_index": st.integers(-99, 99) | st.none(),
            "ray_origin": three,
            "ray_direction": three,
            "screen_pos": st.just([0.5, 0.5]),
            "modifier": st.none(),
        },
        "SceneNodeDragMessage": {
            "phase": st.sampled_from(["start", "update", "end", "other"]),
            "name": name,
            "instance_index": st.none(),
            "start_position": three,
            "start_screen_pos": st.just([0.5, 0.5]),
            "end_position": three,
            "end_screen_pos": st.just([0.5, 0.5]),
            "button": st.just("left"),
            "modifier": st.none(),
        },
    }.get(kind, {"name": name, "uuid": name, "filename": ANYTHING})
    return {"type": kind} | {field: draw(drawn) for field, drawn in fields.items()}


def read_for_ever(visitor):
    while True:
        visitor.recv(timeout=PATIENCE_S)


def handles(page):
    """Names of all that a person can touch, as the server has them."""
    return sorted(page._server.gui._gui_input_handle_from_uuid)


def handle_of(page, label):
    """Name of what has a label, as the server has it."""
    known = page._server.gui._gui_input_handle_from_uuid.items()
    return next(uuid for uuid, handle in known if handle.label == label)


def changed(name, **updates):
    return msgspec.msgpack.encode({"type": "GuiUpdateMessage", "uuid": name, "updates": updates})


def wait_until_all_is_heard(page, bench, visitor):
    """Send a number that is no other, and wait for it: messages are heard in their order."""
    visitor.send(changed(handle_of(page, "rate, rad/s"), value=0.123456))
    wait_for(lambda: ("limits", {"rate_rad_s": 0.123456}) in bench.commands())


def test_the_server_survives_any_message(page, bench, capfd):
    """Bytes, well-formed messages of any content, and messages that are nearly a page's."""
    anything = (
        st.binary(max_size=64)
        | ANYTHING.map(msgspec.msgpack.encode)
        | nearly(handles(page)).map(msgspec.msgpack.encode)
    )
    with socket_to(page) as visitor:
        visitor.send(msgspec.msgpack.encode(CAMERA))

        @hypothesis.settings(max_examples=60)
        @hypothesis.given(st.lists(anything, min_size=10, max_size=10))
        def send(messages):
            for message in messages:
                visitor.send(message)

        send()
        for message in ("text", b"\xff" * 100, b"\x91" * 9000):
            visitor.send(message)
        for name in handles(page):
            for value in (True, 1.5, "no such", [1.0, 2.0, 3.0]):
                visitor.send(changed(name, value=value))
        wait_until_all_is_heard(page, bench, visitor)
        assert len(bench.commands()) > 30  # there are more buttons and sliders than that
        visitor.send(b"x" * (server.LARGEST_MESSAGE + 1))
        with pytest.raises(ConnectionClosed):
            read_for_ever(visitor)
    assert is_alive(page)
    assert capfd.readouterr() == ("", "")


def test_no_message_disables_stop(page, bench):
    """viser sets whatever attribute of a handle a message names: that it is gone, what it calls."""
    with socket_to(page) as visitor:
        visitor.send(msgspec.msgpack.encode(CAMERA))
        for updates in ({"removed": True}, {"update_cb": []}, {"value": True, "removed": True}):
            for name in handles(page):
                visitor.send(changed(name, **updates))
        assert bench.commands() == []
        visitor.send(changed(handle_of(page, "STOP (space)"), value=True))
        wait_for(lambda: bench.commands() == [("stop", {})])


def test_only_messages_of_a_page_pass():
    value = {"type": "GuiUpdateMessage", "uuid": "a", "updates": {"value": True}}
    assert is_page_message(msgspec.msgpack.encode(value))
    assert is_page_message(msgspec.msgpack.encode(CAMERA))
    click = {
        "type": "SceneNodeClickMessage",
        "name": "/coils",
        "instance_index": 3,
        "ray_origin": [0.0, 0.0, 0.0],
        "ray_direction": [0.0, 0.0, 1.0],
        "screen_pos": [0.5, 0.5],
        "modifier": None,
    }
    assert is_page_message(msgspec.msgpack.encode(click))
    for other in (
        {**click, "screen_pos": [0.5, 0.5, 0.5]},
        {**click, "ray_origin": [0.0, 0.0]},
        {**value, "updates": {"removed": True}},
        {**value, "updates": {"value": True, "removed": True}},
        {**value, "updates": {"value": np.nan}},
        {**value, "more": 1},
        {**CAMERA, "fov": np.inf},
        {"type": "ShareUrlRequest"},
        {"type": "GuiUpdateMessage"},
    ):
        assert not is_page_message(msgspec.msgpack.encode(other))


def test_fifty_pages_connect_and_disconnect(page):
    pages = [socket_to(page) for _ in range(50)]
    for visitor in pages:
        visitor.send(msgspec.msgpack.encode(CAMERA))
    assert all(visitor.recv(timeout=PATIENCE_S) for visitor in pages)
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


def test_a_flood_waits_in_its_own_socket(page, bench):
    """Thousands of moves of a slider hold up neither the server nor another page."""
    before = len(bench.commands())
    name = handle_of(page, "α, °")
    with socket_to(page) as flooding:
        flooding.send(msgspec.msgpack.encode(CAMERA))
        begun = time.monotonic()
        for i in range(5000):
            flooding.send(changed(name, value=0.01 * i))
        sending_s = time.monotonic() - begun
        begun = time.monotonic()
        assert is_alive(page)
        waited_s = time.monotonic() - begun
        # Of what is steered, the bench is told ten times a second; of who is there, now and then.
        assert len(bench.commands()) - before <= 2 + (waited_s + sending_s) / LATEST_INTERVAL_S
        # Of messages, a second's worth is taken at once and the rest at its rate: the moves count themselves.
        moves = page._server.gui._gui_input_handle_from_uuid[name].value / 0.01
        assert 0 < moves <= 1 + server.MOST_MESSAGES_PER_S * (1 + time.monotonic() - begun + sending_s)
        flooding.socket.shutdown(socket.SHUT_RDWR)


def test_a_press_comes_after_what_was_moved_before_it(page, bench):
    """The slider's last place is told before the button, however short a time ago another was."""
    with socket_to(page) as visitor:
        visitor.send(msgspec.msgpack.encode(CAMERA))
        for angle in (10.0, 20.0, 30.0):
            visitor.send(changed(handle_of(page, "α, °"), value=angle))
        visitor.send(changed(handle_of(page, "mode"), value="hold"))
        wait_for(lambda: ("hold", {}) in bench.commands())
        (*_, (before, given), last) = bench.commands()
        assert last == ("hold", {})
        assert before == "point"
        assert given["pose_rad"][0] == pytest.approx(np.radians(30.0), rel=1e-12)
        time.sleep(2 * LATEST_INTERVAL_S)
        assert bench.commands()[-1] == last
