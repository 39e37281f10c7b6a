"""Sessions of two peers: requests, replayed frames, another controller, authentication."""

import numpy as np
import pytest

from spheretwin.loop.external import Measurement
from spheretwin.machine.link import frame_format
from spheretwin.machine.link.admission import (
    REQUESTS,
    Admission,
    ControllerAdmission,
    MachineAdmission,
    SILENCE_s,
    read_key,
)
from spheretwin.machine.link.channel import FrameChannel
from spheretwin.machine.link.codec import HMAC_BYTES, Codec
from spheretwin.machine.link.frame_format import Flags
from spheretwin.machine.link.limits import LinkSettings
from spheretwin.machine.link.machine_link import Link
from spheretwin.machine.link.machine_server import MachineServer
from spheretwin.models.base.errors import InputError
from tests.twin.machine.link import lines
from tests.twin.machine.link.lines import GROUPS, LIMITS, OWN, PERIOD_s, Script

AT_REST = Measurement(np.zeros(3), None, np.zeros(GROUPS))
KEY = b"sixteen bytes or more"
REFUSED, IN_ORDER, FIRST, REQUEST = (
    Admission.REFUSED, Admission.IN_ORDER, Admission.FIRST, Admission.REQUEST
)  # fmt: skip


class Machine:
    """Admission of a machine with a clock of the test."""

    def __init__(self, *, authenticated=False):
        self.t_s = 0.0
        self.admission = MachineAdmission(lambda: self.t_s, authenticated=authenticated)

    def hello(self, key):
        place = self.admission({"flags": Flags.HELLO, "session": key})
        return place, self.admission.answer_to({"session": key})

    def command(self, session, after_s=1e-3):
        self.t_s += after_s
        return self.admission({"flags": Flags.ARMED, "session": session})


def test_a_session_begins_with_the_first_command_after_its_hello():
    machine = Machine()
    place, offer = machine.hello(77)
    assert place == REQUEST
    assert offer not in (0, 77)
    assert machine.hello(77) == (REQUEST, offer)  # the answer was lost
    assert [machine.command(offer) for _ in range(2)] == [FIRST, IN_ORDER]
    assert machine.admission.session == offer
    assert machine.hello(77) == (REQUEST, offer)


def test_a_replayed_hello_admits_no_frame_of_an_old_session():
    machine = Machine()
    _, old = machine.hello(77)
    machine.command(old)
    machine.t_s += 2 * SILENCE_s
    _, new = machine.hello(88)
    assert machine.command(new) == FIRST
    machine.t_s += 2 * SILENCE_s  # the controller pauses, and somebody sends what the first one sent
    place, offer = machine.hello(77)
    assert place == REQUEST
    assert offer != old
    assert machine.command(old) == REFUSED
    assert machine.command(new) == IN_ORDER


def test_another_process_of_the_machine_admits_no_old_frame():
    before, now = Machine(), Machine()
    _, old = before.hello(77)
    assert now.hello(77)[1] != old
    assert now.command(old) == REFUSED


def test_another_controller_waits_for_a_silence():
    machine = Machine()
    _, first = machine.hello(77)
    machine.command(first)
    assert machine.hello(88) == (REFUSED, 0)
    assert machine.command(first) == IN_ORDER
    machine.t_s += 1.01 * SILENCE_s
    _, second = machine.hello(88)
    assert machine.command(second) == FIRST
    assert machine.command(first, after_s=2 * SILENCE_s) == REFUSED


def test_requests_of_others_take_no_session_away():
    machine = Machine()
    _, offer = machine.hello(77)
    for key in range(1000, 1000 + REQUESTS - 1):
        machine.hello(key)
    assert machine.command(offer) == FIRST


def test_controllers_that_take_no_part_restart_their_numbers_after_a_silence():
    machine = Machine()
    assert machine.command(0) == IN_ORDER
    assert machine.hello(0)[0] == REFUSED  # while commands arrive
    machine.t_s += 2 * SILENCE_s
    assert machine.hello(0) == (REQUEST, 0)
    assert [machine.command(0) for _ in range(2)] == [FIRST, IN_ORDER]
    assert machine.command(0, after_s=2 * SILENCE_s) == IN_ORDER  # no HELLO, no restart


