"""Voltage-to-current amplifiers: each closes a loop around the current of its group within its voltage swing.

With the target r, the current i and the bandwidth w of the closed loop, an amplifier sets the voltage for
``di/dt = w (r - i)``, which is ``v = R i + L w (r - i) + e``, limited to its swing::

    L di/dt = min(max(v(i), -V_down), V_up) - R i - e

Target and back-EMF e are held over a physics step, and the step is solved exactly with exponentials. The
right side is continuous in i and decreases everywhere, with slope -L w while the amplifier follows and -R
while its voltage is at a limit. So there is one equilibrium current, and i approaches it monotonically. v is
a straight line in i, so v is monotonic too (constant if R = L w) and reaches each limit at most once. A step
has at most three phases: limit, following, other limit. It may begin with any of them. A limit that was left
is not reached again, and a limit that was reached is not left.

In each phase current and voltage relax with one time constant (1/w following, L/R at a limit) towards the
final values of the phase. A quantity that relaxes from u towards u_last of the other sign is 0 after
``log(1 - u / u_last)`` time constants: with u the distance of the voltage from a limit, this is the end of
the phase. A limit that is not reached costs no logarithm and no exponential: if the voltage at the start and
the final voltage are within the swing, every voltage between them is too.

Neglected, as small compared with a physics step of 0.5 ms: the slew rate (9 V/µs: full swing in 5 µs) and the
drift of the offset (20 µV/K).
"""

from __future__ import annotations

from math import inf, isnan, log1p, nan
from typing import Annotated, Any, ClassVar, NamedTuple

import numpy as np
from pydantic import Field, model_validator

from spheretwin.electronics.coil import OPEN, GroupCoils, Relaxation, relaxation, relaxations
from spheretwin.electronics.random_streams import UNIFORM, errors
from spheretwin.electronics.stages import DriveSetup, DriveStage, FaultLine, fill_fault_line
from spheretwin.models.base.arrays import Array
from spheretwin.models.base.compiled import inlined
from spheretwin.models.base.record import Record, Rows, field, put
from spheretwin.models.base.vectors import WIDTH, Vector, load, store, within

# No motion of the rotor induces as much; the bound keeps squares of currents finite.
LARGEST_EMF_V = 1e9


class AmplifierStage(Record):
    """Inputs of the amplifiers as a stage of the drive."""

    on: bool = field("whether a fault may occur")
    line: FaultLine = field("of the setpoint, A", channels="groups")


class AmplifierSection(DriveStage):
    """Parameters of the amplifiers; without a supply they are not used."""

    stage: ClassVar[str] = "amplifier"
    record: ClassVar[type[Record]] = AmplifierStage
    supply_V: Annotated[float, Field(ge=1e-3, le=1e6)] | None = Field(
        None,
        description="supply, plus and minus, V; without one the current follows with time_constant_s only"
        " (OPA549, from its sheet: 4 to 30; assumed: 24)",
    )
    drop_up_V: Annotated[float, Field(ge=0, le=1e6)] = Field(
        0.0,
        description="difference between the supply and the largest voltage, V"
        " (OPA549, from its sheet: 4.8 at 8 A at worst)",
    )
    drop_down_V: Annotated[float, Field(ge=0, le=1e6)] = Field(
        0.0,
        description="difference between the lowest voltage and the negative supply, V"
        " (OPA549, from its sheet: 4.6 at 8 A at worst)",
    )
    bandwidth_rad_s: Annotated[float, Field(ge=1e-3, le=1e9)] = Field(
        12566.370614359172,
        description="bandwidth of the closed current loop, rad/s (assumed: 2 kHz)",
    )
    transconductance_A_V: Annotated[float, Field(ge=1e-6, le=1e6)] = Field(
        0.8, description="commanded current per volt of the converter, A/V (assumed)"
    )
    amplifier_offset_V: Annotated[float, Field(ge=0, le=10)] = Field(
        0.0,
        description="largest offset of an amplifier, at its input, drawn from the seed, V"
        " (OPA549, from its sheet: 1e-3 typical, 5e-3 at most)",
        json_schema_extra=UNIFORM,
    )

    @model_validator(mode="after")
    def _some_swing(self) -> AmplifierSection:
        if self.supply_V is not None and not max(self.drop_up_V, self.drop_down_V) < self.supply_V:
            raise ValueError(
                "expected drive.drop_up_V and drive.drop_down_V below drive.supply_V,"
                f" received {self.drop_up_V!r}, {self.drop_down_V!r} and {self.supply_V!r} V"
            )
        return self

    @staticmethod
    def ideal(section: Any) -> bool:
        """Return True: without a fault this stage changes no setpoint."""
        return True

    @staticmethod
    def fill(rows: Rows, section: Any, setup: DriveSetup) -> None:
        """Fill the inputs of the amplifiers, which only faults change."""
        put(rows, on=setup.faults)
        fill_fault_line(rows["line"], 0.0)


