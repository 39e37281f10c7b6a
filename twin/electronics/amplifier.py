"""Voltage-to-current amplifiers: each closes a loop around its group's current, with the voltage it has.

With the target r, the current i and the closed loop's bandwidth w, an amplifier sets the voltage that makes
``di/dt = w (r - i)``, which is ``v = R i + L w (r - i) + e``, as far as its swing goes::

    L di/dt = min(max(v(i), -V_down), V_up) - R i - e

Target and back-EMF e are held over a physics step, and the step is solved exactly, which needs no more than
exponentials. The right side is continuous in i and falls everywhere, with slope -L w where the amplifier
follows and -R where its voltage is at a limit. So there is one current at rest, and i moves towards it and
never back. v is a straight line in i, so v too only rises or only falls (or stays, where R = L w), and meets
each limit at most once. Within a step there are at most three phases, limit, following, other limit, of
which a step may begin with any: a limit that is left is never met again, and one that is met is never left.

In each phase current and voltage relax with one time constant (1/w following, L/R at a limit) towards values
that the phase would settle at. What relaxes from u to u_last of the other sign is 0 after
``log(1 - u / u_last)`` time constants: with u the voltage's distance from a limit, that is when the phase
ends. A limit that is not reached costs no logarithm and no exponential: where the voltage at the start and
the one at rest are both within the swing, so is every one between.

Left out, as small beside a physics step of 0.5 ms: the slew rate (9 V/µs: full swing in 5 µs) and the drift
of the offset (20 µV/K).
"""

from __future__ import annotations

from math import inf, isnan, log1p, nan
from typing import Annotated, Any, ClassVar, NamedTuple

import numpy as np
from numpy.typing import NDArray
from pydantic import Field, model_validator

from spheretwin.electronics.coil import OPEN, GroupCoils, Relaxation, relaxation
from spheretwin.electronics.drive_stage import DriveSetup, DriveStage
from spheretwin.electronics.random_streams import errors
from spheretwin.electronics.stages import FaultLine, fault_line
from spheretwin.models.base.compiled import allocation_free, part_of_its_caller

# No motion of the rotor induces as much: squares of currents remain numbers, whatever comes in.
LARGEST_EMF_V = 1e9


