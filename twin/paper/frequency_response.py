"""Frequency response of a control loop: measured with a multisine, and of its sampled linear model.

A multisine of torque d acts on the hinge alpha of a rotor at rest. The law answers with the torque u, and the
rotor receives w = u − d, both held over a control period. So the loop that is opened at this place has the
response ``L = −u/w`` of the sampled loop, whatever the law. Each line has a whole number of periods in the
window: the discrete Fourier transform has no leakage.

The linear model has no data of the run. It is the law, differentiated about its state at rest, and
`linearise` of the plant, sampled with a hold element.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.signal import cont2discrete

from spheretwin.config.active_config import initial_config
from spheretwin.control.law import Law
from spheretwin.linear import linearise
from spheretwin.models.base.arrays import Array
from spheretwin.models.telemetry.table import Table
from spheretwin.scenario.sections import Scenario

Response = NDArray[np.complex128]

SETTLING_s, WINDOW_s = 1.0, 1.0
"""Time before the window, and its length, the period of the multisine."""

LINES_Hz = (1, 2, 3, 4, 5, 6, 7, 8, 10, 12, 14, 17, 20, 24, 28, 33, 39, 46, 54, 64, 75, 88, 104, 122, 144,
            170, 200, 235, 277, 326, 384, 450, 500)  # fmt: skip

AMPLITUDE_Nm = 1e-3
"""Of each line: the law stays within the layer of AFSM-ESO, and all currents within their limit."""

DIFFERENCE = 1e-6
"""Step of the differences of a law; it is linear at rest, within the rounding of 1e-10 of its torque."""


def excitation() -> list[dict[str, Any]]:
    """Return the terms of the disturbance; the phases are those of Schroeder, for a small peak."""
    count = len(LINES_Hz)
    return [
        {
            "kind": "sinusoidal",
            "amplitude_Nm": [AMPLITUDE_Nm, 0.0, 0.0],
            "frequency_Hz": [float(line), 1.0, 1.0],
            # A line at half of the control rate is sampled at its peaks.
            "phase_rad": [
                -np.pi * place * (place - 1) / count if line < LINES_Hz[-1] else np.pi / 2,
                0.0,
                0.0,
            ],
        }
        for place, line in enumerate(LINES_Hz, 1)
    ]


def fields() -> dict[str, Any]:
    """Return the fields of a run of the scenario `hold` with the multisine, on ideal hardware."""
    return {
        "duration": SETTLING_s + WINDOW_s,
        "trajectory.angle_rad": [0.0, 0.0, 0.0],
        "disturbance.load": 0.0,
        "disturbance.terms": excitation(),
        # The torque of the law acts at once, as the disturbance does.
        "drive.time_constant_s": 0.0,
        "nominal.time_constant_s": 0.0,
    }


def measured(table: Table, period_s: float) -> Response:
    """Return the response of the opened loop at the lines (k,), from the telemetry of a run of `fields`.

    A run that ended before the end of the window has NaN.
    """
    ticks = round(WINDOW_s / period_s)
    if len(table) < round((SETTLING_s + WINDOW_s) / period_s):
        return np.full(len(LINES_Hz), np.nan + 0j)
    torque, disturbance = (
        np.fft.rfft(table[name][-ticks:, 0]) for name in ("torque_command_Nm", "disturbance_Nm")
    )
    lines = np.array([round(line * WINDOW_s) for line in LINES_Hz])
    return np.asarray(-torque[lines] / (torque[lines] - disturbance[lines]))


class OpenLoop(NamedTuple):
    """Linear model of the sampled loop, opened at the torque on alpha: ``x' = A x + b w, u = c x``."""

    A: Array  # (n, n)
    b: Array  # (n,)
    c: Array  # (n,)
    period_s: float

    def response(self, frequency_Hz: Sequence[float] | Array) -> Response:
        """Return ``−u/w`` at some frequencies (k,)."""
        z = np.exp(2j * np.pi * self.period_s * np.asarray(frequency_Hz))
        unit = np.eye(len(self.A))
        return np.array([-self.c @ np.linalg.solve(at * unit - self.A, self.b) for at in z])


