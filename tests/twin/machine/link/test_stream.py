"""Streams of measurements: the same estimates as from a file, and how a stream ends."""

import numpy as np
import pytest

from spheretwin.machine import Log, Shadow, shadow
from spheretwin.machine.link import frame_format
from spheretwin.machine.link.codec import Codec
from spheretwin.machine.link.frame_format import Flags
from spheretwin.machine.link.stream import RunningShadow, is_address, played, streamed
from spheretwin.machine.link.transports import Udp
from spheretwin.machine.log import joined
from spheretwin.machine.model import model_of
from spheretwin.models.base.errors import InputError, SpheretwinError
from tests.twin.machine.link.lines import Script
from tests.twin.machine.machine_logs import KNOWN, SCENARIO, changing_log


@pytest.fixture(scope="module")
def log():
    measured = changing_log(0.5)
    return Log(measured.t_s, measured.current_A, measured.angle_rad, "measured", "stream")


@pytest.fixture(scope="module")
def model():
    return model_of(SCENARIO, KNOWN)


def frames_of(log, *, end=True, key=b"", session=0):
    codec = Codec(frame_format.load("spheretwin").measurement, 18, key)
    for row in range(len(log)):
        last = end and row == len(log) - 1
        values = {"sequence": row, "echo": 0, "flags": int(Flags.END) if last else 0, "time": log.t_s[row]}
        values |= {"angle": log.angle_rad[row], "rate": np.zeros(3), "current": log.current_A[row]}
        yield codec.encode({**values, "temperature": 20.0, "session": session})


def received(script, *contents, closed=False, currents=None, key=b""):
    """Blocks of a stream of bytes, which its sender may close."""
    script.datagrams, script.is_closed = False, closed
    for content in contents:
        script.plan(content)
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("spheretwin.machine.link.stream.open_transport", lambda *_, **__: script)
        return list(streamed("-", 18, currents=currents, key=key, now=script.now))


def test_a_stream_is_the_log_of_its_frames(log, model):
    blocks = received(Script(), b"".join(frames_of(log)))
    whole = joined(blocks)
    assert whole.digest == log.digest
    running = Shadow(model)
    values = np.vstack([running.advance(block).values for block in received(Script(), *frames_of(log))])
    assert np.array_equal(values, shadow(log, model).telemetry.values)


@pytest.mark.parametrize(("frames", "given", "kind"), [
    ("measured", None, "measured"), ("commanded", None, "commanded"), (None, None, "measured"),
    ("measured", "commanded", "commanded"), (None, "commanded", "commanded"),
])  # fmt: skip
def test_a_stream_has_the_kind_of_currents_that_it_or_its_reader_states(
    log, frames, given, kind, monkeypatch
):
    description = frame_format.load("spheretwin").model_copy(update={"currents": frames})
    monkeypatch.setattr(frame_format, "load", lambda _: description)
    blocks = received(Script(), b"".join(frames_of(log)), currents=given)
    assert {block.currents for block in blocks} == {kind}


def test_a_stream_ends_with_its_sender(log):
    """Closed without the end flag; bytes that are no frame are skipped."""
    script, content = Script(), b"noise" + b"".join(frames_of(log, end=False))
    assert joined(received(script, content, closed=True)).digest == log.digest
    assert script.t_s < 0.3  # no silence is waited for
    with pytest.raises(SpheretwinError, match="expected frames, received 1 texts"):
        received(Script(), b"no frame at all", closed=True)


def test_a_stream_with_a_key_takes_the_frames_of_one_session_with_that_key(log):
    key, rest = b"0123456789abcdef", log.rows(100, len(log))
    own = list(frames_of(log.rows(0, 100), end=False, key=key, session=7))
    forged = frames_of(log, key=b"another key of 26 letters!", session=7)
    replayed = frames_of(log, key=key, session=6)
    content = b"".join([*own, *forged, *replayed, *own, b"".join(frames_of(log))])
    blocks = received(Script(), content, closed=True, key=key)
    assert joined(blocks).digest == log.rows(0, 100).digest
    with pytest.raises(SpheretwinError, match="expected frames"):
        received(Script(), *frames_of(rest), closed=True, key=key)


def test_a_stream_ends_after_a_silence(log):
    script = Script()
    assert joined(received(script, *frames_of(log, end=False))).digest == log.digest
    assert script.t_s == pytest.approx(2.0, abs=0.2)


def test_frames_need_times_angles_and_currents():
    with pytest.raises(InputError, match="expected measurements with time, current"):
        list(streamed("udp://127.0.0.1:0", 18, "ventusff_pose"))


def test_the_port_is_free_after_a_stop():
    free = Udp("127.0.0.1", 0, listening=True)
    port = free.port
    free.close()
    with pytest.raises(SpheretwinError, match="expected frames"):
        list(streamed(f"udp://127.0.0.1:{port}", 18, stop_requested=lambda: True))
    Udp("127.0.0.1", port, listening=True).close()


def test_a_log_is_played_at_the_pace_of_its_times(log):
    waits = []
    blocks = list(played(log, now=lambda: 100.0, wait_until=waits.append))
    assert joined(blocks).digest == log.digest
    ends_s = np.array([block.t_s[-1] for block in blocks])
    assert np.allclose(waits, 100.0 + ends_s - log.t_s[0], rtol=0, atol=1e-12)  # rounding of 100 s
    assert list(played(log, stop_requested=lambda: True, wait_until=waits.append)) == []


def test_the_shadow_beside_a_link_is_that_of_the_log(log, model):
    commanded = Log(log.t_s, log.current_A, log.angle_rad)
    running = RunningShadow(Shadow(model))
    assert running.telemetry() is None
    for t_s, current_A, angle_rad in zip(log.t_s, log.current_A, log.angle_rad, strict=True):
        running.advance(t_s, current_A, angle_rad)
    assert np.array_equal(running.telemetry().values, shadow(commanded, model).telemetry.values)


@pytest.mark.parametrize(
    ("source", "expected"),
    [("-", True), ("udp://:5005", True), ("serial:/dev/ttyACM0@115200", True), ("run.parquet", False)],
)
def test_addresses_are_told_from_files(source, expected):
    assert is_address(source) is expected
