"""The prototype's whole chain, in and out, against a plain copy of it along a run: faults at work too.

The copy knows the definitions and the seed, and of the product no stage: it is fed the true motion and the
commands that a run has logged, tick by tick, and tells what else the run must have logged. Physics step and
control period are one, so that the logged mean current is that of the whole period.
"""

from functools import cache
from hashlib import blake2b

import numpy as np
import pytest
from scipy.optimize import brentq

from spheretwin import scenario as scenarios
from spheretwin.faults.targets import TARGETS
from spheretwin.models.kinematics import rate_jacobian
from spheretwin.models.magnetics import torque_matrix
from spheretwin.session import Session
from tests.twin.electronics.slow_residual import residual_of

PERIOD_S, GROUPS, SEED, TICKS, CONVERSIONS = 1e-3, 18, 21, 400, 3
NODES, WEIGHTS = np.polynomial.legendre.leggauss(30)
NODES, WEIGHTS = (NODES + 1) / 2, WEIGHTS / 2
VOLTS_PER_RAD = 5 / np.radians(300)
TRANSCONDUCTANCE_A_V = 0.8
R20_OHM, L_H, RATE_1_S, LIMIT_A = 1.3, 0.9e-3, 2 * np.pi * 2000, 8.0
PLACES = {"pot.alpha": 0, "pot.beta": 1}

FAULTS = [
    ("coil.03", "short", 0.05, 0.30, None),
    ("coil.05", "open", 0.04, 0.20, None),
    ("amplifier.02", "offset", 0.06, 0.35, 0.3),
    ("amplifier.02", "gain", 0.08, 0.35, -0.5),
    ("amplifier.09", "noise", 0.03, None, 0.2),
    ("dac.02", "offset", 0.09, 0.30, -0.4),  # which its amplifier's gain, above, multiplies all the same
    ("dac.16", "noise", 0.07, 0.33, 0.1),
    ("pot.alpha", "offset", 0.05, 0.20, 0.003),
    ("pot.alpha", "stuck", 0.36, 0.365, None),  # where nothing else is wrong with the readings
    ("pot.beta", "gain", 0.08, 0.22, 1.05),
    ("pot.beta", "noise", 0.06, 0.30, 1e-3),
    ("encoder.gamma", "offset", 0.05, 0.20, 0.01),
    ("encoder.gamma", "dropout", 0.25, 0.26, None),
    ("adc", "noise", 0.05, 0.30, 2e-4),
    ("adc", "delay", 0.12, 0.16, 2e-3),
    ("adc", "dropout", 0.31, 0.314, None),
    ("adc", "stuck", 0.32, 0.323, None),
    ("supply", "gain", 0.10, 0.30, 0.3),
    ("supply", "noise", 0.13, 0.33, 1.0),
    ("supply", "dropout", 0.34, 0.343, None),
    ("controller", "delay", 0.09, 0.13, 2e-3),
    ("controller", "stuck", 0.17, 0.175, None),
]


# What a part does while it fails, where it comes and goes.
COMES_AND_GOES = {
    "coil": "open", "amplifier": "dropout", "dac": "dropout", "pot": "open", "encoder": "dropout",
    "adc": "dropout", "supply": "dropout", "controller": "stuck",
}  # fmt: skip

VALUES = {
    "gain": 0.5, "delay": 3e-3, "intermittent": 7e-3, ("pot", "open"): 0.4, ("supply", "offset"): -18.0,
    ("supply", "noise"): 8.0, ("amplifier", "offset"): 0.3, ("amplifier", "noise"): 0.2,
    ("dac", "offset"): 0.3, ("dac", "noise"): 0.2, ("adc", "offset"): 0.01, ("adc", "noise"): 1e-3,
    "offset": 0.01, "noise": 1e-3,
}  # fmt: skip
STUCK = {"amplifier": 0.7, "dac": -0.7, "pot": 0.1, "encoder": -0.1, "adc": 0.1}


def as_tables(faults):
    names = ("target", "mode", "start_s", "end_s", "value")
    return [
        {key: value for key, value in zip(names, fault, strict=True) if value is not None} for fault in faults
    ]