def linear_loop(scenario: Scenario) -> OpenLoop:
    """Return the linear model of a loop at rest, upright, with exact angles and rates and without delay."""
    config = initial_config(scenario, None, None)
    period_s = config.scenario.controller.period_s
    plant = linearise(scenario, np.zeros(3)).system
    A, B = cont2discrete((plant.A, plant.B, plant.C, plant.D), period_s)[:2]
    of_state, of_measurement, torque_of_state, torque_of_measurement = _linear_law(config.law, period_s)
    # States: rotor, torque of the last period (which the law receives), law.
    n, m = 9, len(of_state)
    loop, b = np.zeros((n + m, n + m)), np.zeros(n + m)
    torque = np.hstack([torque_of_measurement, torque_of_state])  # (3, n + m)
    loop[:6, :6], b[:6] = A, B[:, 0]
    loop[:6] += B[:, 1:] @ torque[1:]  # the loops of beta and gamma stay closed
    loop[6:9] = torque
    loop[9:] = np.hstack([of_measurement, of_state])
    return OpenLoop(loop, b, torque[0], period_s)


def _linear_law(law: Law, period_s: float) -> tuple[Array, Array, Array, Array]:
    """Return the derivatives of the next state and of the torque by state and measurement, at rest.

    The measurement has nine entries: angles, rates, applied torque.
    """
    state = law.state.copy()
    for tick in range(20):  # some laws set parts of their state at the first ticks
        _, state = _tick(law, tick * period_s, state, np.zeros(9))
    t, m = 20 * period_s, len(state)
    columns = []
    for entry in range(m + 9):
        moved = []
        for sign in (1, -1):
            numbers = np.concatenate([state, np.zeros(9)])
            numbers[entry] += sign * DIFFERENCE
            torque, after = _tick(law, t, numbers[:m], numbers[m:])
            moved.append(np.concatenate([after, torque]))
        columns.append((moved[0] - moved[1]) / (2 * DIFFERENCE))
    slopes = np.column_stack(columns)
    return slopes[:m, :m], slopes[:m, m:], slopes[m:, :m], slopes[m:, m:]


def _tick(law: Law, t: float, state: Array, measurement: Array) -> tuple[Array, Array]:
    """Return torque and next state of a law whose reference is at rest at 0."""
    after, torque = state.copy(), np.zeros(3)
    step = getattr(law.step, "py_func", law.step)
    step(t, np.zeros((3, 3)), measurement.reshape(3, 3).copy(), law.parameters.copy(), after, torque)
    return torque, after


class Margins(NamedTuple):
    """Margins of a loop; NaN if the response does not cross the line within the given frequencies."""

    crossover_Hz: float
    """Last frequency at which the gain is 1."""
    phase_deg: float
    """Phase over −180 degrees there."""
    gain_dB: float
    """Additional gain up to the limit of stability, from the next crossing of −180 degrees on."""


def margins(frequency_Hz: Sequence[float] | Array, response: Response) -> Margins:
    """Return the margins of a response, interpolated between its frequencies.

    Gain in dB and phase are linear in the logarithm of the frequency between two lines.
    """
    logarithm = np.log(np.asarray(frequency_Hz, np.float64))
    gain_dB, phase_deg = 20 * np.log10(np.abs(response)), np.degrees(np.unwrap(np.angle(response)))
    # The loop has at least two integrators: its phase begins at −180 degrees or below.
    phase_deg -= 360 * np.round((phase_deg[0] + 180) / 360)
    crossings = np.flatnonzero((gain_dB[:-1] >= 0) & (gain_dB[1:] < 0))
    if not len(crossings):
        return Margins(np.nan, np.nan, np.nan)
    at = _crossing(logarithm, gain_dB, int(crossings[-1]), 0.0)
    phase_at = float(np.interp(at, logarithm, phase_deg))
    # At half of the control rate the response is real: its phase may end at −180 degrees exactly.
    beyond = phase_deg[1:] <= -180 + 1e-6
    turned = np.flatnonzero((phase_deg[:-1] > -180) & beyond & (logarithm[1:] > at))
    gain = np.nan
    if len(turned):
        where = _crossing(logarithm, phase_deg, int(turned[0]), -180.0)
        gain = -float(np.interp(where, logarithm, gain_dB))
    return Margins(float(np.exp(at)), 180 + phase_at, gain)


def _crossing(x: Array, y: Array, place: int, level: float) -> float:
    """Return where a line crosses a level between a place and the next."""
    share = (level - y[place]) / (y[place + 1] - y[place])
    return float(x[place] + share * (x[place + 1] - x[place]))
