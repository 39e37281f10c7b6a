"""Status in the bar of the page: badges, numbers and messages, each always in the same place."""

from __future__ import annotations

from html import escape
from math import isinf
from typing import Any

from spheretwin.viz.bench.protocols import NO_REFERENCE

GOOD, WARN, BAD, QUIET, WORKING = "good", "warn", "bad", "quiet", "working"
"""Classes of the style sheet."""

_MODES = {"off": QUIET, "hold": GOOD, "fault": BAD}


def status_html(state: Any, refused: str, waiting_command: str) -> str:
    """Return the status as HTML.

    Parameters
    ----------
    state : BenchStatus
        Status of the bench.
    refused : str
        Last refusal; may be empty.
    waiting_command : str
        Name of the command that is being prepared; may be empty.
    """
    cells = "".join(
        f'<span class="cell" title="{escape(title)}"><i>{name}</i> {value}</span>'
        for name, value, title in _cells(state)
    )
    messages = _messages(state, refused, waiting_command)
    texts = " · ".join(f'<span class="{kind}">{escape(text)}</span>' for kind, text in messages)
    title = escape("\n".join(text for _, text in messages))
    return (
        f'<div class="badges">{"".join(_badges(state))}</div><div class="cells">{cells}</div>'
        f'<div class="messages" title="{title}">{texts}</div>'
    )


def _cells(state: Any) -> list[tuple[str, str, str]]:
    """Return name, value and explanation of each number."""
    speed = "as fast as possible" if isinf(state.speed) or state.speed > 1e3 else f"{state.speed:g}×"
    faults, files = ", ".join(state.active_faults), ", ".join(state.recording)
    digits = ".2f" if state.error_mrad < 1e5 else ".2e"  # γ may turn without an end
    error, explanation = f"{state.error_mrad:{digits}} mrad", f"error: {state.error_deg:.3f}°"
    if state.mode in NO_REFERENCE:
        error, explanation = "–", f"no reference in the mode {state.mode}"
    red, green = BAD if faults else "", GOOD if files else ""
    config = f"scenario {state.scenario}, {state.shape}, {state.allocation}"
    return [
        ("time", f"<b>{state.t_s:.3f} s</b>", "simulated time"),
        ("speed", f"<b>{state.realtime_factor:.2f}×</b>", f"simulated over wall time; commanded: {speed}"),
        ("error |e|", f"<b>{error}</b>", explanation),
        ("torque margin", _bar(state.torque_margin), "remaining share of the current limit"),
        ("chatter", f"<b>{state.chatter_A_s:.1f} A/s</b>", "variation of the commands, mean of the groups"),
        ("missed deadlines", f"<b>{state.missed}</b>", f"late chunks of {state.chunks}"),
        ("faults", f'<b class="{red}">{len(state.active_faults)}</b>', faults or "no active fault"),
        ("recording", f'<b class="{green}">{"on" if files else "off"}</b>', files or "no recording"),
        ("control law", escape(state.law), config),
    ]


def _badges(state: Any) -> list[str]:
    badges = [_badge(state.mode.upper(), _MODES.get(state.mode, WORKING))]
    badges.append(_badge("RUNNING", GOOD) if state.running else _badge("PAUSED", QUIET))
    if state.stopped:
        badges.append(_badge("STOPPED", BAD))
    if state.status == "failsafe":
        badges.append(_badge("FAILSAFE", BAD))
    elif state.reason and state.mode != "fault":
        badges.append(_badge("FAULT", BAD))
    if state.saturated:
        badges.append(_badge("SATURATED", WARN))
    if state.rank_lost:
        badges.append(_badge("RANK LOST", BAD))
    return badges


def _badge(text: str, kind: str) -> str:
    return f'<span class="badge {kind}">{escape(text)}</span>'


def _messages(state: Any, refused: str, waiting_command: str) -> list[tuple[str, str]]:
    """Return kind and text of each message, the most urgent first."""
    messages = [(BAD, state.reason), (BAD, refused), (WARN, state.note)]
    if state.operator is None and state.watching:
        messages.append((WARN, "no client operates: press “Take over”"))
    messages += [(WORKING, f"preparing {waiting_command} …")] if waiting_command else []
    messages += [(WARN, f"at the next reset: {name} = {value}") for name, value in state.pending]
    messages += [(GOOD, f"recording {file}") for file in state.recording]
    messages += [(GOOD, f"written: {file}") for file in state.completed_files]
    return [(kind, str(text)) for kind, text in messages if text]


def _bar(share: float) -> str:
    kind = GOOD if share > 0.3 else WARN if share > 0.05 else BAD
    width = 100 * max(0.0, min(1.0, share))
    return f'<b class="share"><b class="{kind}" style="width:{width:.0f}%"></b></b> {100 * share:.0f} %'
