"""``spheretwin drive SCENARIO --machine ADDRESS``: our controller on a machine."""

from __future__ import annotations

import argparse
import math
from collections.abc import Callable
from typing import Any

from spheretwin.cli.common import interruptible, print_message, warn
from spheretwin.cli.machine import OUTPUTS, read_scenario, rehearse_run, run_session
from spheretwin.cli.options import from_zero, number, verb
from spheretwin.machine.export import LogFile
from spheretwin.machine.link.admission import read_key
from spheretwin.machine.link.controller_scenario import left_out
from spheretwin.machine.link.limits import LinkSettings, MachineLimits
from spheretwin.machine.link.machine_link import Link
from spheretwin.machine.link.stream import RunningShadow
from spheretwin.machine.log import conditions_of
from spheretwin.machine.state_estimation import Shadow
from spheretwin.models.base.files import check_writable
from spheretwin.scenario.reading import shipped
from spheretwin.scenario.sections import ResolvedScenario, Scenario
from spheretwin.session import Session

DEFAULTS = LinkSettings()
DEFAULT_LIMITS = MachineLimits(current_A=1.0)
LOCKSTEP_TIMEOUT_s = 1.0


LINK = f"""
    --arm            send currents
    --lockstep       wait for the reply of the machine in each tick, not for the clock
    --ramp-s S       time in which the currents rise to those commanded; {DEFAULTS.ramp_s:g} unless given
    --timeout-ms MS  age of the newest measurement at which the currents are removed;
        {1e3 * DEFAULTS.timeout_s:g}, in lockstep {1e3 * LOCKSTEP_TIMEOUT_s:g} unless given
    --limit-current-A A  largest current of a group; nominal.current_limit_A unless given
    --limit-angle-deg DEG  largest tilt, the magnitude of α and β; the range of the hinges unless given
    --limit-rate-rad-s RAD/S  largest rate of a hinge; watchdog.largest_rate_rad_s unless given
    --limit-temperature-degC DEGC  highest temperature of a coil, reported or estimated from the currents;
        {DEFAULT_LIMITS.temperature_degC:g} unless given
    --limit-frozen-ticks N  identical measurements in a row, if noise is expected;
        {DEFAULT_LIMITS.frozen_ticks} unless given
    --limit-chi2 X   mean square of the innovations of 20 ticks over that expected by the model;
        {DEFAULT_LIMITS.chi2:g} unless given"""
"""Options of how a machine is driven."""

LIMITS: dict[str, Any] = {
    "ramp_s": number("a number of s from 0 on", from_zero),
    "limit_angle_deg": number("a number of ° above 0"),
    "limit_rate_rad_s": number("a number of rad/s above 0"),
    "limit_temperature_degC": number("a number of °C above 0"),
    "limit_chi2": number("a number above 0"),
    "limit_frozen_ticks": number("a whole number from 2 on", lambda value: value >= 2 and value % 1 == 0),
}


@verb(
    f"""
    [SCENARIO]         {", ".join(shipped())}, or a .toml file
    --machine ADDRESS  udp://HOST:PORT, serial:DEVICE@BAUD, or - for stdin and stdout{LINK}
    --shadow FILE.parquet  write what the shadow estimates in parallel
    --log LOG.parquet      write currents and angles as a log{OUTPUTS}""",
    has_fields=True,
    usage="SCENARIO --machine ADDRESS",
    **LIMITS,
)
def run(options: argparse.Namespace) -> bool:
    """Drive a machine with the controller of a scenario.

    Without --arm it is a dry run: frames are exchanged and shown, and all currents are 0.
    """
    scenario = limited_rate(read_scenario(options, "machine"), options.limit_rate_rad_s)
    warn(left_out(scenario))
    shadow = RunningShadow(Shadow(scenario)) if options.shadow else None
    if shadow:
        check_writable(options.shadow, ".parquet")
    period_s, conditions = scenario.controller.period_s, conditions_of(scenario.plant.payload_kg)
    with (
        interruptible() as stop_requested,
        open_link(options, scenario, stop_requested, shadow=shadow) as link,
    ):

        def logs() -> list[LogFile]:
            return [LogFile(options.log, link.late_ticks, period_s, conditions)] if options.log else []

        session = link.session(scenario, lambda stand_in: rehearse_run(stand_in, options, logs()))
        log = logs()

        def finish() -> None:
            link.release()
            for file in log:
                file.close()
            if shadow and (estimates := shadow.telemetry()):
                estimates.write_parquet(options.shadow, {"log": "link"})
                print_message(f"shadow: {shadow.shadow.verdict().text()}")

        with session:
            return run_session(session, options, scenario.controller.law, link, finish, log)


def open_link(
    options: argparse.Namespace, scenario: Scenario, stop_requested: Callable[[], bool], **more: Any
) -> Link:
    """Return the link to the machine of the command line; without --arm, the first frames are printed.

    Raises
    ------
    InputError
        Address, frames or a limit cannot be used.
    """
    with Session(scenario) as complete:
        limits = _limits(options, complete.scenario)
    return Link.open(
        options.machine,
        scenario,
        _settings(options),
        limits,
        frame=options.frame,
        key=read_key(options.key),
        report=None if options.arm else print_message,
        stop_requested=stop_requested,
        **more,
    )


def _settings(options: argparse.Namespace) -> LinkSettings:
    timeout_s = LOCKSTEP_TIMEOUT_s if options.lockstep else DEFAULTS.timeout_s
    if options.timeout_ms is not None:
        timeout_s = 1e-3 * options.timeout_ms
    return LinkSettings(
        armed=options.arm,
        lockstep=options.lockstep,
        timeout_s=timeout_s,
        ramp_s=DEFAULTS.ramp_s if options.ramp_s is None else options.ramp_s,
    )


def _limits(options: argparse.Namespace, scenario: ResolvedScenario) -> MachineLimits:
    given = {
        "tilt_rad": None if options.limit_angle_deg is None else math.radians(options.limit_angle_deg),
        "temperature_degC": options.limit_temperature_degC,
        "frozen_ticks": options.limit_frozen_ticks and int(options.limit_frozen_ticks),
        "chi2": options.limit_chi2,
        "current_A": options.limit_current_A or scenario.nominal.current_limit_A,
    }
    return MachineLimits(**{name: value for name, value in given.items() if value is not None})


def limited_rate(scenario: Scenario, rate_rad_s: float | None) -> Scenario:
    """Return a scenario whose watchdog has the largest rate of the command line, if that states one."""
    if rate_rad_s is None:
        return scenario
    watchdog = scenario.watchdog.model_copy(update={"largest_rate_rad_s": rate_rad_s})
    return scenario.model_copy(update={"watchdog": watchdog})
