"""Messages to the bench's page: none stops it, and STOP waits for none."""

import contextlib
import socket
import threading
import time

import hypothesis
import msgspec
import numpy as np
import pytest
from hypothesis import strategies as st
from websockets.exceptions import ConnectionClosed

from spheretwin.viz.bench import server
from spheretwin.viz.bench.connections import CONTROL, MOST_MESSAGES_PER_S, MOST_WAITING
from spheretwin.viz.bench.event_handlers import LATEST_INTERVAL_S
from spheretwin.viz.bench.viser_internals import MESSAGES, moved_thing
from tests.viz.bench.clients import CAMERA, changed, handle_of, is_alive, page_socket, socket_to
from tests.waiting import wait_for

PLAIN = st.none() | st.booleans() | st.integers(-(2**40), 2**40) | st.floats() | st.text(max_size=20)


ANYTHING = st.recursive(
    PLAIN,
    lambda inside: st.lists(inside, max_size=4) | st.dictionaries(st.text(max_size=8), inside, max_size=4),
)


KINDS = st.sampled_from(
    [
        *["GuiUpdateMessage"] * 6,
        *(form.__struct_config__.tag for form in MESSAGES),
        *(
            "CommandTriggerMessage",
            "TransformControlsUpdateMessage",
            "GuiFormSubmitMessage",
            "ShareUrlRequest",
        ),
        *("FileTransferStartUpload", "RunJavascriptMessage", "GuiCloseModalMessage"),
    ]
)


@st.composite
def nearly(draw, handles):
    """What a page might send but for a detail."""
    kind = draw(KINDS)
    name = st.sampled_from([*handles, "/tip", "/coils", "no such"])
    three, middle = st.lists(st.floats(), min_size=3, max_size=3), st.just([0.5, 0.5])
    scene = {"name": name, "modifier": st.none()}
    fields = {
        "GuiUpdateMessage": {"uuid": name, "updates": st.fixed_dictionaries({"value": ANYTHING})},
        "CommandTriggerMessage": {"uuid": name},
        "GuiFormSubmitMessage": {"uuid": name},
        "SceneNodeClickMessage": {"instance_index": st.integers(-99, 99) | st.none()}
        | {"ray_origin": three, "ray_direction": three, "screen_pos": middle, **scene},
        "SceneNodeDragMessage": {"phase": st.sampled_from(["start", "update", "end", "other"])}
        | {"instance_index": st.none(), "button": st.just("left"), **scene}
        | {f"{end}_position": three for end in ("start", "end")}
        | {f"{end}_screen_pos": middle for end in ("start", "end")},
    }.get(kind, {"name": name, "uuid": name, "filename": ANYTHING})
    return {"type": kind} | {field: draw(drawn) for field, drawn in fields.items()}


def read_for_ever(visitor):
    while True:
        visitor.recv()


def handles(page):
    """Names of all that a person can touch, as the server has them."""
    return sorted(page._server.gui._gui_input_handle_from_uuid)


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
    with page_socket(page) as visitor:

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
    with page_socket(page) as visitor:
        for updates in ({"removed": True}, {"update_cb": []}, {"value": True, "removed": True}):
            for name in handles(page):
                visitor.send(changed(name, **updates))
        assert bench.commands() == []
        visitor.send(changed(handle_of(page, "remote"), value='["stop", {}]'))
        wait_for(lambda: bench.commands() == [("stop", {})])


def test_only_messages_of_a_page_pass():
    value = {"type": "GuiUpdateMessage", "uuid": "a", "updates": {"value": True}}
    ray = {"ray_origin": [0.0, 0.0, 0.0], "ray_direction": [0.0, 0.0, 1.0], "screen_pos": [0.5, 0.5]}
    click = {"type": "SceneNodeClickMessage", "name": "/coils", "instance_index": 3, **ray, "modifier": None}
    for message in (value, CAMERA, click):
        assert moved_thing(msgspec.msgpack.encode(message))
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
        assert not moved_thing(msgspec.msgpack.encode(other))


