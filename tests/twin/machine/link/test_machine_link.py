"""Link to a machine: arming, ramp, every limit, missing and late frames, with a clock of the test."""

import numpy as np
import pytest

from spheretwin.control.supervision.watchdog import Reason
from spheretwin.machine.link.frame_format import Flags
from spheretwin.machine.link.limits import LinkSettings, MachineLimits
from spheretwin.machine.link.machine_link import Link
from spheretwin.machine.link.real_time import QUANTILES
from spheretwin.models.base.errors import SpheretwinError
from tests.twin.machine.link import lines
from tests.twin.machine.link.lines import COMMAND, GROUPS, LIMITS, PERIOD_s, Script, measurement

ONES = np.ones(GROUPS)


class Machine:
    """A machine that answers each command after 0.2 ms, with values that the test sets."""

    def __init__(self):
        self.script, self.values, self.sequence, self.silent = Script(self.answer), {}, 0, False
        self.delay_s, self.commands = 2e-4, []

    def answer(self, content):
        command = COMMAND.decode(content)
        self.commands.append(command)
        if not self.silent:
            self.sequence += 1
            frame = measurement(self.sequence, command["sequence"], **self.values)
            self.script.plan(frame, self.delay_s)


@pytest.fixture
def machine():
    return Machine()


def linked(machine, *, limits=LIMITS, shadow=None, report=None, stop_requested=lambda: False, **settings):
    given = {"armed": True, "ramp_s": 0.0, "timeout_s": 3.5e-3, **settings}
    channel = lines.controller_channel(machine.script, report=report)
    link = Link(
        channel, "test", LinkSettings(**given), limits, lines.heat(limits), PERIOD_s,
        shadow=shadow, stop_requested=stop_requested, now=machine.script.now,
    )  # fmt: skip
    link.connect()
    machine.commands.clear()
    return link


@pytest.fixture
def link(machine):
    return linked(machine)


@pytest.fixture
def locked(machine):
    return linked(machine, lockstep=True, timeout_s=1.0)


def reasons(link, ticks, first=0, current=ONES):
    return [link.advance(PERIOD_s * tick, current)[1] for tick in range(first, first + ticks)]


MODES = pytest.mark.parametrize("lockstep", [False, True], ids=["clock", "lockstep"])


@MODES
def test_a_healthy_machine_is_driven(machine, lockstep):
    machine.values = {"angle": (0.1, 0.2, 0.3), "current": np.full(GROUPS, 0.5)}
    link = linked(machine, lockstep=lockstep)
    answer, reason = link.advance(0.0, ONES)
    assert reason == Reason.NONE
    assert answer.angle_rad.tolist() == [0.1, 0.2, 0.3]
    assert np.all(answer.current_A == 0.5)
    assert (answer.rate_rad_s, answer.temperature_degC) == (None, None)
    assert reasons(link, 9, first=1) == [Reason.NONE] * 9
    assert len(machine.commands) == 10
    assert all(command["flags"] == Flags.ARMED for command in machine.commands)
    figures = link.figures()
    assert figures["latency"] == {name: pytest.approx(0.2) for name in QUANTILES}
    if not lockstep:
        assert machine.script.t_s == pytest.approx(10 * PERIOD_s + 2e-4)  # after the first measurement
        assert figures["jitter"]["max_ms"] == pytest.approx(0.0, abs=1e-9)


def test_without_arming_nothing_rises_and_frames_are_shown(machine):
    shown = []
    link = linked(machine, armed=False, report=shown.append)
    assert link.authority == 0.0
    reasons(link, 20)
    assert link.authority == 0.0
    assert all(command["flags"] == 0 for command in machine.commands)
    assert sum(line.startswith("sent 166 bytes a5 c3") for line in shown) == 3
    assert sum(line.startswith("received 226 bytes a5 5a") for line in shown) == 3
    assert "angle [0 0 0]" in shown[1]