class Step(Record):
    """Physics step of the amplifiers, or a part of one."""

    step_s: float = field("duration", "s")
    following: Array = field("shares of a group that follows its target, as in `Relaxation`", "", 5)


class Amplifier(Record):
    """Amplifiers of all groups."""

    drop_up_V: float = field("supply less the largest voltage", "V")
    drop_down_V: float = field("lowest voltage less the negative supply", "V")
    highest_V: float = field("largest voltage in this control period", "V")
    lowest_V: float = field("lowest voltage in this control period", "V")
    bandwidth_rad_s: float = field("bandwidth of the closed current loop", "rad/s")
    current_limit_A: float = field("largest target", "A")
    whole: Step = field("physics step")
    offset_A: Array = field("offset at the input", "A", "groups")


class Flow(Record):
    """Currents and energies of the coils: the mean of the last step, and sums until they are reset."""

    mean_current_A: Array = field("over the last physics step; acts on the rotor", "A", "groups")
    copper_J: Array = field("loss in the coils", "J", "groups")
    work_J: Array = field("electrical energy at the terminals of the coils", "J", "groups")
    voltage_limited_s: Array = field("time with the voltage at a limit", "s", "groups")
    current_limited_s: Array = field("time with a setpoint beyond the current limit", "s", "groups")


def fill_amplifier(
    rows: Rows, section: AmplifierSection, current_limit_A: float, step_s: float, seed: int
) -> None:
    """Fill the amplifiers of all groups for a current limit (A) and a physics step (s).

    Offsets are drawn uniformly within their bound, each from a separate stream.
    """
    if np.any(section.amplifier_offset_V):
        drawn = errors(seed, "drive.amplifier", rows["offset_A"].shape[1], 1)[..., 0]
        offset_A = section.amplifier_offset_V * section.transconductance_A_V * drawn
        put(rows, offset_A=np.where(section.amplifier_offset_V, offset_A, 0.0))
    supply_V = inf if section.supply_V is None else section.supply_V
    put(rows, drop_up_V=section.drop_up_V, drop_down_V=section.drop_down_V)
    put(rows, highest_V=supply_V - section.drop_up_V, lowest_V=section.drop_down_V - supply_V)
    put(rows, bandwidth_rad_s=section.bandwidth_rad_s, current_limit_A=current_limit_A)
    fill_step(rows["whole"], section, step_s)


def fill_step(rows: Rows, section: AmplifierSection, step_s: float) -> None:
    """Fill a step of the amplifiers."""
    put(rows, step_s=step_s, following=relaxations(section.bandwidth_rad_s * step_s))


@inlined
def set_supply(amplifier: Amplifier, supply_V: float) -> None:
    """Set the supply of a control period; below the drops there is no swing."""
    amplifier.highest_V = max(supply_V - amplifier.drop_up_V, 0.0)
    amplifier.lowest_V = min(amplifier.drop_down_V - supply_V, 0.0)


@inlined
def reset_sums(flow: Flow) -> None:
    """Reset the sums at the start of a control period."""
    for j in range(flow.copper_J.shape[0]):
        flow.copper_J[j] = flow.work_J[j] = 0.0
        flow.voltage_limited_s[j] = flow.current_limited_s[j] = 0.0


class Phase(NamedTuple):
    """Phase of a step of one group or four, in which current and voltage relax with one time constant."""

    current_A: Vector  # at its end
    charge_As: Vector
    square_A2s: Vector
    work_J: Vector


