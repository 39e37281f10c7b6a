"""Status of a bench: one immutable snapshot of all that is shown."""

from __future__ import annotations

from dataclasses import dataclass
from math import inf
from typing import Any

import numpy as np

from spheretwin.bench.bench_state import BenchState
from spheretwin.bench.modes import Limits
from spheretwin.faults.fault import Fault, find_target
from spheretwin.models.telemetry.signals import common_signals, width
from spheretwin.models.telemetry.table import Table, rank_lost, saturated
from spheretwin.session import Session
from spheretwin.trajectories.shapes import Hold, Jog

Three = tuple[float, float, float]


@dataclass(frozen=True)
class BenchStatus:
    """Status of a bench at one moment.

    Attributes
    ----------
    mode : str
        ``off``, ``hold``, ``point``, ``trajectory``, ``jog``, ``manual``, ``replay`` or ``fault``.
    running : bool
        Whether time runs.
    stopped : bool
        Whether STOP is latched; only `reset` releases it.
    stop_mode : str
        ``off``: STOP switches the currents off; ``hold``: it holds until the rotor rests, and then does so.
    scenario, law, shape, allocation : str
        Names in the active configuration.
    t_s : float
        Simulated time, s; of a replay, that of its row.
    tick : int
        Control ticks done; of a replay, the row.
    period_s : float
        Control period, s.
    speed : float
        Commanded, as a multiple of the clock's; infinite for as fast as possible.
    realtime_factor : float
        Reached over about the last second; 0 while time is paused.
    chunks, missed : int
        Chunks that had a deadline since the last reset, and the late ones.
    missed_share : float
        The latter over the former; 0 before the first.
    q_rad, qdot_rad_s, q_ref_rad, qdot_ref_rad_s, error_rad : tuple of float
        Hinge angles and rates, the desired ones, and q - q_ref, (3,).
    error_mrad, error_deg : float
        Length of the error.
    torque_command_Nm, torque_Nm, disturbance_Nm : tuple of float
        Generalised torque that the law commands, torque of the coils on the rotor (stator frame), and
        generalised load, (3,).
    current_command_A, current_A : tuple of float
        One for each coil group.
    current_limit_A : float
        Largest current that a group can be commanded.
    temperature_C : tuple of float or None
        Temperatures of the windings, one for each group, if the hardware has them.
    torque_margin : float
        Share of the current limit that remains in the group with the largest commanded current, 0 to 1.
    saturated : bool
        Whether the current limit reduced the commanded torque.
    rank_lost : bool
        Whether the active groups give no torque in one direction, so that no currents are commanded.
    status : str
        Status of the session, as ``running`` or ``left_workspace``.
    reason : str or None
        Why the mode is ``fault``, in one line.
    chatter_A_s : float
        Variation of the commanded currents in the last second, mean over the groups, A/s.
    faults : tuple of str
        Planned and active faults, one line each, in the order of their places.
    active_faults : tuple of str
        Targets and modes of the faults that act now.
    failed_groups : tuple of int
        Coil groups with an active fault.
    limits : Limits
        Limits of the approach to a pose or a shape.
    pose_rad : tuple of float or None
        Pose that the mode ``point`` approaches, (3,).
    jog_rates_rad_s : tuple of float
        Desired rates in the mode ``jog``, (3,); otherwise 0.
    manual_currents_A : tuple of float or None
        Currents of the mode ``manual``, one for each group.
    replay_file : str or None
        File whose rows are shown.
    replay_range_s : (float, float) or None
        Times of its first and its last row, s.
    capture : str
        State of the triggered capture: ``off``, ``armed``, ``triggered`` or ``complete``.
    capture_t_s : float or None
        Time of its event, s.
    pending : tuple of (str, str)
        Fields that the next reset will set, and their values as JSON.
    journal : int
        Changes so far in the present run.
    snapshots : tuple of str
        Names of the snapshots.
    recording : tuple of str
        Files that are being written.
    completed_files : tuple of str
        Files that were written completely so far.
    note : str or None
        Last event without a command, as the reason why a recording ended.
    operator : str or None
        Client whose commands are accepted; None before the first client.
    watching : tuple of str
        The other clients.
    asking : tuple of str
        Watching clients that ask to operate.
    refused : str or None
        The last command that was refused, and why, in one line.
    waiting : int
        Commands that wait for the next chunk.
    """

    mode: str
    running: bool
    stopped: bool
    stop_mode: str
    scenario: str
    law: str
    shape: str
    allocation: str
    t_s: float
    tick: int
    period_s: float
    speed: float
    realtime_factor: float
    chunks: int
    missed: int
    missed_share: float
    q_rad: Three
    qdot_rad_s: Three
    q_ref_rad: Three
    qdot_ref_rad_s: Three
    error_rad: Three
    error_mrad: float
    error_deg: float
    torque_command_Nm: Three
    torque_Nm: Three
    disturbance_Nm: Three
    current_command_A: tuple[float, ...]
    current_A: tuple[float, ...]
    current_limit_A: float
    temperature_C: tuple[float, ...] | None
    torque_margin: float
    saturated: bool
    rank_lost: bool
    status: str
    reason: str | None
    chatter_A_s: float
    faults: tuple[str, ...]
    active_faults: tuple[str, ...]
    failed_groups: tuple[int, ...]
    limits: Limits
    pose_rad: Three | None
    jog_rates_rad_s: Three
    manual_currents_A: tuple[float, ...] | None
    replay_file: str | None
    replay_range_s: tuple[float, float] | None
    capture: str
    capture_t_s: float | None
    pending: tuple[tuple[str, str], ...]
    journal: int
    snapshots: tuple[str, ...]
    recording: tuple[str, ...]
    completed_files: tuple[str, ...]
    note: str | None
    operator: str | None
    watching: tuple[str, ...]
    asking: tuple[str, ...]
    refused: str | None
    waiting: int