def test_of_a_flood_the_last_move_acts_and_the_socket_stays_open(page, bench):
    """Ten thousand moves hold up neither the server, nor another page, nor a button of the same page."""
    before = len(bench.commands())
    name = handle_of(page, "α, °")
    with page_socket(page) as flooding:
        begun = time.monotonic()
        for i in range(1, 10_001):
            flooding.send(changed(name, value=0.001 * i))
        flooding.send(changed(handle_of(page, "remote"), value='["hold", {}]'))
        wait_for(lambda: ("hold", {}) in bench.commands())
        assert page._server.gui._gui_input_handle_from_uuid[name].value == 10.0
        passed_s = time.monotonic() - begun
        # Of what is steered, the bench is told ten times a second.
        assert len(bench.commands()) - before <= 3 + passed_s / LATEST_INTERVAL_S
        assert is_alive(page)
        flooding.ping().wait()  # it is read to its end, and answers


def test_messages_that_are_no_moves_wait_in_their_socket(page, bench):
    with page_socket(page) as flooding:
        begun = time.monotonic()
        for _ in range(2 * MOST_WAITING):
            flooding.send(changed(handle_of(page, "remote"), value='["pause", {}]'))
        wait_for(lambda: len(bench.commands()) == 2 * MOST_WAITING)
        # A second's worth is taken at once, and the rest at its rate.
        assert time.monotonic() - begun > 2 * MOST_WAITING / MOST_MESSAGES_PER_S - 1.5


@pytest.mark.release("browser, 6 s; test_stop.py of the bench has STOP without one")
def test_stop_of_the_control_channel_waits_for_no_rate(page, bench):
    """After ten thousand presses of the same page."""
    with page_socket(page) as flooding, control_of(page) as control:
        press = changed(handle_of(page, "remote"), value='["pause", {}]')
        flood = threading.Thread(target=send_until_closed, args=(flooding, [press] * 10_000), daemon=True)
        flood.start()
        wait_for(lambda: len(bench.commands()) > MOST_WAITING)
        control.send("stop")
        wait_for(lambda: ("stop", {}) in bench.commands())
        assert bench.commands().index(("stop", {})) < 10_000
        flooding.socket.shutdown(socket.SHUT_RDWR)
        flood.join()


def control_of(page):
    return socket_to(page, protocol=CONTROL, path="/control")


def send_until_closed(visitor, messages):
    with contextlib.suppress(ConnectionClosed):
        for message in messages:
            visitor.send(message)


def test_the_control_channel_takes_stop_and_heartbeats_only(page, bench):
    with control_of(page) as control:
        for message in ("beat", "beat ", "beat x", "beat 99999999999", b"stop", "halt", "beat 7", "stop"):
            control.send(message)
        wait_for(lambda: ("stop", {}) in bench.commands())
    assert bench.beats == ["page 7"]
    assert bench.commands() == [("stop", {})]


def test_a_watching_page_changes_no_value(page, bench):
    """Neither what a text field holds, nor by a socket that has not become a page."""
    file = handle_of(page, "file")
    known = page._server.gui._gui_input_handle_from_uuid[file]
    with page_socket(page) as operator, socket_to(page) as watcher, socket_to(page) as unknown:
        operator.send(changed(file, value="mine.parquet"))
        wait_for(lambda: known.value == "mine.parquet")
        watcher.send(msgspec.msgpack.encode(CAMERA))
        for other in (watcher, unknown):
            other.send(changed(file, value="/etc/passwd"))
        watcher.send(changed(handle_of(page, "Replay"), value=True))
        watcher.send(changed(handle_of(page, "remote"), value='["stop", {}]'))  # heard after the others
        wait_for(lambda: ("stop", {}) in bench.commands())
        operator.send(changed(handle_of(page, "Replay"), value=True))
        wait_for(lambda: len(bench.commands()) == 2)
        assert bench.commands()[1] == ("replay", {"file": "mine.parquet"})
        assert known.value == "mine.parquet"


def test_a_press_comes_after_what_was_moved_before_it(page, bench):
    """The slider's last place is told before the button, however short a time ago another was."""
    with page_socket(page) as visitor:
        for angle in (10.0, 20.0, 30.0):
            visitor.send(changed(handle_of(page, "α, °"), value=angle))
        visitor.send(changed(handle_of(page, "remote"), value='["hold", {}]'))
        wait_for(lambda: ("hold", {}) in bench.commands())
        (*_, (before, given), last) = bench.commands()
        assert last == ("hold", {})
        assert before == "point"
        assert given["pose_rad"][0] == pytest.approx(np.radians(30.0), rel=1e-12)
        time.sleep(2 * LATEST_INTERVAL_S)
        assert bench.commands()[-1] == last