@inlined
def drive_coils(
    amplifier: Amplifier,
    step: Step,
    coil: GroupCoils,
    setpoint: Array,
    emf: Array,
    current: Array,
    flow: Flow,
) -> None:
    """Advance the currents by one step.

    Parameters
    ----------
    amplifier : Amplifier
    step : Step
    coil : GroupCoils
        Temperatures do not change here: `coil.advance_temperature` advances them.
    asked : (n,) array, A
        Held over the step. With the offset of the amplifier, and within the current limit, it is the target.
        Any number or infinity; after NaN the current stays NaN.
    emf : (n,) array, V
        Back-EMF, held over the step; limited to `LARGEST_EMF_V`.
    current : (n,) array, A
        At the start of the step; on return, at its end.
    flow : Flow
        Result: the mean current is written, the sums increase.
    """
    groups = current.shape[0]
    left = groups % WIDTH
    for j in range(0, groups - left, WIDTH):
        if not _follow_four(amplifier, step, coil, setpoint, emf, current, flow, j):
            for group in range(j, j + WIDTH):
                _drive_group(amplifier, step, coil, setpoint, emf, current, flow, group)
    for group in range(groups - left, groups):
        _drive_group(amplifier, step, coil, setpoint, emf, current, flow, group)


@inlined
def _follow_four(
    amplifier: Amplifier,
    step: Step,
    coil: GroupCoils,
    setpoint: Array,
    emf: Array,
    current: Array,
    flow: Flow,
    j: int,
) -> bool:
    """Advance four groups from j on if none of them reaches a limit; otherwise return False."""
    h, limit = step.step_s, amplifier.current_limit_A
    highest, lowest = amplifier.highest_V, amplifier.lowest_V
    start, R, e = load(current, j), load(coil.resistance_ohm, j), load(emf, j)
    target = load(setpoint, j) + load(amplifier.offset_A, j)
    volts = R * start + load(coil.inductance_H, j) * amplifier.bandwidth_rad_s * (target - start) + e
    last_volts = R * target + e
    if not (
        within(target, -limit, limit)
        and within(e, -LARGEST_EMF_V, LARGEST_EMF_V)
        and within(volts, lowest, highest)
        and within(last_volts, lowest, highest)
    ):
        return False
    whole = _phase(_following(step), h, start, target, volts, last_volts)
    store(whole.current_A, current, j)
    store(whole.charge_As * (1.0 / h), flow.mean_current_A, j)
    store(load(flow.copper_J, j) + R * whole.square_A2s, flow.copper_J, j)
    store(load(flow.work_J, j) + whole.work_J, flow.work_J, j)
    return True


@inlined
def _drive_group(
    amplifier: Amplifier,
    step: Step,
    coil: GroupCoils,
    setpoint: Array,
    emf: Array,
    current: Array,
    flow: Flow,
    j: int,
) -> None:
    """Advance one group."""
    h, limit = step.step_s, amplifier.current_limit_A
    highest, lowest = amplifier.highest_V, amplifier.lowest_V
    unlimited = setpoint[j] + amplifier.offset_A[j]
    target = min(max(unlimited, -limit), limit)
    e = min(max(emf[j], -LARGEST_EMF_V), LARGEST_EMF_V)
    start, R = current[j], coil.resistance_ohm[j]
    volts = R * start + coil.inductance_H[j] * amplifier.bandwidth_rad_s * (target - start) + e
    last_volts = R * target + e
    if lowest <= volts <= highest and lowest <= last_volts <= highest:
        whole = _phase(_following(step), h, start, target, volts, last_volts)
    else:
        whole, limited_s = _within_limits(amplifier, step, coil.inductance_H[j], R, e, target, start)
        flow.voltage_limited_s[j] += limited_s
    current[j] = whole.current_A
    flow.mean_current_A[j] = whole.charge_As * (1.0 / h)
    flow.copper_J[j] += R * whole.square_A2s
    flow.work_J[j] += whole.work_J
    if abs(unlimited) > limit:
        flow.current_limited_s[j] += h


@inlined
def _following(step: Step) -> Relaxation:
    shares = step.following
    return Relaxation(shares[0], shares[1], shares[2], shares[3], shares[4])


@inlined
def _phase(
    shares: Relaxation, duration: float, start: Vector, last: Vector, volts: Vector, last_volts: Vector
) -> Phase:
    """Return the integrals over a phase of one group or four, from initial and final current and voltage."""
    way = last - start
    crossed = volts * last + last_volts * start
    return Phase(
        start + shares.settled * way,
        duration * (start + shares.mean * way),
        duration
        * (
            shares.start_start * (start * start)
            + shares.start_settled * (2.0 * start * last)
            + shares.settled_settled * (last * last)
        ),
        duration
        * (
            shares.start_start * (volts * start)
            + shares.start_settled * crossed
            + shares.settled_settled * (last_volts * last)
        ),
    )