def test_with_a_key_every_frame_needs_a_session():
    machine = Machine(authenticated=True)
    assert machine.hello(0)[0] == REFUSED
    assert machine.command(0) == REFUSED
    assert machine.command(machine.hello(77)[1]) == FIRST


def test_a_controller_takes_the_session_of_the_answer_to_its_request():
    admission = ControllerAdmission()
    admission.request(500)
    assert admission({"session": 9, "echo": 499}) == REFUSED  # an old answer
    assert admission({"session": 9, "echo": 500}) == IN_ORDER
    assert admission({"session": 8, "echo": 500}) == REFUSED
    assert admission({"session": 9, "echo": 1}) == IN_ORDER
    assert ControllerAdmission()({"echo": 1}) == IN_ORDER  # frames without sessions


def peers(own_key=b"", their_key=b""):
    """A controller and a machine, and the frames that the controller has sent."""
    sent = []
    ours = Script(lambda content: (sent.append(content), theirs.plan(content)))
    theirs = Script(ours.plan)
    channel = FrameChannel(theirs, OWN.measurement, OWN.command, GROUPS, key=their_key)
    server = MachineServer(
        channel, "test", GROUPS, PERIOD_s, authenticated=bool(their_key), idle_s=0.5, now=theirs.now
    )
    link = Link(
        FrameChannel(ours, OWN.command, OWN.measurement, GROUPS, key=own_key),
        "test", LinkSettings(armed=True, ramp_s=0.0), LIMITS, lines.heat(), PERIOD_s, now=ours.now,
    )  # fmt: skip
    return link, server, sent


@pytest.mark.parametrize("key", [b"", KEY], ids=["open", "authenticated"])
def test_both_ends_agree_on_a_session(key):
    link, server, sent = peers(key, key)
    link._send(Flags.HELLO, 0.0, None)
    assert server.command(0.0, AT_REST) is None  # it has answered, and waited for a command
    server.ending = ""
    assert link.connect().angle_rad.tolist() == [0.0, 0.0, 0.0]
    link._send(Flags.ARMED, 0.0, np.full(GROUPS, 2.0))
    assert server.command(0.0, AT_REST)[0] == 2.0
    assert server._admission.session == link._admission.session != 0
    assert server.figures()["frames"]["refused"] == 0
    # Sent again by anybody, the same frames change nothing: the command is not applied again.
    server.channel.transport._wait = None
    for content in sent:
        server.channel.transport.plan(content)
    assert server.command(PERIOD_s, AT_REST) is None
    assert server.figures()["frames"]["duplicated"] == 1


@pytest.mark.parametrize("keys", [(b"", KEY), (KEY, b""), (KEY, KEY[:-1] + b"!")])
def test_frames_with_another_key_are_no_frames(keys):
    link, server, _ = peers(*keys)
    link._send(Flags.HELLO, 0.0, None)
    assert server.command(0.0, AT_REST) is None
    assert server.figures()["frames"]["accepted"] == 0
    assert server.figures()["frames"]["corrupt"] >= 1


@pytest.mark.parametrize("name", ["spheretwin", "spheretwin_json"])
def test_one_changed_bit_breaks_the_authentication(name):
    frame = frame_format.load(name).command
    codec, plain = Codec(frame, GROUPS, KEY), Codec(frame, GROUPS)
    content = codec.encode({"sequence": 1, "session": 2, "flags": 1, "time": 0.5, "current": np.ones(GROUPS)})
    assert codec.decode(content)["session"] == 2
    assert plain.decode(content) is None
    for place in range(len(content) - 2):
        changed = bytearray(content)
        changed[place] ^= 1
        assert codec.decode(bytes(changed)) is None
    if name == "spheretwin":
        assert codec.size == plain.size + HMAC_BYTES - 2


def test_frames_without_a_session_are_not_authenticated():
    frames = frame_format.load("ventusff_pose").measurement
    with pytest.raises(InputError, match="expected frames with the field session"):
        FrameChannel(Script(), frames, frames, GROUPS, key=KEY)


def test_a_key_is_read_from_a_file(tmp_path):
    path = tmp_path / "key"
    path.write_bytes(KEY + b"\n")
    assert read_key(path) == KEY
    assert read_key(None) == b""
    path.write_bytes(KEY[:15])
    with pytest.raises(InputError, match=r"at least 16 bytes in .*, received 15"):
        read_key(path)
    with pytest.raises(InputError, match="expected a file with a key"):
        read_key(tmp_path / "none")
