"""``spheretwin simulate SCENARIO``: run one scenario, headless or live."""

from __future__ import annotations

import argparse
import contextlib
import sys
from collections.abc import Iterator, Mapping, Sequence
from typing import Any

import numpy as np

from spheretwin import scenario as scenarios
from spheretwin.cli.common import interruptible, keep_viewer, print_json, print_message, warn
from spheretwin.cli.options import verb
from spheretwin.machine import export
from spheretwin.machine.twin_file import read_twin
from spheretwin.metrics.figures import Figures
from spheretwin.metrics.reduction import PlannedRun
from spheretwin.metrics.tracking import BAND_rad
from spheretwin.metrics.user_metrics import UserMetric, load_metrics, own_values
from spheretwin.models.base.errors import InputError, SpheretwinError
from spheretwin.models.base.mujoco_library import timers_stopped
from spheretwin.models.telemetry.checksums import NO_CHECKSUMS, has_checksums
from spheretwin.models.telemetry.fault_log import FaultLog
from spheretwin.models.telemetry.joint_state_server import published
from spheretwin.models.telemetry.signals import ANGLES
from spheretwin.models.telemetry.status import Status
from spheretwin.models.telemetry.table import Sink, TelemetryBuffer
from spheretwin.records import outputs, replay
from spheretwin.records.outputs import Outputs
from spheretwin.records.replay import RunPlan
from spheretwin.run import Run, summary
from spheretwin.scenario import reading
from spheretwin.scenario.reading import shipped
from spheretwin.session import Session
from spheretwin.simulation import follow
from spheretwin.viz.layout.view import LIVE_WINDOW_S, OVERVIEW, VIEW_NAMES
from spheretwin.viz.terminal import runs
from spheretwin.viz.terminal.progress import Progress


@verb(
    f"""
    [SCENARIO]               {", ".join(shipped())}, or a .toml file
    --record
    --record-rate HZ         rows per second of the recording; default: all
    --telemetry
    --live                   run in real time, with a viewer on 127.0.0.1
    --live-window S          time that the live plots show; default: {LIVE_WINDOW_S:g} s
    --publish PORT           run in real time, with data for Foxglove and ROS 2
    --view TAB               first tab of the recording: {", ".join(VIEW_NAMES)}
    --replay RUN.parquet     replay the run of a telemetry file
    --twin
    --export-log FILE        write what a laboratory would record (.parquet)
    --export-truth FILE      write true parameters (.json) and states (.parquet)
    --metric FILE.py:NAME...  own metric: a function of the run; repeatable
    --json
    """,
    has_fields=True,
    usage="[SCENARIO]",
    needs={"--view": "--record --live", "--live-window": "--live"},
    view=VIEW_NAMES,
)
def run(options: argparse.Namespace) -> bool:
    """Run a scenario.

    Any field of it is a flag: --controller.law pd
    """
    rest: list[str] = options.fields
    if _is_bare(options, rest):
        runs.print_scenarios({name: scenarios.load(name).description for name in shipped()})
    plan = _planned(options, rest)
    own = load_metrics(options.metric)
    exported = export.check_paths(options.export_log, options.export_truth)
    outputs.check(options.record, options.telemetry, exported)
    outputs.check_rate(options.record_rate, options.record, plan.scenario.controller.period_s)
    with (
        interruptible() as stop_requested,
        published(options.publish) as publishers,
        Session(plan.scenario) as session,
    ):
        figures = Figures(PlannedRun(session.initial_scenario, session.actuator, plan.ticks))
        progress = Progress(plan.scenario.name, plan.ticks)
        faults = FaultLog()
        telemetry = TelemetryBuffer(session.signals, plan.ticks) if own else None
        sinks: list[Sink] = [progress, figures, faults, *([telemetry] if telemetry else [])]
        files = Outputs(
            session,
            options.record,
            options.telemetry,
            options.live,
            options.view or OVERVIEW,
            options.record_rate,
            plan.first_tick,
            options.live_window or LIVE_WINDOW_S,
            replay_of=options.replay.name if options.replay else "",
        )
        log_files = export.Export(session, options.export_log, options.export_truth)
        try:
            with progress, timers_stopped(), _code_of_the_user(session, options.json):
                status = follow(
                    session,
                    plan.ticks,
                    [*sinks, *files.sinks, *log_files.sinks, *publishers],
                    journal=plan.journal,
                    live=options.live or options.publish is not None,
                    stop_requested=stop_requested,
                )
            values, own_faults = _own_values(own, session, status, telemetry)
            warnings = [*session.warnings(), *figures.warnings(), *own_faults]
            run_summary = summary(session, status, {**figures.values(), **values}, warnings)
            if options.json:
                print_json(run_summary)
            else:
                _print_results(session, plan, status, run_summary, tuple(values), faults)
            if status != Status.COMPLETED:
                print_message(_ending(session, plan, status))
            if options.live:
                keep_viewer(stop_requested)
        finally:
            file_errors = [*files.close(), *log_files.close()]
            _report_files(files, log_files, file_errors, options.json)
    return status == Status.COMPLETED and not file_errors and not own_faults