def key(name):
    """What the streams of a part are keyed by."""
    return int.from_bytes(blake2b(name.encode(), digest_size=8).digest(), "little")


def error_generator(name, channel):
    """Generator of the errors of a channel."""
    return np.random.default_rng([SEED, key(name), channel])


def draw(name, column, tick):
    """One number of the documented streams: four of each tick from four uniform ones, by Box and Muller."""
    counted = np.random.Philox(np.random.SeedSequence([SEED, key(f"{name} noise"), column // 4]))
    counted = counted.advance(tick)
    u, v, phi, psi = np.random.Generator(counted).random(4)
    r, s = np.sqrt(-2 * np.log1p(-u)), np.sqrt(-2 * np.log1p(-v))
    return (
        r * np.cos(2 * np.pi * phi), s * np.cos(2 * np.pi * psi),
        r * np.sin(2 * np.pi * phi), s * np.sin(2 * np.pi * psi),
    )[column % 4]  # fmt: skip


class Copy:
    """All that stands between the joints and the law, and between the law and the coils."""

    def __init__(self, faults, actuator):
        self.faults, self.actuator, self.tick_number = faults, actuator, 0
        self.residuals = [self.residual(channel) for channel in range(2)]
        self.adc = [error_generator("sensors.adc", channel).uniform(-1, 1, 2) for channel in range(2)]
        dac = np.array([error_generator("drive.dac", j).uniform(-1, 1, 5) for j in range(GROUPS)])
        self.dac_offset_V, self.dac_gain = 2e-3 * dac[:, 0], 1 + 1e-3 * dac[:, 1]
        self.inl = 4 * dac[:, 2:] / np.maximum(1, np.abs(dac[:, 2:]).sum(axis=1))[:, None]
        offsets = [error_generator("drive.amplifier", j).uniform(-1, 1) for j in range(GROUPS)]
        self.amplifier_A = 8e-4 * np.array(offsets)
        self.wiper, self.converted, self.handed = np.zeros((3, 3))
        self.voltages, self.sent = [], [np.zeros(GROUPS)]
        self.latched, self.setpoint, self.current = np.zeros((3, GROUPS))
        self.temperature = np.full(GROUPS, 20.0)
        self.state, self.gain, self.last_rate = None, self.kalman_gain(), None

    @staticmethod
    def kalman_gain():
        """Of the textbook's filter, its covariance run until it stays; the noise drops out of it."""
        density = 400.0**4 * PERIOD_S
        A = np.array([[1, PERIOD_S], [0, 1]])
        Q = density * np.array([[PERIOD_S**3 / 3, PERIOD_S**2 / 2], [PERIOD_S**2 / 2, PERIOD_S]])
        P = np.diag([1.0, 1.0])
        for _ in range(1000):  # e^(-1000 · 400 · 1e-3) of the start is left
            P = A @ P @ A.T + Q
            gain = P[:, 0] / (P[0, 0] + 1)
            P = P - np.outer(gain, P[0])
        return gain

    @staticmethod
    def residual(channel):
        shape = residual_of(error_generator("sensors.potentiometer", channel).uniform(0, 2 * np.pi, 4))
        return lambda angle: np.radians(0.02) * shape(angle * 2 * np.pi / np.radians(300))

    def acting(self, kind, place=None):
        """Faults of a kind at this tick, in the order of the plan: mode, value, name of the part."""
        for target, mode, start, end, value in self.faults:
            name, _, where = target.partition(".")
            number = PLACES.get(target, int(where) if where.isdecimal() else 0)
            first, last = round(start / PERIOD_S), np.inf if end is None else round(end / PERIOD_S)
            if name == kind and place in (None, number) and first <= self.tick_number < last:
                if mode == "intermittent":
                    stretch = self.tick_number // round(value / PERIOD_S)
                    if error_generator(f"{target} intermittent", stretch).random() < 0.5:
                        yield COMES_AND_GOES[name], None, target
                else:
                    yield mode, value, target

    def through(self, faults, value, last, unit, channel=0):
        """A value behind what is wrong with a line, fault by fault; `unit` takes what is stated to it."""
        for mode, stated, part in faults:
            if mode == "offset":
                value = value + unit * stated
            elif mode == "gain":
                value = value * stated
            elif mode == "noise":
                value = value + unit * stated * draw(part, channel, self.tick_number)
            elif mode == "stuck":
                value = last if stated is None else unit * stated
            elif mode == "dropout":
                value = 0.0
            elif mode in ("open", "short"):  # of a potentiometer: its input floats, or lies at an end
                value = 2.5 if mode == "short" else stated or 0.0
            else:
                raise KeyError(mode)
        return value

    def sense(self, q):
        handed = np.empty(3)
        for channel in range(2):
            angle = np.clip(q[channel], -np.radians(150), np.radians(150))
            volts = np.clip(VOLTS_PER_RAD * (angle + self.residuals[channel](angle)), -2.5, 2.5)
            volts = self.through(self.acting("pot", channel), volts, self.wiper[channel], VOLTS_PER_RAD)
            self.wiper[channel] = volts
            noise = np.hypot(VOLTS_PER_RAD * np.radians(0.02), 5 / 2**16)
            codes = []
            for k in range(CONVERSIONS):
                seen = volts + noise * draw("sensors.adc", 2 * k + channel, self.tick_number)
                seen = (1 + 1e-3 * self.adc[channel][1]) * seen + 1e-3 * self.adc[channel][0]
                codes.append(np.clip(np.round(seen / (5 / 2**16)), -(2**15), 2**15 - 1))
            volts = np.mean(codes) * 5 / 2**16
            lines = [fault for fault in self.acting("adc") if fault[0] not in ("dropout", "delay")]
            volts = self.through(lines, volts, self.converted[channel], 1.0, channel)
            self.converted[channel] = volts
        self.voltages.append(self.converted[:2].copy())
        late = sum(round(value / PERIOD_S) for mode, value, _ in self.acting("adc") if mode == "delay")
        handed[:2] = self.voltages[-1 - late] / VOLTS_PER_RAD
        lines = [fault for fault in self.acting("encoder") if fault[0] != "dropout"]
        self.wiper[2] = self.through(lines, q[2], self.wiper[2], 1.0)
        handed[2] = np.round(self.wiper[2] * 2000 / (2 * np.pi)) * 2 * np.pi / 2000
        if any(mode == "dropout" for mode, *_ in self.acting("adc")):
            handed[:2] = self.handed[:2]
        if any(mode == "dropout" for mode, *_ in self.acting("encoder")):
            handed[2] = self.handed[2]
        self.handed = handed

    def estimate(self):
        if self.state is None:
            self.state, self.last_angle = np.array([self.handed, np.zeros(3)]), self.handed
        ahead = self.state[0] + PERIOD_S * self.state[1]
        error = self.handed - ahead
        jumped = np.abs(self.handed - self.last_angle) > max(0.2, 200 * PERIOD_S)
        angle = np.where(jumped, self.handed, ahead + self.gain[0] * error)
        rate = self.state[1] + np.where(jumped, 0.0, self.gain[1] * error)
        self.state, self.last_angle = np.array([angle, rate]), self.handed.copy()

    def volts_asked(self, command):
        codes = np.clip(np.round(command / TRANSCONDUCTANCE_A_V * 2**16 / 20), -(2**15), 2**15 - 1)
        p = np.arccos((codes + 2**15) / (2**16 - 1) * 2 - 1)
        inl = np.sin(p) * sum(self.inl[:, n] * np.sin((n + 1) * p) for n in range(3))
        return 20 / 2**16 * (codes * self.dac_gain + inl) + self.dac_offset_V

    def ask(self, command):
        """What the amplifiers are asked for, behind the delay and all that is wrong with it."""
        leaving, late = TRANSCONDUCTANCE_A_V * self.volts_asked(command), 1
        for mode, value, _ in self.acting("controller"):
            if mode == "stuck":
                leaving = self.sent[-1]
            elif mode == "dropout":
                leaving = TRANSCONDUCTANCE_A_V * self.volts_asked(np.zeros(GROUPS))
            elif mode == "delay":
                late += round(value / PERIOD_S)
            else:
                raise KeyError(mode)
        self.sent.append(leaving)
        setpoint = self.sent[max(len(self.sent) - 1 - late, 0)].copy()
        for j in range(GROUPS):
            faults = self.acting("dac", j)
            self.latched[j] = self.through(faults, setpoint[j], self.latched[j], TRANSCONDUCTANCE_A_V)
            setpoint[j] = self.latched[j]
            lines = [fault for fault in self.acting("amplifier", j) if fault[0] != "open"]
            setpoint[j] = self.through(lines, setpoint[j], self.setpoint[j], 1.0)
        self.setpoint = setpoint

    def drive(self, q, qdot):
        supply = 24.0
        for mode, value, part in self.acting("supply"):
            supply = self.through([(mode, value, part)], supply, None, 1.0)
        supply = max(supply, 0.0)
        # The field is that of the predicted pose in the middle of the step, which is the period.
        middle_rate = qdot + 0.5 * (qdot - (qdot if self.last_rate is None else self.last_rate))
        middle, self.last_rate = q + 0.5 * PERIOD_S * qdot, qdot
        G = torque_matrix(middle, self.actuator)
        turns = np.ones(GROUPS)
        R = R20_OHM * (1 + 0.0039 * (self.temperature - 20))
        mean, copper, drawn, work = np.zeros((4, GROUPS))
        for j in range(GROUPS):
            wrong = {mode for mode, *_ in self.acting("coil", j)}
            assert wrong <= {"open", "short", "gain"}
            wrong |= {mode for mode, *_ in self.acting("amplifier", j)}
            for mode, value, _ in self.acting("coil", j):
                turns[j] *= value if mode == "gain" else 1.0
            emf = turns[j] * (G[:, j] @ (rate_jacobian(middle) @ middle_rate))
            target = np.clip(self.setpoint[j] + self.amplifier_A[j], -LIMIT_A, LIMIT_A)
            if "open" in wrong:
                self.current[j] = 0.0
                continue
            if "short" in wrong:
                along = self.relaxing(self.current[j], -emf / R[j], R[j] / L_H)
                mean[j], square = WEIGHTS @ along(PERIOD_S * NODES), WEIGHTS @ along(PERIOD_S * NODES) ** 2
                self.current[j], drawn[j] = along(PERIOD_S), abs(target)
            else:
                up, down, before = max(supply - 4.8, 0.0), min(4.6 - supply, 0.0), self.current[j]
                self.current[j], mean[j], square = self.driven(before, R[j], target, emf, up, down)
                drawn[j] = abs(mean[j])
                stored = 0.5 * L_H * (self.current[j] ** 2 - before**2) / PERIOD_S
                work[j] = R[j] * square + emf * mean[j] + stored
            copper[j] = R[j] * square
        last = 20 + 4 * copper
        self.temperature = last + (self.temperature - last) * np.exp(-PERIOD_S / 240)
        return {
            "current_A": mean,
            "torque_Nm": G @ (turns * mean),
            "copper_loss_W": copper,
            "coil_power_W": work,
            "coil_temperature_degC": self.temperature.copy(),
            "supply_power_W": supply * drawn.sum(),
        }

    @staticmethod
    def relaxing(start, rest, rate):
        return lambda t: rest + (start - rest) * np.exp(-rate * t)

    def driven(self, i, R, target, emf, up, down):
        """Phases in the order they come, until the period is over: end, mean and mean square."""
        left, mean, square, mode = PERIOD_S, 0.0, 0.0, None

        def voltage_at(current):
            return R * current + L_H * RATE_1_S * (target - current) + emf

        while left > 0:
            v = voltage_at(i)
            # Where a phase has just ended the voltage is at a limit to rounding; which side is known.
            mode = mode or ("up" if v > up else "down" if v < down else "follow")
            mode = "up" if up == down else mode  # without a swing there is one voltage
            rest = {"up": (up - emf) / R, "down": (down - emf) / R, "follow": target}[mode]
            along = self.relaxing(i, rest, RATE_1_S if mode == "follow" else R / L_H)
            over, after = left, None
            ends = {"follow": [up, down], "up": [up], "down": [down]}[mode]
            for end in ends if up > down else []:
                begin, finish = v - end, voltage_at(along(left)) - end
                if begin * finish < 0 and abs(begin) > 1e-9:

                    def beyond(t, end=end, along=along):
                        return voltage_at(along(t)) - end

                    root = brentq(beyond, 0, left, xtol=1e-19, rtol=1e-15)
                    if root < over:
                        over, after = root, "follow" if mode != "follow" else "up" if end == up else "down"
            # The fast phase lasts twelve time constants: quadrature in six pieces keeps its digits.
            pieces = over * (np.arange(6)[:, None] + NODES) / 6
            mean += over * np.mean(along(pieces) @ WEIGHTS)
            square += over * np.mean(along(pieces) ** 2 @ WEIGHTS)
            i, left, mode = along(over), left - over, after
        return i, mean / PERIOD_S, square / PERIOD_S

    def tick(self, q, qdot, command):
        self.sense(q)
        self.estimate()
        self.ask(command)
        measured = {"q_measured_rad": self.handed.copy(), "qdot_estimated_rad_s": self.state[1].copy()}
        row = measured | self.drive(q, qdot)
        self.tick_number += 1
        return row


def compared_run(faults, engine="mujoco", ticks=TICKS):
    scenario = scenarios.load(
        "nutation",
        {
            "hardware": "electronics", "seed": SEED, "plant.engine": engine, "plant.step_s": PERIOD_S,
            "sensors.adc.oversampling": CONVERSIONS, "watchdog.on": False, "fault": as_tables(faults),
        },
    )  # fmt: skip
    with Session(scenario) as session:
        table, actuator = session.advance(ticks), session.actuator
        assert session.status == "running"
    copy, inputs = Copy(faults, actuator), ("q_rad", "qdot_rad_s", "current_command_A")
    rows = [copy.tick(*each) for each in zip(*(table[name] for name in inputs), strict=True)]
    for name in rows[0]:
        expected = np.array([row[name] for row in rows]).reshape(table[name].shape)
        # Rounding of all products and sums, 1e-16 each, on either side; a flipped code would be 1e-5.
        size = np.abs(expected).max()
        np.testing.assert_allclose(table[name], expected, rtol=0, atol=1e-12 * size, err_msg=name)
    return table, rows


@pytest.mark.parametrize(
    ("faults", "engine"),
    [
        ([], "mujoco"),
        (FAULTS, "mujoco"),
        pytest.param(
            FAULTS, "lagrangian", marks=pytest.mark.release("compiles a loop, 12 s; mujoco has the faults")
        ),
    ],
    ids=["healthy-mujoco", "faults-mujoco", "faults-lagrangian"],
)
def test_the_prototype_is_its_plain_copy(faults, engine):
    table, _ = compared_run(faults, engine)
    if faults:
        assert np.count_nonzero(table["fault"].any(axis=0)) == len({target for target, *_ in faults})
        # It went through the limits of the voltage, in and out within a period.
        shares = table["voltage_limited"]
        assert np.count_nonzero((shares > 0) & (shares < 1)) > 50


EVERY = [(target.name, mode) for target in TARGETS.values() for mode in target.modes]


@pytest.mark.parametrize(("kind", "mode"), EVERY)
def test_every_way_to_fail_acts_where_it_belongs(kind, mode):
    """Each alone, and what it acts on is told apart from a healthy run; a mode that is new has no copy."""
    part = TARGETS[kind].names(GROUPS)[-1]
    value = VALUES.get((kind, mode), VALUES.get(mode))
    faults = [(part, mode, 0.03, 0.07, value)]
    if mode == "stuck" and kind in STUCK:
        faults.append((part, mode, 0.08, 0.09, STUCK[kind]))
    table, rows = compared_run(faults, ticks=110)
    failing = np.flatnonzero(table["fault"].any(axis=1))
    assert failing[0] >= 30
    assert failing[-1] < 90
    differ = [
        any(np.any(row[name] != healthy[name]) for name in row)
        for row, healthy in zip(rows, healthy_rows(), strict=True)
    ]
    assert not any(differ[: failing[0]])
    assert any(differ)


@cache
def healthy_rows():
    return compared_run([], ticks=110)[1]
