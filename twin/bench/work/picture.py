"""The picture of a bench: all that is shown of its parts, as they are now."""

from __future__ import annotations

from typing import Any

from spheretwin.twin.bench.state import Shown, State, pictured
from spheretwin.twin.bench.work.works import Works
from spheretwin.twin.faults.fault import Fault


def picture(works: Works) -> State:
    """All that is shown, as it is now."""
    desk, operators, pace, recording = works.desk, works.operators, works.pace, works.recording
    session = desk.session
    return pictured(
        _shown(works),
        session,
        **_names(works),
        running=works.moves,
        stopped=desk.stopped,
        speed=pace.speed,
        realtime_factor=pace.reached(),
        chunks=pace.chunks,
        missed=pace.missed,
        missed_share=pace.missed_share,
        status=str(session.status),
        reason=desk.reason,
        faults=tuple(_fault_told(fault) for fault in session.scenario.fault),
        pending=desk.pending_told(),
        journal=len(session.journal),
        snapshots=tuple(desk.snapshots),
        recording=recording.paths,
        kept=recording.kept,
        note=works.note,
        operator=operators.operator,
        watching=operators.watching,
        asking=operators.asking,
        refused=works.refused,
        waiting=len(works.queue),
    )


def _shown(works: Works) -> Shown:
    player, desk = works.player, works.desk
    if player:
        return Shown(player.row, player.place, player.period_s, player.current_limit_A)
    limit_A = desk.session.scenario.nominal.current_limit_A
    return Shown(desk.row, desk.session.tick, works.period_s, limit_A)


def _names(works: Works) -> dict[str, Any]:
    """The mode, and what is in force: of the recorded run while one is played back."""
    player, desk, scenario = works.player, works.desk, works.desk.session.scenario
    if player:
        return {
            "mode": "replay",
            "scenario": player.name,
            "law": player.law,
            "shape": player.shape,
            "allocation": player.allocation,
        }
    return {
        "mode": "fault" if desk.reason is not None else desk.mode,
        "scenario": scenario.name,
        "law": scenario.controller.law,
        "shape": scenario.trajectory.shape,
        "allocation": scenario.allocation,
    }


def _fault_told(fault: Fault) -> str:
    until = f" to {fault.end_s:g} s" if fault.end_s is not None else ""
    return f"{fault.target} {fault.mode} from {fault.start_s:g} s{until}"
