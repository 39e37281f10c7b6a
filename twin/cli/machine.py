"""``spheretwin machine SCENARIO --listen ADDRESS``: the twin as a machine for an external controller."""

from __future__ import annotations

import argparse
from collections.abc import Callable, Sequence
from contextlib import nullcontext
from pathlib import Path
from tempfile import TemporaryDirectory

from spheretwin import scenario as scenarios
from spheretwin.cli.common import interruptible, print_json, print_message
from spheretwin.cli.options import verb
from spheretwin.machine.link import frame_format
from spheretwin.machine.link.admission import LEAST_KEY_BYTES, read_key
from spheretwin.machine.link.channel import FrameChannel
from spheretwin.machine.link.frame_format import DEFAULT_FRAME
from spheretwin.machine.link.machine_link import Link
from spheretwin.machine.link.machine_server import MachineServer
from spheretwin.machine.link.real_time import real_time
from spheretwin.machine.link.rehearsal import FileThread, rehearse
from spheretwin.machine.link.transports import Transport, Udp
from spheretwin.metrics.figures import Figures
from spheretwin.metrics.reduction import PlannedRun
from spheretwin.metrics.tracking import BAND_rad
from spheretwin.models.base.errors import InputError
from spheretwin.models.base.files import check_writable
from spheretwin.models.base.mujoco_library import timers_stopped
from spheretwin.models.telemetry.status import Status
from spheretwin.models.telemetry.table import Sink
from spheretwin.records import outputs
from spheretwin.records.outputs import Outputs
from spheretwin.run import summary
from spheretwin.scenario import reading
from spheretwin.scenario.reading import shipped
from spheretwin.scenario.sections import Scenario
from spheretwin.session import Session
from spheretwin.simulation import follow
from spheretwin.viz.terminal import runs

STANDARD_STREAMS = "-"

FRAME = f"""
    --frame NAME={DEFAULT_FRAME}  frames: {", ".join(frame_format.shipped())}, or a .toml file;
        {DEFAULT_FRAME} unless given
    --key FILE       authenticate the frames by the key in a file, of at least {LEAST_KEY_BYTES} bytes"""

OUTPUTS = f"""{FRAME}
    --record
    --telemetry
    --json
"""
"""Frames and files of a verb with an external part."""


@verb(
    f"""
    [SCENARIO]        {", ".join(shipped())}, or a .toml file
    --listen ADDRESS  udp://HOST:PORT, serial:DEVICE@BAUD, or - for stdin and stdout
    --real-time       advance by the clock; the newest command applies
    --timeout-ms MS=20  in real time: age of a command at which the currents are removed; 20 unless given
    --idle-s S=60     time without commands after which the run ends; 60 unless given{OUTPUTS}""",
    has_fields=True,
    usage="SCENARIO --listen ADDRESS",
)
def run(options: argparse.Namespace) -> bool:
    """Simulate the machine (drive, plant, sensors) for a controller in another program.

    By default each command advances it by one control period (lockstep).
    """
    scenario = read_scenario(options, "listen")
    if scenario.manual.on:
        raise InputError(
            "machine: expected no manual currents, which an external controller replaces, received some"
        )
    groups, key = len(Session(scenario).actuator.groups), read_key(options.key)
    with interruptible() as stop_requested:
        channel = FrameChannel.open(options.listen, options.frame, groups, listening=True, key=key)
        channel.transport.announce = print_message
        try:
            server = MachineServer(
                channel,
                f"a controller at {options.listen}",
                groups,
                scenario.controller.period_s,
                real_time=options.real_time,
                timeout_s=1e-3 * options.timeout_ms,
                idle_s=options.idle_s,
                authenticated=bool(key),
                stop_requested=stop_requested,
            )
            with Session(scenario, external=server.to_stand_in()) as rehearsal:
                rehearse_run(rehearsal, options)  # the controller does not wait for what is done first
            with Session(scenario, external=server) as session:
                print_message(f"listening at {_address(options.listen, channel.transport)}")
                return run_session(
                    session,
                    options,
                    "an external controller",
                    server,
                    lambda: server.finish(session.t_s, session.q_rad),
                )
        finally:
            channel.transport.close()


def read_scenario(options: argparse.Namespace, address: str) -> Scenario:
    """Return the scenario of the command line, whose address and files are valid.

    Raises
    ------
    InputError
        Scenario or address is missing, or a file cannot be written.
    """
    if getattr(options, address) == STANDARD_STREAMS and options.json:
        raise InputError("command line: expected --json without the address -, which uses stdout for frames")
    log = getattr(options, "log", None)
    if log:
        check_writable(log, ".parquet")
    outputs.check(options.record, options.telemetry, [log] if log else ())
    return scenarios.load(options.scenario, reading.overrides(options.fields))


def _address(given: str, transport: Transport) -> str:
    """Return the address of a transport with the port that the system has chosen."""
    return f"{given.rpartition(':')[0]}:{transport.port}" if isinstance(transport, Udp) else given


def rehearse_run(session: Session, options: argparse.Namespace, sinks: Sequence[Sink] = ()) -> None:
    """Run a session with a stand-in to files of the same kinds, which are removed."""
    scenario = session.initial_scenario
    with TemporaryDirectory() as folder:
        record, telemetry = (
            path and Path(folder, Path(path).name) for path in (options.record, options.telemetry)
        )
        figures = Figures(PlannedRun(scenario, session.actuator, scenario.ticks))
        files = Outputs(session, record, telemetry)
        try:
            rehearse(session, [figures, *sinks, FileThread(files.sinks)])
        finally:
            files.close()


def run_session(
    session: Session,
    options: argparse.Namespace,
    law: str,
    part: Link | MachineServer,
    finish: Callable[[], object],
    sinks: Sequence[Sink] = (),
) -> bool:
    """Run a session with an external part to its end, and report it; return True if it completed.

    Parameters
    ----------
    session : Session
    options : Namespace
        Of the command line.
    law : str
        Name of the controller, for the title.
    part : Link or MachineServer
        External part.
    finish : callable
        Called once after the last tick, also after an error.
    sinks : sequence of Sink
        Further receivers of the rows.
    """
    scenario = session.initial_scenario
    figures = Figures(PlannedRun(scenario, session.actuator, scenario.ticks))
    files = Outputs(session, options.record, options.telemetry)
    file_sinks = [FileThread(files.sinks)] if part.real_time else files.sinks
    granted = None
    try:
        with timers_stopped(), real_time() if part.real_time else nullcontext() as granted:
            try:
                all_sinks = [figures, *sinks, *file_sinks]
                status = follow(session, scenario.ticks, all_sinks, short_chunks=True)
            finally:
                finish()
    finally:
        errors = files.close()
    warnings = [*session.warnings(), *figures.warnings()]
    result = {**summary(session, status, figures.values(), warnings), "link": part.figures()}
    if granted:
        result["link"]["real_time"] = granted._asdict()
    why = session.reason.text if session.reason else part.ending or None
    result["reason"] = why
    if options.json:
        print_json(result)
    else:
        runs.print_run(law, scenario.duration, result, band_rad=BAND_rad, why=why)
        runs.print_link(result["link"])
        runs.print_files(files.record, files.telemetry)
    for error in errors:
        print_message(str(error))
    if status != Status.COMPLETED:
        print_message(f"the run ended at {session.t_s:.3f} s of {scenario.duration:g} s: {status}, {why}")
    return status == Status.COMPLETED and not errors