def test_the_share_of_the_commands_rises_from_0(machine):
    link = linked(machine, ramp_s=4 * PERIOD_s)
    shares = [link.authority]
    for tick in range(6):
        link.advance(PERIOD_s * tick, ONES)
        shares.append(link.authority)
    assert shares == pytest.approx([0.0, 0.25, 0.5, 0.75, 1.0, 1.0, 1.0])


LIMIT_CASES = [
    ({"angle": (0.31, 0.0, 0.0)}, {"tilt_rad": 0.3}, Reason.EDGE),
    ({"angle": (0.0, -0.31, 0.0)}, {"tilt_rad": 0.3}, Reason.EDGE),
    ({"current": np.array([5.1] + [0.0] * 17)}, {"current_A": 4.0}, Reason.CURRENT),
    ({"current": np.array([0.0] * 17 + [-5.1])}, {"current_A": 4.0}, Reason.CURRENT),
    ({"temperature": 80.1}, {"temperature_degC": 80.0}, Reason.TEMPERATURE),
    ({"angle": (np.nan, 0.0, 0.0)}, {}, Reason.MEASUREMENT),
    ({"angle": (0.0, np.inf, 0.0)}, {}, Reason.MEASUREMENT),
    ({"current": np.array([np.nan] + [0.0] * 17)}, {}, Reason.MEASUREMENT),
    ({"temperature": np.inf}, {}, Reason.MEASUREMENT),
    ({"rate": (np.inf, 0.0, 0.0)}, {}, Reason.MEASUREMENT),
    ({"flags": Flags.FAILSAFE}, {}, Reason.MACHINE),
    ({"angle": (0.29, -0.29, 3.0)}, {"tilt_rad": 0.3}, Reason.NONE),  # γ may turn
    ({"current": np.full(GROUPS, 4.9)}, {"current_A": 4.0}, Reason.NONE),
    ({"temperature": 79.9}, {"temperature_degC": 80.0}, Reason.NONE),
]


@MODES
@pytest.mark.parametrize(("values", "limits", "reason"), LIMIT_CASES)
def test_each_limit_removes_the_currents_beyond_it(machine, values, limits, reason, lockstep):
    link = linked(machine, limits=MachineLimits(**{"current_A": 8.0, **limits}), lockstep=lockstep)
    assert reasons(link, 2) == [Reason.NONE] * 2
    machine.values = values
    answer, result = link.advance(2 * PERIOD_s, ONES)
    assert result == reason
    assert np.all(np.isfinite(answer.angle_rad))
    machine.values = {}
    assert reasons(link, 2, first=3) == [reason] * 2  # it does not come back
    armed = 1 if reason == Reason.NONE else 0
    assert [command["flags"] for command in machine.commands] == [1, 1, 1, armed, armed]


def test_a_machine_without_a_thermometer_has_an_estimate(machine):
    # 6 A in 1.3 ohm heat 60 J/K by 46.8 W: 20 K above the ambient with a loss of 1 W per 4 K are
    # reached after t = -4·60 ln(1 - 20/(4·46.8)) s.
    limits = MachineLimits(current_A=8.0, temperature_degC=40.0)
    coil = lines.heat(limits)
    hot = next(tick for tick in range(30_000) if coil.advance(6 * ONES) > 40.0)
    exact_s = -240.0 * np.log(1 - 20.0 / (4 * 1.3 * 6.0**2))
    assert hot * PERIOD_s == pytest.approx(exact_s, abs=2 * PERIOD_s)  # the first tick beyond it
    link = linked(machine, limits=limits)
    link._heat = coil
    assert reasons(link, 1, current=6 * ONES) == [Reason.TEMPERATURE]


def test_a_missing_measurement_removes_the_currents_after_the_timeout(machine, link):
    reasons(link, 2)
    machine.silent = True
    # The last measurement arrived 0.8 ms before the end of its period: 3.5 ms later is within the third one.
    assert reasons(link, 4, first=2) == [Reason.NONE, Reason.NONE, Reason.STALE, Reason.STALE]
    assert link.late_ticks == {3, 4, 5, 6}
    assert link.figures()["frames"]["late"] == 4


