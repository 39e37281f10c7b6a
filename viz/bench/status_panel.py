"""Status panel, which is always in view: text, figures and colours."""

from __future__ import annotations

from html import escape
from math import isinf
from typing import Any

import numpy as np

from spheretwin.viz import theme

GOOD, WARN, BAD, QUIET = "#40c057", "#fab005", "#fa5252", "#868e96"

TAKE_OVER = "Take over"
"""Label of the button of a watching page while no client operates."""

_MODES = {"off": QUIET, "hold": GOOD, "fault": BAD, "replay": "#4dabf7"}
_WORKING = "#4dabf7"

_BOX = "padding:0.45em 0.8em;font-size:0.86em;line-height:1.35;color:#e9ecef;overflow-wrap:anywhere"
_LARGE = "font-size:1.25em;font-weight:700;font-variant-numeric:tabular-nums"
_TABLE = "display:grid;grid-template-columns:auto 1fr;column-gap:0.8em;font-variant-numeric:tabular-nums"


def status_html(state: Any, refused: str, waiting_command: str) -> str:
    """Return the status box as HTML.

    Parameters
    ----------
    state : State
        Status of the bench.
    refused : str
        Last refusal; may be empty.
    waits_for : str
        The command that is being prepared; may be empty.
    """
    speed = "as fast as possible" if isinf(state.speed) or state.speed > 1e3 else f"{state.speed:g}×"
    rows = [
        ("time", f"<b>{state.t_s:.3f} s</b>"),
        ("speed", f"{speed}, reached <b>{state.realtime_factor:.2f}×</b>"),
        ("|e|", f"<b>{state.error_mrad:.2f} mrad</b> = {state.error_deg:.3f}°"),
        ("margin", _bar(state.torque_margin)),
        ("law", f"{escape(state.law)}, {escape(state.scenario)}"),
        ("missed", f"{state.missed} of {state.chunks}"),
    ]
    table = "".join(f'<span style="color:{QUIET}">{name}</span><span>{value}</span>' for name, value in rows)
    return (
        f'<div style="{_BOX}" data-bench="status">'
        f'<div style="{_LARGE}">{_badge(state.mode.upper(), _MODES.get(state.mode, _WORKING))}'
        f"{_run_badge(state)}{''.join(_alarms(state))}</div>{_operator_hint(state)}"
        f'<div style="{_TABLE}">{table}</div>{_lines(state, refused, waiting_command)}</div>'
    )


def scale_html(limit_A: float) -> str:
    """Return the colour scale of the currents, from least to greatest."""
    at = np.linspace(-1.0, 1.0, 17)
    stops = ",".join("rgb({},{},{})".format(*colour) for colour in theme.current_colours(at, 1.0).tolist())
    return (
        f'<div style="padding:0.2em 0.8em;font-size:0.78em;color:{QUIET}">'
        f'<div style="height:0.7em;border-radius:3px;background:linear-gradient(90deg,{stops})"></div>'
        f'<div style="display:flex;justify-content:space-between"><span>−{limit_A:g} A</span><span>0</span>'
        f"<span>{limit_A:g} A</span></div></div>"
    )


def currents_html(
    current_A: tuple[float, ...], limit_A: float, temperature_C: tuple[float, ...] | None
) -> str:
    """Return a bar for each group, up for positive currents, and the warmest winding."""
    limit = limit_A or max(map(abs, current_A)) or 1.0
    colours = theme.current_colours(np.array(current_A), limit).tolist()
    bars = "".join(
        _upright(current / limit, "rgb({},{},{})".format(*colour))
        for current, colour in zip(current_A, colours, strict=True)
    )
    warmest = f", {max(temperature_C):.1f} °C" if temperature_C else ""
    peak = max(map(abs, current_A))
    return (
        f'<div style="padding:0.2em 0.8em;font-size:0.78em;color:{QUIET}">'
        f"currents, at most {peak:.2f} A{warmest}"
        f'<div style="display:flex;gap:2px;height:3.6em;margin-top:0.2em;border-top:1px solid #495057;'
        f'border-bottom:1px solid #495057">{bars}</div></div>'
    )


def _upright(share: float, colour: str) -> str:
    height = 50 * min(1.0, abs(share))
    top = 50 - height if share > 0 else 50
    return (
        '<div style="flex:1;position:relative">'
        f'<div style="position:absolute;left:0;right:0;top:{top:.0f}%;height:{height:.0f}%;'
        f'background:{colour}"></div></div>'
    )


def _badge(text: str, colour: str) -> str:
    return (
        f'<span style="background:{colour};color:#101113;border-radius:4px;padding:0 0.4em;'
        f'margin-right:0.35em;white-space:nowrap">{escape(text)}</span>'
    )


def _run_badge(state: Any) -> str:
    return _badge("RUNS", GOOD) if state.running else _badge("PAUSED", QUIET)


def _operator_hint(state: Any) -> str:
    if state.operator is not None or not state.watching:
        return ""
    return f'<div style="color:{WARN}">No client operates: press “{TAKE_OVER}”.</div>'


def _alarms(state: Any) -> list[str]:
    alarms = []
    if state.stopped:
        alarms.append(_badge("STOPPED", BAD))
    if state.status == "failsafe":
        alarms.append(_badge("FAILSAFE", BAD))
    elif state.reason and state.mode != "fault":
        alarms.append(_badge("FAULT", BAD))
    if state.saturated:
        alarms.append(_badge("SATURATED", WARN))
    if state.rank_lost:
        alarms.append(_badge("RANK LOST", BAD))
    return alarms


def _lines(state: Any, refused: str, waiting_command: str) -> str:
    lines = [(BAD, state.reason), (BAD, refused), (WARN, state.note)]
    lines += [(_WORKING, f"preparing {waiting_command} …")] if waiting_command else []
    lines += [(WARN, f"at the next reset: {name} = {value}") for name, value in state.pending]
    lines += [(GOOD, f"recording {file}") for file in state.recording]
    return "".join(f'<div style="color:{colour}">{escape(str(text))}</div>' for colour, text in lines if text)


def _bar(share: float) -> str:
    colour = GOOD if share > 0.3 else WARN if share > 0.05 else BAD
    return (
        '<span style="display:inline-block;width:6em;height:0.6em;background:#373a40;border-radius:3px">'
        f'<span style="display:block;width:{100 * max(0.0, min(1.0, share)):.0f}%;height:100%;'
        f'background:{colour};border-radius:3px"></span></span> {100 * share:.0f} %'
    )