def _fault_lines(session: Session, log: FaultLog) -> list[str]:
    """Return a line for each fault: start and detection, or that the run ended before its start."""
    late = [fault for fault in session.initial_scenario.fault if fault.start_s >= session.t_s]
    return [fault.text() for fault in log.faults] + [
        f"{fault.target} {fault.mode} from {fault.start_s:.3f} s: not started, the run ended before"
        for fault in late
    ]


def _own_values(
    own: Mapping[str, UserMetric], session: Session, status: Status, telemetry: TelemetryBuffer | None
) -> tuple[dict[str, Any], list[str]]:
    """Return the values of user functions, and a line for each that failed."""
    if telemetry is None:
        return {}, []
    run = Run(session.initial_scenario, status, telemetry.table, session.loop_s, session.actuator)
    with contextlib.redirect_stdout(sys.stderr):  # stdout is only for the figures
        return own_values(own, run)


def _is_bare(options: argparse.Namespace, rest: Sequence[str]) -> bool:
    """True if no argument was given."""
    chosen = (
        options.record, options.telemetry, options.replay, options.metric, options.live, options.json,
        options.export_log, options.export_truth,
    )  # fmt: skip
    return options.scenario is None and not any(chosen) and not rest


def _planned(options: argparse.Namespace, rest: Sequence[str]) -> RunPlan:
    """Return the run plan, from a scenario and flags or from the file of a run."""
    if options.replay:
        if options.scenario or rest or options.twin:
            received = " ".join([*filter(None, [options.scenario, options.twin and "--twin"]), *rest])
            raise InputError(
                f"command line: expected --replay without scenario and fields, received {received}"
            )
        plan = replay.read(options.replay)
        if not has_checksums(options.replay):
            warn([f"{options.replay} {NO_CHECKSUMS}"])
        return plan
    if options.scenario is None:
        raise InputError(f"command line: expected a scenario ({', '.join(shipped())}), received none")
    twin = read_twin(options.twin) if options.twin else {}
    scenario = scenarios.load(options.scenario, {**twin, **reading.overrides(rest)})
    return RunPlan(scenario, scenario.ticks, ())


def _print_results(
    session: Session,
    plan: RunPlan,
    status: Status,
    run_summary: dict[str, Any],
    own: Sequence[str],
    faults: FaultLog,
) -> None:
    """Print the results of the run as tables and lines."""
    runs.print_run(
        session.initial_scenario.controller.law,
        _planned_s(plan),
        run_summary,
        own,
        band_rad=BAND_rad,
        faults=_fault_lines(session, faults),
        why=_reason(session, status),
    )


def _planned_s(plan: RunPlan) -> float:
    return plan.ticks * plan.scenario.controller.period_s


def _report_files(
    files: Outputs, log_files: export.Export, errors: Sequence[SpheretwinError], as_json: bool
) -> None:
    """Print the paths of the complete files and the errors of the others."""
    if not as_json:
        runs.print_files(files.record, files.telemetry)
        runs.print_written(log_files.written)
    for error in errors:
        print_message(str(error))


@contextlib.contextmanager
def _code_of_the_user(session: Session, as_json: bool) -> Iterator[None]:
    """Raise the exception of a user law after the run; redirect its output away from the JSON."""
    with contextlib.redirect_stdout(sys.stderr) if as_json else contextlib.nullcontext():
        yield
    if session.law_error:
        raise session.law_error


def _ending(session: Session, plan: RunPlan, status: Status) -> str:
    if session.tick == 0:
        return f"the run ended before its first tick was complete: {status}"
    reason = _reason(session, status)
    why = f", {reason}" if reason else ""
    pose = ", ".join(
        f"{name} {angle:.1f}°" for name, angle in zip(ANGLES, np.degrees(session.q_rad), strict=True)
    )
    return f"the run ended at {session.t_s:.3f} s of {_planned_s(plan):g} s: {status}{why} ({pose})"


def _reason(session: Session, status: Status) -> str | None:
    """Return the reason for which a run ended early; for the workspace, the hinge and its range."""
    if status == Status.LEFT_WORKSPACE:
        q_deg, range_deg = np.degrees(session.q_rad), np.degrees(session.actuator.hinge_range_rad)
        return "; ".join(
            f"{name} reached the end of its range, {low:.4g}° to {high:.4g}°"
            for name, angle, (low, high) in zip(ANGLES, q_deg, range_deg, strict=True)
            if not low <= angle <= high
        )
    return session.reason.text if session.reason else None
