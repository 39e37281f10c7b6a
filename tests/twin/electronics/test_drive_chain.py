"""The whole way out against a slow copy of it: plain NumPy, roots by bisection, integrals by quadrature."""

import numpy as np
import pytest
from scipy.optimize import brentq

from spheretwin.control.law import LARGEST
from spheretwin.electronics.amplifier import AmplifierSection, amplifier, drive_coils, reset_sums, zero_flow
from spheretwin.electronics.coil import CoilSection, advance_temperature, back_emf, group_coils
from spheretwin.electronics.converters import DacSection, convert, dac
from spheretwin.electronics.delay import DelaySection, delay, due, latch
from spheretwin.scenario.hardware import HARDWARE, PROTOTYPE_DRIVE

STEP_S, SUBSTEPS, GROUPS, LIMIT_A = 5e-4, 2, 18, 8.0
PERIOD_S = STEP_S * SUBSTEPS
NODES, WEIGHTS = np.polynomial.legendre.leggauss(40)
NODES, WEIGHTS = (NODES + 1) / 2, WEIGHTS / 2


def section(kind, **changed):
    """A stage's section with the prototype's figures."""
    fields = {name.removeprefix("drive."): value for name, value in PROTOTYPE_DRIVE.items()}
    return kind(**{name: value for name, value in fields.items() if name in kind.model_fields} | changed)


class Chain:
    """The stages, wired as a plant would."""

    def __init__(self, seed=11, delay_s=1e-3):
        self.delay = delay(section(DelaySection, delay_s=delay_s), STEP_S, SUBSTEPS, GROUPS)
        self.coil = group_coils(section(CoilSection), 1.0, 1.0, PERIOD_S, GROUPS)
        stage = section(AmplifierSection)
        self.dac = dac(section(DacSection), stage.transconductance_A_V, GROUPS, seed)
        self.amplifier = amplifier(stage, LIMIT_A, STEP_S, GROUPS, seed)
        self.flow, self.current = zero_flow(GROUPS), np.zeros(GROUPS)

    def tick(self, command, G, gain, rates):
        """One control period; the mean currents of its steps."""
        setpoint, emf, means = np.empty(GROUPS), np.empty(GROUPS), []
        latch(self.delay, command)
        reset_sums(self.flow)
        for substep in range(SUBSTEPS):
            due(self.delay, substep, setpoint)
            convert(self.dac, setpoint, setpoint)
            back_emf(G, gain, rates[substep], emf)
            drive_coils(self.amplifier, self.coil, setpoint, emf, self.current, self.flow)
            means.append(self.flow.mean_current_A.copy())
        advance_temperature(self.coil, self.flow.copper_J)
        return np.array(means)


class SlowChain:
    """The same by the definitions, one group at a time, with what was drawn handed over."""

    def __init__(self, chain, delay_s=1e-3):
        self.offset_V, self.gain, self.inl = chain.dac.offset_V, chain.dac.gain, chain.dac.inl_lsb
        self.offset_A = chain.amplifier.offset_A
        self.history = [np.zeros(GROUPS)] * round(delay_s / STEP_S)
        self.current, self.temperature = np.zeros(GROUPS), np.full(GROUPS, 20.0)

    def tick(self, command, G, gain, rates):
        means, self.copper, self.work, self.limited = [], *np.zeros((3, GROUPS))
        self.history += [command] * SUBSTEPS
        R = 1.3 * (1 + 0.0039 * (self.temperature - 20))
        for substep in range(SUBSTEPS):
            setpoint = self.converted(self.history.pop(0))
            emf = gain * (rates[substep] @ G)
            target = np.clip(setpoint + self.offset_A, -LIMIT_A, LIMIT_A)
            steps = [self.stepped(j, R[j], target[j], emf[j]) for j in range(GROUPS)]
            self.current, mean, square, work, limited = np.array(steps).T
            means.append(mean)
            self.copper, self.work, self.limited = (
                self.copper + R * square,
                self.work + work,
                self.limited + limited,
            )
        last = 20 + 4 * self.copper / PERIOD_S
        self.temperature = last + (self.temperature - last) * np.exp(-PERIOD_S / 240)
        return np.array(means)

    def converted(self, command):
        codes = np.clip(np.round(command / 0.8 * 2**16 / 20), -(2**15), 2**15 - 1)
        p = np.arccos((codes + 2**15) / (2**16 - 1) * 2 - 1)
        inl = np.sin(p) * sum(self.inl[:, n] * np.sin((n + 1) * p) for n in range(self.inl.shape[1]))
        return 0.8 * (20 / 2**16 * (codes * self.gain + inl) + self.offset_V)

    def stepped(self, group, R, target, emf):
        """Phases in the order they come, until the step is over."""
        L, w, up, down = 0.9e-3, 2 * np.pi * 2000, 24 - 4.8, -24 + 4.6
        i, left, sums = self.current[group], STEP_S, np.zeros(4)
        previous = None
        while left > 0:

            def voltage_at(current):
                return R * current + L * w * (target - current) + emf

            v = voltage_at(i)
            # Where a phase has just ended the voltage is at a limit to rounding; which side is known.
            mode = previous if previous else "up" if v > up else "down" if v < down else "follow"
            rest = {"up": (up - emf) / R, "down": (down - emf) / R, "follow": target}[mode]
            rate = w if mode == "follow" else R / L

            def current(t, i=i, rest=rest, rate=rate):
                return rest + (i - rest) * np.exp(-rate * t)

            ends = {"follow": [up, down], "up": [up], "down": [down]}[mode]
            over, after = left, None
            for end in ends:
                begin, finish = v - end, voltage_at(current(left)) - end
                if begin * finish < 0 and abs(begin) > 1e-9:
                    root = brentq(
                        lambda t, end=end: voltage_at(current(t)) - end, 0, left, xtol=1e-19, rtol=1e-15
                    )
                    if root < over:
                        over = root
                        after = "follow" if mode != "follow" else "up" if end == up else "down"
            t = over * NODES
            along = current(t)
            volts = {"up": up, "down": down, "follow": voltage_at(along)}[mode]
            limited = over * (mode != "follow")
            sums += [
                over * WEIGHTS @ along,
                over * WEIGHTS @ along**2,
                over * WEIGHTS @ (volts * along),
                limited,
            ]
            i, left, previous = current(over), left - over, after
        return i, sums[0] / STEP_S, *sums[1:]