def test_a_delay_that_grows_slowly_removes_the_currents(machine, link):
    """Each tick has a new measurement, but of an ever earlier time."""
    results = []
    for tick in range(60):
        machine.delay_s = 2e-4 + 1e-4 * tick
        results += reasons(link, 1, first=tick)
    # The answer is late by 3.5 ms, the timeout, after the period that every command has.
    assert 36 <= results.index(Reason.STALE) <= 46
    assert len(link.late_ticks) < 10


def test_a_machine_that_hears_nothing_is_given_up(machine, link):
    reasons(link, 2)
    machine.silent = True

    def stream(content):
        machine.sequence += 1
        machine.script.plan(measurement(machine.sequence, echo=link._sequence - 10), 2e-4)

    machine.script.answer = stream
    assert reasons(link, 6, first=2) == [Reason.NONE] * 3 + [Reason.STALE] * 3
    assert not link.late_ticks


def test_in_lockstep_a_lost_frame_is_requested_again(machine, locked):
    machine.silent = True
    heard = []

    def lose_two(content):
        heard.append(content)
        machine.silent = len(heard) < 3
        machine.answer(content)

    machine.script.answer = lose_two
    assert reasons(locked, 2) == [Reason.NONE] * 2
    assert len(heard) == 4
    assert heard[0] == heard[1] == heard[2] != heard[3]


def test_in_lockstep_a_silent_machine_is_given_up_at_the_timeout(machine, locked):
    machine.silent = True
    start_s = machine.script.t_s
    assert reasons(locked, 1) == [Reason.STALE]
    assert machine.script.t_s - start_s == pytest.approx(1.0)
    assert reasons(locked, 50, first=1) == [Reason.STALE] * 50
    assert machine.script.t_s - start_s == pytest.approx(1.0)  # nothing is waited for any more
    assert machine.commands[-1]["flags"] == 0


def test_in_lockstep_an_older_answer_is_no_reply(machine, locked):
    first = locked.advance(0.0, ONES)[0]
    machine.silent = True
    machine.script.plan(measurement(1000, echo=1, angle=(1.0, 0.0, 0.0)))
    answer, reason = locked.advance(PERIOD_s, ONES)
    assert reason == Reason.STALE
    assert np.array_equal(answer.angle_rad, first.angle_rad)


def scrambled(frames):
    """Frames with a lost, a duplicated, a reordered, a corrupt and a hostile one."""
    one, two, three, four, _, six = frames
    corrupt = bytearray(six)
    corrupt[50] ^= 4
    return [one, one, three, two, four, bytes(corrupt), b"\xa5\x5a" * 2000, six]


def test_a_bad_line_changes_the_counts_and_not_the_measurement(machine):
    link = linked(machine, armed=False)
    machine.silent = True
    frames = [measurement(10 + i, angle=(i / 10, 0.0, 0.0)) for i in range(1, 7)]
    angles = []
    for tick, content in enumerate(scrambled(frames)):
        machine.script.plan(content, 5e-4)
        angles.append(round(10 * link.advance(PERIOD_s * tick, ONES)[0].angle_rad[0]))
    assert angles == [1, 1, 3, 3, 4, 4, 4, 6]
    # Lost: 9 before the first one (the first measurement was number 1), and number 5.
    assert link.figures()["frames"] == {
        "accepted": 5, "lost": 10, "duplicated": 1, "reordered": 1, "corrupt": 2, "refused": 0, "late": 4,
        "foreign": 0,
    }  # fmt: skip


def test_frames_from_before_the_start_are_not_used(machine, link):
    machine.delay_s = 0.9e-3
    for place in range(200):
        machine.script.plan(measurement(100 + place, angle=(place / 1000, 0.0, 0.0)))
    machine.sequence = 1000
    machine.values = {"angle": (0.3, 0.0, 0.0)}
    assert link.advance(0.0, ONES)[0].angle_rad[0] == 0.3
    assert not machine.script.planned  # nothing waits to be used later


