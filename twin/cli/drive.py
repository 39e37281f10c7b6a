"""``spheretwin drive SCENARIO --machine ADDRESS``: our controller on a machine."""

from __future__ import annotations

import argparse
import math
from collections.abc import Callable
from pathlib import Path
from typing import Any

from spheretwin.cli.common import interruptible, print_message, warn
from spheretwin.cli.machine import add_common_options, read_scenario, run_session
from spheretwin.cli.options import Parser, number
from spheretwin.machine.files import conditions_of
from spheretwin.machine.link.controller_scenario import left_out
from spheretwin.machine.link.limits import Limits
from spheretwin.machine.link.log_file import LogFile
from spheretwin.machine.link.machine_link import Link, LinkSettings
from spheretwin.machine.link.stream import RunningShadow
from spheretwin.machine.state_estimation import Shadow
from spheretwin.models.base.files import check_writable
from spheretwin.scenario.reading import shipped
from spheretwin.scenario.sections import ResolvedScenario, Scenario
from spheretwin.session import Session

DEFAULTS = LinkSettings()
LOCKSTEP_TIMEOUT_s = 1.0


def declare(parser: Parser) -> None:
    """Declare the arguments of the verb."""
    parser.description = (
        "Drive a machine with the controller of a scenario. Without --arm it is a dry run: frames are"
        " exchanged and shown, and all currents are 0."
    )
    parser.usage = "spheretwin drive SCENARIO --machine ADDRESS [options] [--section.field VALUE ...]"
    parser.add_argument("scenario", help=f"{', '.join(shipped())}, or a .toml file")
    add_link_options(parser, "udp://HOST:PORT, serial:DEVICE@BAUD, or - for stdin and stdout")
    parser.add_argument(
        "--shadow", type=Path, metavar="FILE.parquet", help="write what the shadow estimates in parallel"
    )
    parser.add_argument("--log", type=Path, metavar="LOG.parquet", help="write currents and angles as a log")
    add_common_options(parser)
    parser.set_run(run, has_fields=True)


def add_link_options(parser: Parser, address: str, *, listed: bool = True) -> None:
    """Declare the address of a machine, with its help, and how it is driven.

    The help leaves out how it is driven unless that is `listed`.
    """
    parser.add_argument("--machine", metavar="ADDRESS", help=address)
    for flag, text in (
        ("--arm", "send currents"),
        ("--lockstep", "wait for the reply of the machine in each tick, not for the clock"),
    ):
        parser.add_argument(flag, action="store_true", help=text if listed else argparse.SUPPRESS)
    for flag, unit, text in (
        ("--ramp-s", "s", f"time in which the currents rise to those commanded; {DEFAULTS.ramp_s:g}"),
        (
            "--timeout-ms",
            "ms",
            f"age of the newest measurement at which the currents are removed;"
            f" {1e3 * DEFAULTS.timeout_s:g}, in lockstep {1e3 * LOCKSTEP_TIMEOUT_s:g}",
        ),
        ("--limit-current-A", "A", "largest current of a group; nominal.current_limit_A"),
        ("--limit-angle-deg", "°", "largest tilt, the magnitude of α and β; the range of the hinges"),
        ("--limit-rate-rad-s", "rad/s", "largest rate of a hinge; watchdog.largest_rate_rad_s"),
        (
            "--limit-temperature-degC",
            "°C",
            "highest temperature of a coil, reported or estimated from the currents;"
            f" {Limits(current_A=1.0).temperature_degC:g}",
        ),
    ):
        bound = "from 0 on" if flag == "--ramp-s" else "above 0"
        parser.add_argument(
            flag,
            type=number(f"a number of {unit} {bound}", _from_zero if flag == "--ramp-s" else _above_zero),
            metavar=unit.upper().replace("°", "DEG"),
            help=f"{text} unless given" if listed else argparse.SUPPRESS,
        )


def _from_zero(value: float) -> bool:
    return value >= 0


def _above_zero(value: float) -> bool:
    return value > 0


def run(options: argparse.Namespace) -> bool:
    """Run the verb; return True if the run completed."""
    scenario = limited_rate(read_scenario(options, "machine"), options.limit_rate_rad_s)
    warn(left_out(scenario))
    shadow = RunningShadow(Shadow(scenario)) if options.shadow else None
    if shadow:
        check_writable(options.shadow, ".parquet")
    with (
        interruptible() as stop_requested,
        open_link(options, scenario, stop_requested, shadow=shadow) as link,
        link.session(scenario) as session,
    ):
        period_s, conditions = scenario.controller.period_s, conditions_of(scenario.plant.payload_kg)
        log = LogFile(options.log, link.late_ticks, period_s, conditions) if options.log else None

        def finish() -> None:
            link.release()
            if log:
                log.close()
            if shadow and (estimates := shadow.telemetry()):
                estimates.write_parquet(options.shadow, {"log": "link"})
                print_message(f"shadow: {shadow.shadow.verdict().text()}")

        law, sinks = scenario.controller.law, [log] if log else []
        return run_session(session, options, law, link.figures, lambda: link.ending, finish, sinks)


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


def _limits(options: argparse.Namespace, scenario: ResolvedScenario) -> Limits:
    given = {
        "tilt_rad": None if options.limit_angle_deg is None else math.radians(options.limit_angle_deg),
        "temperature_degC": options.limit_temperature_degC,
        "current_A": options.limit_current_A or scenario.nominal.current_limit_A,
    }
    return Limits(**{name: value for name, value in given.items() if value is not None})


def limited_rate(scenario: Scenario, rate_rad_s: float | None) -> Scenario:
    """Return a scenario whose watchdog has the largest rate of the command line, if that states one."""
    if rate_rad_s is None:
        return scenario
    watchdog = scenario.watchdog.model_copy(update={"largest_rate_rad_s": rate_rad_s})
    return scenario.model_copy(update={"watchdog": watchdog})