def moving(seed):
    """Ticks of a hard life: commands that jump beyond the range, fast turns, wrong gains."""
    generator = np.random.default_rng(seed)
    gain = generator.uniform(0.8, 1.2, GROUPS)
    command = np.zeros(GROUPS)
    for tick in range(60):
        if tick % 4 == 0:
            command = generator.normal(size=GROUPS) * 10 ** generator.uniform(-3, 1.3)
        G = generator.normal(size=(3, GROUPS)) * 0.05
        yield (
            command + 0.01 * generator.normal(size=GROUPS),
            G,
            gain,
            generator.normal(size=(SUBSTEPS, 3)) * 40,
        )


@pytest.mark.parametrize("delay_s", [0.0, 5e-4, 1e-3, 2.5e-3])
def test_the_chain_is_its_slow_copy(delay_s):
    chain = Chain(delay_s=delay_s)
    slow = SlowChain(chain, delay_s)
    limited = 0
    for step in moving(5):
        means, expected = chain.tick(*step), slow.tick(*step)
        # Of currents of 8 A, voltages of 20 V and periods of 1 ms, 1e-12 of each.
        np.testing.assert_allclose(means, expected, rtol=1e-12, atol=1e-12)
        np.testing.assert_allclose(chain.current, slow.current, rtol=1e-12, atol=1e-12)
        np.testing.assert_allclose(chain.flow.copper_J, slow.copper, rtol=1e-12, atol=1e-15)
        np.testing.assert_allclose(chain.flow.work_J, slow.work, rtol=1e-12, atol=1e-15)
        np.testing.assert_allclose(chain.flow.voltage_limited_s, slow.limited, rtol=1e-12, atol=1e-15)
        np.testing.assert_allclose(chain.coil.temperature_degC, slow.temperature, rtol=1e-12)
        limited += np.count_nonzero((slow.limited > 0) & (slow.limited < PERIOD_S))
    assert limited > 100  # groups that went into or out of a limit within a period


def test_neutral_stages_hand_on_every_bit():
    command = np.random.default_rng(0).normal(size=GROUPS) * 20
    late, ideal = delay(DelaySection(), STEP_S, SUBSTEPS, GROUPS), dac(DacSection(), 0.8, GROUPS, 0)
    setpoint = np.empty(GROUPS)
    latch(late, command)
    for substep in range(SUBSTEPS):
        due(late, substep, setpoint)
        convert(ideal, setpoint, setpoint)
        assert setpoint.tobytes() == command.tobytes()
    assert not amplifier(AmplifierSection(), LIMIT_A, STEP_S, GROUPS, 0).supplied


def test_converting_once_before_the_delay_is_converting_at_every_step():
    early, late, made = Chain(), Chain(), np.empty(GROUPS)
    for tick, (command, *_) in enumerate(moving(3)):
        convert(early.dac, command, made)
        latch(early.delay, made)
        latch(late.delay, command)
        for substep in range(SUBSTEPS):
            first, then = np.empty((2, GROUPS))
            due(early.delay, substep, first)
            due(late.delay, substep, then)
            convert(late.dac, then, then)
            assert tick == 0 or first.tobytes() == then.tobytes()  # at first, nothing has been commanded


def test_the_same_seed_gives_the_same_bytes():
    runs = []
    for seed in (11, 11, 12):
        chain = Chain(seed)
        runs.append(b"".join(chain.tick(*step).tobytes() for step in moving(1)))
    assert runs[0] == runs[1] != runs[2]


def test_a_lost_command_is_seen_and_an_endless_one_is_the_range():
    chain = Chain(delay_s=0.0)
    command = np.zeros(GROUPS)
    command[0], command[1], command[2], command[3] = np.nan, np.inf, -np.inf, LARGEST**30
    for _ in range(5):
        chain.tick(command, np.zeros((3, GROUPS)), np.ones(GROUPS), np.zeros((SUBSTEPS, 3)))
    np.testing.assert_array_equal(np.isnan(chain.current), np.arange(GROUPS) == 0)
    np.testing.assert_allclose(chain.current[1:4], [8, -8, 8], rtol=3e-3)  # gain, offsets, INL


def test_the_prototypes_figures_are_fields_of_the_stages():
    known = {"current_limit_A"}  # of the drive as it was
    for kind in (DelaySection, DacSection, AmplifierSection, CoilSection):
        section(kind)  # within the bounds
        assert not known & set(kind.model_fields)
        known |= set(kind.model_fields)
    assert {name.removeprefix("drive.") for name in PROTOTYPE_DRIVE} == known - {"coil_coupling"}
    assert {
        name.removeprefix("drive.") for name in HARDWARE["prototype"] if name.startswith("drive.")
    } == known