@pytest.mark.parametrize("by", ["the machine ended the run", "a stop was requested"])
def test_the_end_of_the_machine_and_a_stop_end_the_run(machine, by):
    stops = []
    link = linked(machine, stop_requested=lambda: bool(stops))
    if by == "the machine ended the run":
        machine.values = {"flags": Flags.END}
    assert link.advance(0.0, ONES) is not None
    if by == "a stop was requested":
        stops.append(1)
    assert link.advance(PERIOD_s, ONES) is None
    assert link.ending == by


def test_the_release_is_without_currents_and_repeated(machine, link):
    link.advance(0.0, ONES)
    machine.commands.clear()
    link.release()
    assert [command["flags"] for command in machine.commands] == [Flags.END] * 3
    assert not any(np.any(command["current"]) for command in machine.commands)


def test_a_pause_of_the_system_is_not_made_up_for(machine, link):
    reasons(link, 2)
    machine.script.t_s += 0.1
    link.advance(2 * PERIOD_s, ONES)
    before_s = machine.script.t_s
    reasons(link, 3, first=3)
    assert machine.script.t_s - before_s == pytest.approx(3 * PERIOD_s)
    assert link.figures()["jitter"]["max_ms"] == pytest.approx(99.0)


def test_the_checks_of_the_motion_know_of_a_pause_and_remove_the_currents(machine, link):
    pauses = []

    class Checks:
        def advance(self, t_s, current_A, angle_rad, *, after_pause):
            pauses.append(after_pause)
            return Reason.MODEL if len(pauses) == 5 else Reason.NONE

    link._plausibility = Checks()
    reasons(link, 2)
    machine.script.t_s += 0.002
    assert reasons(link, 4, first=2) == [Reason.NONE] * 2 + [Reason.MODEL] * 2
    assert pauses == [False, False, False, True, False]
    assert machine.commands[-1]["flags"] == 0  # no currents from then on


def test_the_shadow_receives_what_was_sent_and_measured(machine):
    received = []

    class Shadow:
        def advance(self, t_s, current_A, angle_rad):
            received.append((t_s, current_A.copy(), angle_rad.copy()))

    link = linked(machine, shadow=Shadow())
    machine.values = {"angle": (0.1, 0.2, 0.3)}
    link.advance(0.0, ONES)
    machine.silent = True
    link.advance(PERIOD_s, 2 * ONES)
    link.advance(2 * PERIOD_s, 3 * ONES)
    times, currents, angles = zip(*received, strict=True)
    assert times == (0.0, PERIOD_s, 2 * PERIOD_s)
    assert [current[0] for current in currents] == [1.0, 2.0, 3.0]
    assert angles[0].tolist() == [0.0, 0.0, 0.0]
    assert angles[1].tolist() == [0.1, 0.2, 0.3]
    assert np.all(np.isnan(angles[2]))  # nothing new had arrived


@pytest.mark.parametrize(
    ("answer", "message"), [(None, "received 0 texts"), (b"hello", "received .* texts that are no frame")]
)
def test_without_a_first_measurement_nothing_is_driven(answer, message):
    script = Script(lambda content: script.plan(answer) if answer else None)
    settings = LinkSettings(armed=True, connect_s=1.0)
    channel, coils = lines.controller_channel(script), lines.heat()
    link = Link(channel, "x", settings, LIMITS, coils, PERIOD_s, now=script.now)
    with pytest.raises(SpheretwinError, match=f"expected a measurement within 1 s, {message}"):
        link.connect()
    assert all(COMMAND.decode(content)["flags"] == Flags.HELLO for content in script.sent)


def test_a_first_measurement_that_is_no_number_is_refused(machine):
    machine.values = {"angle": (np.nan, 0.0, 0.0)}
    with pytest.raises(SpheretwinError, match="expected finite numbers"):
        linked(machine)


def test_sequence_numbers_go_on_past_the_largest(machine):
    link = linked(machine, lockstep=True)
    link.channel.modulus, link._sequence = 2**32, 2**32 - 2
    assert reasons(link, 4) == [Reason.NONE] * 4
    assert [command["sequence"] for command in machine.commands] == [2**32 - 1, 0, 1, 2]