@inlined
def _within_limits(
    amplifier: Amplifier,
    step: Step,
    inductance_H: float,
    R: float,
    e: float,
    target: float,
    start: float,
) -> tuple[Phase, float]:
    """Return one step of a group, phase by phase, and its time with the voltage at a limit."""
    rate, highest, lowest = amplifier.bandwidth_rad_s, amplifier.highest_V, amplifier.lowest_V
    stiffness = inductance_H * rate
    left, limited = step.step_s, 0.0
    volts = R * start + stiffness * (target - start) + e
    last_volts = R * target + e
    if isnan(volts + last_volts):  # while following, the current would not depend on the back-EMF
        return Phase(nan, nan, nan, nan), 0.0
    passed = Phase(start, 0.0, 0.0, 0.0)

    if volts > highest or volts < lowest:
        limit = highest if volts > highest else lowest
        last = (limit - e) / R
        # At the final current of the limit, the amplifier demands more voltage in proportion to the error.
        duration = _time_to_zero(volts - limit, stiffness * (target - last), inductance_H / R, left)
        passed = _at_limit(passed, limit, last, duration * R / inductance_H, duration)
        left, limited, volts = left - duration, duration, limit
        if left <= 0.0:
            return passed, limited

    limit = highest if last_volts > highest else lowest
    duration = left
    if last_volts > highest or last_volts < lowest:
        duration = _time_to_zero(volts - limit, last_volts - limit, 1.0 / rate, left)
    shares = _following(step) if duration == step.step_s else relaxation(rate * duration)
    passed = _added(passed, _phase(shares, duration, passed.current_A, target, volts, last_volts))
    left -= duration

    if left > 0.0:
        last = (limit - e) / R
        passed = _at_limit(passed, limit, last, left * R / inductance_H, left)
        limited += left
    return passed, limited


@inlined
def _time_to_zero(start: float, last: float, time_constant: float, longest: float) -> float:
    """Return the time at which a relaxation from `start` towards `last` is 0, at most `longest`.

    Values of one sign and NaN never become 0: the result is `longest`.
    """
    if start <= 0.0 < last or last < 0.0 <= start:
        time = time_constant * log1p(-start / last)
        if time < longest:
            return time
    return longest


@inlined
def _at_limit(passed: Phase, limit: float, last: float, x: float, duration: float) -> Phase:
    """Add a phase of x time constants L/R at a voltage limit to the preceding phases."""
    return _added(passed, _phase(relaxation(x), duration, passed.current_A, last, limit, limit))


@inlined
def _added(passed: Phase, more: Phase) -> Phase:
    """Return two phases as one."""
    return Phase(
        more.current_A,
        passed.charge_As + more.charge_As,
        passed.square_A2s + more.square_A2s,
        passed.work_J + more.work_J,
    )


@inlined
def advance_open_short(
    contact: int,
    coil: GroupCoils,
    group: int,
    step_s: float,
    emf_V: float,
    current: Array,
    mean: Array,
    flow: Flow,
) -> None:
    """Advance the current of one open or shorted group by a physics step.

    Parameters
    ----------
    contact : int
        `OPEN` or `SHORTED`.
    coil : GroupCoils
        The temperature does not change here.
    group : int
    step_s : float, s
    emf_V : float, V
        Back-EMF, held over the step.
    current : (n,) array, A
        At the start of the step; on return, at its end.
    mean : (n,) array, A
        Result: mean over the step.
    flow : Flow
        The copper loss increases; there is no energy at the terminals.
    """
    if contact == OPEN:
        current[group] = mean[group] = 0.0
        return
    R, start = coil.resistance_ohm[group], current[group]
    shares = relaxation(step_s * R / coil.inductance_H[group])
    last = -min(max(emf_V, -LARGEST_EMF_V), LARGEST_EMF_V) / R
    current[group] = start + shares.settled * (last - start)
    mean[group] = start + shares.mean * (last - start)
    square = (
        shares.start_start * (start * start)
        + shares.start_settled * (2.0 * start * last)
        + shares.settled_settled * (last * last)
    )
    flow.copper_J[group] += step_s * R * square
