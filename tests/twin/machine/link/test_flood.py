"""A program in C sends frames of an earlier session, as fast as it can, while another one drives."""

import contextlib
import json
import subprocess
import sys
import time

import numpy as np
import pytest

from spheretwin.machine.link import frame_format
from spheretwin.machine.link.channel import FrameChannel
from spheretwin.machine.link.frame_format import Flags
from spheretwin.machine.link.transports import open_transport
from tests.independent.laboratory import CURVE, ROOT, built
from tests.requirements import needs_c_compiler, needs_posix
from tests.waiting import UNLIMITED_S

pytestmark = [needs_c_compiler, needs_posix]

SOURCES = (ROOT / "twin/machine/link/examples/pid_controller.c", ROOT / "tests/twin/machine/link/flood.c")
DURATION_s = "1"
OWN = frame_format.load("spheretwin")


@pytest.fixture(scope="module")
def programs(tmp_path_factory):
    folder = tmp_path_factory.mktemp("programs")
    return [built(source, folder) for source in SOURCES]


@contextlib.contextmanager
def machine(folder):
    """Process of a machine in lockstep, and its port."""
    command = [sys.executable, "-m", "spheretwin", "machine", "sinusoid", "--listen", "udp://:0", "--json"]
    with subprocess.Popen(
        [*command, "--duration", DURATION_s],
        stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, cwd=folder,
    ) as process:  # fmt: skip
        try:
            yield process, process.stderr.readline().strip().rpartition(":")[2]
        finally:
            process.kill()


def earlier_frames(folder):
    """File with the HELLO and two commands of 2 A that a machine has applied in another process."""
    sent = []
    with machine(folder) as (_, port), contextlib.closing(open_transport(f"udp://:{port}")) as transport:
        channel = FrameChannel(transport, OWN.command, OWN.measurement, 18)
        session = 4711
        for sequence, flags in enumerate((Flags.HELLO, Flags.ARMED, Flags.ARMED), 1):
            values = {"sequence": sequence, "flags": flags, "session": session, "current": np.full(18, 2.0)}
            sent.append(channel.send(values))
            while not (answers := channel.receive(UNLIMITED_S)):
                pass
            session = int(answers[-1]["session"])
    assert answers[-1]["flags"] == Flags.ARMED  # the machine has applied them
    path = folder / "frames.bin"
    path.write_bytes(b"".join(sent))
    return path, len(sent[0])


def drive(programs, folder, frames=None):
    """Output of the controller, figures of the machine, seconds, and datagrams a second of the flood."""
    controller, flood = programs
    with machine(folder) as (process, port):
        sender, rate = None, 0.0
        if frames:
            path, size = frames
            sender = subprocess.Popen([flood, port, path, str(size)], stdout=subprocess.PIPE, text=True)
            assert sender.stdout.readline() == "begins\n"
        begun = time.monotonic()
        done = subprocess.run(
            [controller, "127.0.0.1", port, CURVE, DURATION_s], capture_output=True, text=True
        )
        wall_s = time.monotonic() - begun
        if sender:
            sender.terminate()
            number, seconds = sender.communicate()[0].split()
            rate = int(number) / float(seconds)
        out, err = process.communicate()
        assert (done.returncode, process.returncode) == (0, 0), done.stderr + err
    return done.stdout, json.loads(out), wall_s, rate


@pytest.mark.release("three processes; test_admission has the replayed frames")
def test_frames_of_an_earlier_session_change_nothing_at_any_rate(programs, tmp_path):
    """Lockstep has no clock: each digit of the run stays the same."""
    frames = earlier_frames(tmp_path)
    quiet, flooded = drive(programs, tmp_path), drive(programs, tmp_path, frames)
    assert flooded[0] == quiet[0]
    for name in ("max_abs_error_rad", "rms_error_rad", "max_abs_current_A", "status"):
        assert flooded[1][name] == quiet[1][name]


@pytest.mark.release("a speed, of a computer that does nothing else")
def test_a_flood_leaves_half_of_the_rate(programs, tmp_path):
    frames = earlier_frames(tmp_path)
    quiet_s, flooded_s = (
        min(drive(programs, tmp_path, sender)[2] for _ in range(3)) for sender in (None, frames)
    )
    assert flooded_s < 2 * quiet_s