VECTORS = (
    "q_rad", "qdot_rad_s", "q_ref_rad", "qdot_ref_rad_s", "error_rad", "torque_command_Nm", "torque_Nm",
    "disturbance_Nm", "current_command_A", "current_A",
)  # fmt: skip


def _of_row(row: Table, limit_A: float) -> dict[str, Any]:
    error_rad = float(np.linalg.norm(row["error_rad"][0]))
    largest_A = float(np.abs(row["current_command_A"][0]).max())
    lost = bool(rank_lost(row)[0])
    return {
        "t_s": float(row["t_s"][0]),
        **{name: tuple(row[name][0].tolist()) for name in VECTORS},
        "error_mrad": 1e3 * error_rad,
        "error_deg": float(np.degrees(error_rad)),
        "temperature_C": tuple(row["coil_temperature_degC"][0].tolist())
        if "coil_temperature_degC" in row
        else None,
        "torque_margin": 0.0 if lost else max(0.0, 1.0 - largest_A / limit_A) if limit_A else 1.0,
        "saturated": bool(saturated(row)[0]),
        "rank_lost": lost,
    }


def _start_row(session: Session) -> Table:
    """Return the row before the first tick: no torque, no current."""
    signals = common_signals(len(session.actuator.groups))
    row = Table(signals, np.zeros((1, width(signals))))
    q_ref_rad, qdot_ref_rad_s, _ = session.scenario.trajectory.sample(np.array([session.t_s]))[0]
    row["t_s"][:], row["allocation_scale"][:] = session.t_s, 1.0
    row["q_rad"][:], row["qdot_rad_s"][:] = session.q_rad, session.qdot_rad_s
    row["q_ref_rad"][:], row["qdot_ref_rad_s"][:] = q_ref_rad, qdot_ref_rad_s
    row["error_rad"][:] = session.q_rad - q_ref_rad
    return row


