"""Test of a link: round trips, loss and delays with a clock of the test, and the verdict."""

import pytest

from spheretwin.cli.link import lines_of
from spheretwin.machine.link import frame_format
from spheretwin.machine.link.channel import FrameChannel
from spheretwin.machine.link.frame_format import Flags
from spheretwin.machine.link.round_trips import EDGES_ms, measure_link
from spheretwin.models.base.errors import InputError, SpheretwinError
from tests.twin.machine.link.lines import COMMAND, GROUPS, Script, controller_channel, measurement


class Machine:
    """A machine whose answer to request number n comes after `delays_s[n % len]`; None loses it."""

    def __init__(self, *delays_s):
        self.delays_s, self.script, self.commands = delays_s, Script(self.answer), []

    def answer(self, content):
        command = COMMAND.decode(content)
        delay_s = self.delays_s[len(self.commands) % len(self.delays_s)]
        self.commands.append(command)
        if delay_s is not None:
            self.script.plan(measurement(7, echo=command["sequence"]), delay_s)

    def measure(self, *rates_Hz, seconds=0.1):
        return measure_link(controller_channel(self.script), rates_Hz, seconds, now=self.script.now)


def test_round_trips_are_those_of_the_machine():
    machine = Machine(3e-4, 3e-4, 3e-4, 9e-4)
    (result,) = machine.measure(1000)
    assert (result.sent, result.loss, result.reasons) == (100, 0.0, ())
    assert result.round_trip["p50_ms"] == pytest.approx(0.3)
    assert result.round_trip["max_ms"] == pytest.approx(0.9)
    assert result.jitter["max_ms"] == pytest.approx(0.0, abs=1e-9)
    counts = {EDGES_ms[place]: count for place, count in enumerate(result.histogram) if count}
    assert counts == {0.2: 75, 0.5: 25}
    # Each request moves nothing: no currents, and the machine does not advance.
    assert all(
        command["flags"] == Flags.HELLO and not any(command["current"]) for command in machine.commands
    )
    assert len({command["session"] for command in machine.commands}) == 1


@pytest.mark.parametrize(
    ("delays_s", "verdicts"),
    [
        ((1e-4,), (True, True, True)),
        ((3e-4,), (True, True, False)),
        ((7e-4,), (True, False, False)),
        ((1e-4,) * 5 + (1.2e-3,), (False, False, False)),
        ((1e-4,) * 99 + (None,), (False, False, False)),
    ],
)
def test_the_verdict_depends_on_the_rate(delays_s, verdicts):
    results = Machine(*delays_s).measure(1000, 2000, 5000)
    assert tuple(result.suffices for result in results) == verdicts


def test_answers_that_are_late_or_lost_are_named():
    (result,) = Machine(1.5e-3, None).measure(1000)
    assert result.loss == 0.5
    assert result.reasons == (
        "50 % are lost", "99.9 % of the round trips are below 1.5 ms, expected 1 ms"
    )  # fmt: skip
    lines = lines_of(result)
    assert lines[0] == f"1000 Hz: does not suffice: {'; '.join(result.reasons)}"
    assert lines[1] == "  100 requests, 50 % lost"
    assert lines[-1].split() == ["1", "to", "2", "ms", "50", "█" * 40]


def test_delays_of_this_computer_count():
    machine = Machine(1e-4)
    channel, pause = controller_channel(machine.script), iter((0.0, 6e-4) * 1000)

    def now():
        return machine.script.t_s

    def stop_requested():  # between two requests the computer pauses
        machine.script.t_s += next(pause)
        return False

    (result,) = measure_link(channel, (1000,), 0.1, stop_requested=stop_requested, now=now)
    assert result.jitter["p99_ms"] == pytest.approx(0.6)
    assert result.reasons == ("99 % of the delays of this computer are below 0.6 ms, expected 0.5 ms",)


def test_a_machine_that_does_not_answer_is_a_failure():
    with pytest.raises(SpheretwinError, match="received none to 100 requests, and 0 texts"):
        Machine(None).measure(1000)


def test_a_stop_ends_the_test():
    machine = Machine(1e-4)
    stops = iter([False] * 11 + [True] * 10)
    results = measure_link(
        controller_channel(machine.script), (1000, 2000), 1.0,
        stop_requested=lambda: next(stops), now=machine.script.now,
    )  # fmt: skip
    assert [result.sent for result in results] == [10]


def test_frames_without_echo_are_refused():
    pose = frame_format.load("ventusff_pose").measurement
    with pytest.raises(InputError, match="expected frames with the fields flags and echo"):
        measure_link(FrameChannel(Script(), pose, pose, GROUPS))