class AmplifierSection(DriveStage):
    """Amplifiers of the groups; without a supply, they are none of these."""

    stage: ClassVar[str] = "amplifier"
    supply_V: Annotated[float, Field(ge=1e-3, le=1e6)] | None = Field(
        None,
        description="supply, plus and minus, V; without one the current follows with time_constant_s alone"
        " (OPA549, from its sheet: 4 to 30; that it is 24, assumed)",
    )
    drop_up_V: Annotated[float, Field(ge=0, le=1e6)] = Field(
        0.0,
        description="what the largest voltage stays below the supply, V"
        " (OPA549, from its sheet: 4.8 at 8 A at worst)",
    )
    drop_down_V: Annotated[float, Field(ge=0, le=1e6)] = Field(
        0.0,
        description="what the lowest voltage stays above the negative supply, V"
        " (OPA549, from its sheet: 4.6 at 8 A at worst)",
    )
    bandwidth_rad_s: Annotated[float, Field(ge=1e-3, le=1e9)] = Field(
        12566.370614359172,
        description="of the closed current loop, rad/s (assumed: 2 kHz)",
    )
    transconductance_A_V: Annotated[float, Field(ge=1e-6, le=1e6)] = Field(
        0.8, description="current asked for a volt of the converter, A/V (assumed)"
    )
    amplifier_offset_V: Annotated[float, Field(ge=0, le=10)] = Field(
        0.0,
        description="largest offset of an amplifier, at its input, drawn from the seed, V"
        " (OPA549, from its sheet: 1e-3 typical, 5e-3 at most)",
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
        """Always: what an amplifier is asked for is the target of `drive_coils`."""
        return True

    @staticmethod
    def build(section: Any, setup: DriveSetup) -> Any:
        """Inputs of the amplifiers, which only faults change."""
        return AmplifierStage(setup.faults, fault_line(setup.groups * setup.faults, 0.0))


class AmplifierStage(NamedTuple):
    """Inputs of the amplifiers as a stage of the drive."""

    on: bool
    line: FaultLine  # of what the amplifiers are asked for, A


class Amplifier(NamedTuple):
    """Amplifiers of all groups as compiled code sees them."""

    supplied: bool  # whether there is a supply; if not, no voltage is too large
    highest_V: float
    lowest_V: float
    bandwidth_rad_s: float
    current_limit_A: float
    step_s: float
    following: Relaxation  # over a whole physics step
    offset_A: NDArray[np.float64]  # (n,)


class Flow(NamedTuple):
    """What has passed through the coils: the mean of the last step, sums until they are cleared."""

    mean_current_A: NDArray[np.float64]  # (n,) over the last physics step: what acts on the rotor
    copper_J: NDArray[np.float64]  # (n,) loss in the coils
    work_J: NDArray[np.float64]  # (n,) of the voltage at the coil's ends
    voltage_limited_s: NDArray[np.float64]  # (n,) time with the voltage at a limit
    current_limited_s: NDArray[np.float64]  # (n,) time with more asked for than the current limit


def amplifier(
    section: AmplifierSection, current_limit_A: float, step_s: float, groups: int, seed: int
) -> Amplifier:
    """Amplifiers of a current limit (A) for a physics step (s), one a group.

    Offsets are drawn uniformly within their bound, each from a stream of its own.
    """
    drawn = (
        errors(seed, "drive.amplifier", groups, 1)[:, 0] if section.amplifier_offset_V else np.zeros(groups)
    )
    supply_V = inf if section.supply_V is None else section.supply_V
    return Amplifier(
        supplied=section.supply_V is not None,
        highest_V=supply_V - section.drop_up_V,
        lowest_V=section.drop_down_V - supply_V,
        bandwidth_rad_s=section.bandwidth_rad_s,
        current_limit_A=current_limit_A,
        step_s=step_s,
        following=relaxation(section.bandwidth_rad_s * step_s),
        offset_A=section.amplifier_offset_V * section.transconductance_A_V * drawn,
    )


def zero_flow(groups: int) -> Flow:
    """Nothing has passed yet."""
    return Flow(*np.zeros((len(Flow._fields), groups)))


@part_of_its_caller
def reset_sums(flow: Flow) -> None:
    """Begin the sums anew, as at the start of a control period."""
    for j in range(flow.copper_J.shape[0]):
        flow.copper_J[j] = flow.work_J[j] = 0.0
        flow.voltage_limited_s[j] = flow.current_limited_s[j] = 0.0


class Phase(NamedTuple):
    """A stretch of a step in which current and voltage relax with one time constant."""

    current_A: float  # at its end
    charge_As: float
    square_A2s: float
    work_J: float


@part_of_its_caller
def drive_coils(
    amplifier: Amplifier,
    coil: GroupCoils,
    setpoint: NDArray[np.float64],
    emf: NDArray[np.float64],
    current: NDArray[np.float64],
    flow: Flow,
) -> None:
    """Advance the currents by one physics step.

    Parameters
    ----------
    amplifier : Amplifier
    coil : GroupCoils
        Of which the temperatures are left as they are: `coil.warm` carries them on.
    asked : (n,) array, A
        Held over the step. With the amplifier's offset, and within the current limit, it is the target.
        Any number or infinity; where it is not a number, neither is the current from then on.
    emf : (n,) array, V
        Back-EMF, held over the step; beyond `LARGEST_EMF_V`, that.
    current : (n,) array, A
        At the start of the step; on return, at its end.
    flow : Flow
        The mean current is written, the sums are added to.
    """
    h, limit, highest, lowest = (
        amplifier.step_s,
        amplifier.current_limit_A,
        amplifier.highest_V,
        amplifier.lowest_V,
    )
    stiffness = coil.inductance_H * amplifier.bandwidth_rad_s
    for j in range(current.shape[0]):
        unlimited = setpoint[j] + amplifier.offset_A[j]
        target = min(max(unlimited, -limit), limit)
        e = min(max(emf[j], -LARGEST_EMF_V), LARGEST_EMF_V)
        start, R = current[j], coil.resistance_ohm[j]
        volts = R * start + stiffness * (target - start) + e
        last_volts = R * target + e
        if lowest <= volts <= highest and lowest <= last_volts <= highest:
            whole = _phase(amplifier.following, h, start, target, volts, last_volts)
        else:
            whole, limited = _within_limits(amplifier, coil.inductance_H, R, e, target, start)
            flow.voltage_limited_s[j] += limited
        current[j] = whole.current_A
        flow.mean_current_A[j] = whole.charge_As / h
        flow.copper_J[j] += R * whole.square_A2s
        flow.work_J[j] += whole.work_J
        if abs(unlimited) > limit:
            flow.current_limited_s[j] += h


@part_of_its_caller
def _phase(
    shares: Relaxation, duration: float, start: float, last: float, volts: float, last_volts: float
) -> Phase:
    """Integrals over a phase, from current and voltage at its start and those that it would settle at."""
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


@allocation_free
def _within_limits(
    amplifier: Amplifier, inductance_H: float, R: float, e: float, target: float, start: float
) -> tuple[Phase, float]:
    """One step of a group, phase by phase, and the time in it with the voltage at a limit."""
    rate, highest, lowest = amplifier.bandwidth_rad_s, amplifier.highest_V, amplifier.lowest_V
    stiffness = inductance_H * rate
    left, limited = amplifier.step_s, 0.0
    volts = R * start + stiffness * (target - start) + e
    last_volts = R * target + e
    if isnan(volts + last_volts):  # following, the current would not know of the back-EMF
        return Phase(nan, nan, nan, nan), 0.0
    passed = Phase(start, 0.0, 0.0, 0.0)

    if volts > highest or volts < lowest:
        limit = highest if volts > highest else lowest
        last = (limit - e) / R
        # At rest at the limit, the amplifier would ask for as much more as is short of the target.
        duration = _time_to_zero(volts - limit, stiffness * (target - last), inductance_H / R, left)
        passed = _at_limit(passed, limit, last, duration * R / inductance_H, duration)
        left, limited, volts = left - duration, duration, limit
        if left <= 0.0:
            return passed, limited

    limit = highest if last_volts > highest else lowest
    duration = left
    if last_volts > highest or last_volts < lowest:
        duration = _time_to_zero(volts - limit, last_volts - limit, 1.0 / rate, left)
    shares = amplifier.following if duration == amplifier.step_s else relaxation(rate * duration)
    passed = _added(passed, _phase(shares, duration, passed.current_A, target, volts, last_volts))
    left -= duration

    if left > 0.0:
        last = (limit - e) / R
        passed = _at_limit(passed, limit, last, left * R / inductance_H, left)
        limited += left
    return passed, limited


@allocation_free
def _time_to_zero(start: float, last: float, time_constant: float, longest: float) -> float:
    """When what relaxes from `start` towards `last` is 0; `longest` where it is not before that.

    Of one sign it never is, and what is not a number is not either.
    """
    if start <= 0.0 < last or last < 0.0 <= start:
        time = time_constant * log1p(-start / last)
        if time < longest:
            return time
    return longest


@allocation_free
def _at_limit(passed: Phase, limit: float, last: float, x: float, duration: float) -> Phase:
    """Add a phase of x time constants L/R at a limit of the voltage to what has passed."""
    return _added(passed, _phase(relaxation(x), duration, passed.current_A, last, limit, limit))


@part_of_its_caller
def _added(passed: Phase, more: Phase) -> Phase:
    """Two phases as one."""
    return Phase(
        more.current_A,
        passed.charge_As + more.charge_As,
        passed.square_A2s + more.square_A2s,
        passed.work_J + more.work_J,
    )


Array = NDArray[np.float64]


@allocation_free
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
    """Advance the current of one undriven group by a physics step.

    Parameters
    ----------
    contact : int
        `OPEN` or `SHORTED`.
    coil : GroupCoils
        Its temperature is left as it is.
    group : int
    step_s : float, s
    emf_V : float, V
        Back-EMF, held over the step.
    current : (n,) array, A
        At the start of the step; on return, at its end.
    mean : (n,) array, A
        Result: over the step.
    flow : Flow
        The copper loss is added to; nothing passes the coil's ends.
    """
    if contact == OPEN:
        current[group] = mean[group] = 0.0
        return
    R, start = coil.resistance_ohm[group], current[group]
    shares = relaxation(step_s * R / coil.inductance_H)
    last = -min(max(emf_V, -LARGEST_EMF_V), LARGEST_EMF_V) / R
    current[group] = start + shares.settled * (last - start)
    mean[group] = start + shares.mean * (last - start)
    square = (
        shares.start_start * (start * start)
        + shares.start_settled * (2.0 * start * last)
        + shares.settled_settled * (last * last)
    )
    flow.copper_J[group] += step_s * R * square