def bench_status(bench_state: BenchState) -> BenchStatus:
    """Return the present status."""
    driver, recording = bench_state.driver, bench_state.recording
    session = driver.session
    return BenchStatus(
        **_attributes(bench_state, "stop_mode", "note", "refused"),
        **_attributes(driver, "stopped", "reason", "limits"),
        **_attributes(bench_state.pace, "speed", "chunks", "missed", "missed_share"),
        **_attributes(bench_state.operators, "operator", "watching", "asking"),
        **_shown(bench_state),
        **_names(bench_state),
        **_faults(session),
        **_targets(bench_state),
        running=bench_state.is_active,
        realtime_factor=bench_state.pace.realtime_factor(),
        status=str(session.status),
        chatter_A_s=(bench_state.player or bench_state).history.chatter_A_s,
        capture=bench_state.capture.state,
        capture_t_s=bench_state.capture.t_s,
        pending=driver.pending_as_json(),
        journal=len(session.journal),
        snapshots=tuple(driver.snapshots),
        recording=recording.paths,
        completed_files=recording.completed_files,
        waiting=len(bench_state.queue),
    )


def _attributes(part: object, *names: str) -> dict[str, Any]:
    return {name: getattr(part, name) for name in names}


def _shown(bench_state: BenchState) -> dict[str, Any]:
    """Return the row that is shown and its place; before the first row, the start of the session."""
    player, driver = bench_state.player, bench_state.driver
    row: Table | None
    if player:
        row, tick, period_s, limit_A = player.row, player.place, player.period_s, player.current_limit_A
    else:
        row, tick, period_s = driver.row, driver.session.tick, bench_state.period_s
        limit_A = driver.session.scenario.nominal.current_limit_A
    place = {"tick": tick, "period_s": period_s, "current_limit_A": limit_A}
    return place | _of_row(_start_row(driver.session) if row is None else row, limit_A)


def _names(bench_state: BenchState) -> dict[str, Any]:
    """Return the mode and the names in the active configuration; in a replay, those of the recorded run."""
    player, driver, scenario = bench_state.player, bench_state.driver, bench_state.driver.session.scenario
    if player:
        return {"mode": "replay", **_attributes(player, "scenario", "law", "shape", "allocation")}
    return {
        "mode": "fault" if driver.reason is not None else driver.mode,
        "scenario": scenario.name,
        "law": scenario.controller.law,
        "shape": scenario.trajectory.shape,
        "allocation": scenario.allocation,
    }


def _faults(session: Session) -> dict[str, Any]:
    faults = session.scenario.fault
    active = [
        fault for fault in faults if fault.start_s <= session.t_s and session.t_s < (fault.end_s or inf)
    ]
    return {
        "faults": tuple(map(_fault_text, faults)),
        "active_faults": tuple(f"{fault.target} {fault.mode}" for fault in active),
        "failed_groups": tuple(
            sorted({find_target(fault.target)[1] for fault in active if fault.target.startswith("coil.")})
        ),
    }


def _targets(bench_state: BenchState) -> dict[str, Any]:
    """Return the values that a mode follows, as its controls show them."""
    scenario, player = bench_state.driver.session.scenario, bench_state.player
    shape = scenario.trajectory
    return {
        "pose_rad": shape.angle_rad
        if bench_state.driver.mode == "point" and isinstance(shape, Hold)
        else None,
        "jog_rates_rad_s": shape.rate_rad_s if isinstance(shape, Jog) else (0.0, 0.0, 0.0),
        "manual_currents_A": scenario.manual.currents_A,
        "replay_file": str(player.path) if player else None,
        "replay_range_s": player.range_s if player else None,
    }


def _fault_text(fault: Fault) -> str:
    until = f" to {fault.end_s:g} s" if fault.end_s is not None else ""
    return f"{fault.target} {fault.mode} from {fault.start_s:g} s{until}"
