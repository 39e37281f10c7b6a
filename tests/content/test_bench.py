"""Approved content of the bench's page: every message of the server, and the status of several states."""

import dataclasses
import difflib
import re
from html import unescape
from types import SimpleNamespace
from unittest.mock import patch

import numpy as np
import pytest

from spheretwin.viz.bench import modes_tab, server
from spheretwin.viz.bench.page import FRAMES_A_SETTING, Page
from spheretwin.viz.bench.status_panel import status_html
from tests.content.content import Cases, check
from tests.content.pages import html_text
from tests.content.values import array, number
from tests.viz.bench import fake

IDENTITY = re.compile(r"[0-9a-f]{8}-[0-9a-f]{4}-[0-9a-f]{4}-[0-9a-f]{4}-[0-9a-f]{12}")

LATER = {
    "mode": "point", "running": False, "stopped": True, "law": "pd & <b>c</b>", "t_s": 2.5, "speed": 0.5,
    "realtime_factor": 0.4567, "q_rad": (0.2, 0.1, -0.4), "q_ref_rad": (0.25, 0.15, -0.35),
    "error_mrad": 12.345, "error_deg": 0.7073, "current_A": tuple(3.5 - 0.5 * np.arange(fake.GROUPS)),
    "temperature_C": tuple(20.0 + 1.5 * np.arange(fake.GROUPS)), "torque_margin": 1.75, "saturated": True,
    "status": "failsafe", "reason": "a <p>coil</p> is too hot",
    "faults": ("coil.07 open from 1 s", "supply off"), "active_faults": ("adc <u>noise</u>",),
    "pending": (("plant.engine", "mujoco"), ("seed", "3")), "snapshots": ("last", "before"),
    "recording": ("<s>bench</s>.rrd",), "completed_files": ("a.parquet",), "note": "<em>a</em> note",
    "operator": None, "watching": ("page 1", "page 2"), "asking": ("page 2",),
}  # fmt: skip


REPLAY = {"replay_file": "/other/run.rrd", "replay_range_s": (1.0, 7.0), "t_s": 3.5}
MANUAL_A = (0.0,) * 3 + (1.25,) + (0.0,) * (fake.GROUPS - 4)


class _Names:
    """Names for identities, in the order in which they appear."""

    def __init__(self) -> None:
        self._names: dict[str, str] = {}

    def __call__(self, text: str) -> str:
        return IDENTITY.sub(lambda result: self._names.setdefault(result[0], f"id{len(self._names)}"), text)


def _value(value: object) -> str:
    if dataclasses.is_dataclass(value):
        pairs = ((field.name, getattr(value, field.name)) for field in dataclasses.fields(value))
        return ", ".join(f"{name} {_value(inside)}" for name, inside in pairs if inside is not None)
    if isinstance(value, np.ndarray):
        return array(value)
    if isinstance(value, dict):
        return "{" + ", ".join(f"{name} {_value(inside)}" for name, inside in value.items()) + "}"
    if isinstance(value, tuple | list):
        return f"({', '.join(map(_value, value))})"
    if isinstance(value, float | int | np.number):
        return number(value)
    return repr(unescape(value)) if isinstance(value, str) else repr(value)


def _lines(page: Page, first: int, names: _Names) -> tuple[list[str], int]:
    """Messages of the server from a number on; those that are replaced later are absent."""
    messages = page._server._websock_server._broadcast_buffer.message_from_id
    result = sorted((count, message) for count, message in messages.items() if count >= first)
    lines = []
    for _, message in result:
        fields = {
            name: value for name, value in vars(message).items() if name not in OTHER and value is not None
        }
        lines.append(names(f"{type(message).__name__} {_value(fields)}"))
    return lines, max([first, *(count + 1 for count, _ in result)])


OTHER = ("_cached_redundancy_key", "owner", "counter", "run_id")


def page() -> str:
    """Page of two states: all controls, then the messages that show another state, then another run."""
    bench, names, out = fake.Bench(), _Names(), []
    # Sliders follow the twin at once: how fast this machine is does not matter.
    with patch.object(modes_tab, "UNTOUCHED_S", -1.0), Page(bench, fake.CHOICES, server.listen(0)) as shown:
        lines, count = _lines(shown, 0, names)
        out += ["controls", *lines]
        for title, state in (
            ("first state", {}),
            ("later state", LATER),
            ("another run", {"t_s": 0.5, "mode": "off"}),
            ("jog", {"mode": "jog", "jog_rates_rad_s": (0.0, 0.2, 0.0), "limits": (0.7, 9.0)}),
            ("point of a script", {"mode": "point", "pose_rad": (0.2, -0.3, 0.5)}),
            ("manual", {"mode": "manual", "pose_rad": None, "manual_currents_A": MANUAL_A}),
            ("replay", {"mode": "replay", **REPLAY}),
        ):
            bench.now.__dict__.update(state)
            for step in range(FRAMES_A_SETTING):
                bench.now.t_s += 0.001 * (step > 0)
                bench.now.q_rad = tuple(np.array(bench.now.q_rad) + 0.001)
                shown.draw()
            lines, count = _lines(shown, count, names)
            out += [title, *lines]
    return "\n".join(out)


def statuses() -> str:
    """Status of states that differ in one thing each."""
    changes = [{}, LATER, *({name: value} for name, value in LATER.items()), {"speed": float("inf")}]
    changes += [{"mode": mode} for mode in ("off", "fault", "replay", "manual")]
    changes += [{"torque_margin": margin} for margin in (0.0, 0.04, 0.06, 0.29, 0.31, 1.0, 4.0, float("inf"))]
    changes += [{"error_mrad": error} for error in (99_999.0, 5.82e7)]
    changes += [{"rank_lost": True}, {"operator": "page 1"}, {"status": "diverged"}]
    out: list[str] = []
    base: list[str] = []
    for change in changes:
        state = SimpleNamespace(**{**fake.STATE, **change})
        refused, waits = ("it is refused", "load") if "note" in change else ("", "")
        box = html_text(status_html(state, refused, waits)).splitlines()
        base = base or box
        changed = [line for line in difflib.ndiff(base, box) if line[0] in "+-"] if change else box
        out += [f"{change!r}", *changed]
    return "\n".join(out)


CASES: Cases = {"bench_page": page, "bench_statuses": statuses}


@pytest.mark.parametrize("name", CASES)
def test_content(name):
    # viser counts the elements of all pages of the process.
    with patch("viser._gui_api._global_order_counter", 0):
        check(name, CASES)
