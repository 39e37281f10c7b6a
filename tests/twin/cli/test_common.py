"""Common functions of the verbs: JSON, signals, ends; warnings and broken bounds are content."""

import io
import json
import os
import signal
import sys
import time
from typing import NamedTuple
from unittest.mock import Mock

import pytest

from spheretwin import cli
from spheretwin.cli import common, explain
from spheretwin.models.base.checks import Check
from tests.waiting import wait_for


class Peak(NamedTuple):
    angle_deg: float
    others: tuple[float, ...]


GOOD = Check("first", "a", 1, 1.0, 2.0, "reason")


def test_figures_have_json_types(capsys):
    common.print_json(
        {"peak": Peak(1.5, (2.0, float("inf"))), "rows": [GOOD, {"a": float("nan")}], "text": "é"}
    )
    out, err = capsys.readouterr()
    assert err == ""
    assert json.loads(out) == {
        "peak": {"angle_deg": 1.5, "others": [2.0, None]},
        "rows": [GOOD.row(), {"a": None}],
        "text": "é",
    }


def test_the_effect_of_a_second_signal_is_explained_once_and_only_after_the_first(monkeypatch, capfd):
    monkeypatch.setattr(common, "HINT_s", 0.02)
    lines = []

    def has_line():
        lines.extend(capfd.readouterr().err.splitlines())
        return lines

    with common.interruptible() as stop_requested:
        time.sleep(0.05)
        assert not has_line()
        assert not stop_requested()
        os.kill(os.getpid(), signal.SIGTERM)
        wait_for(has_line)
        assert stop_requested()
        time.sleep(0.1)  # a line that repeats would come each 0.02 s
    assert has_line() == [
        "spheretwin: a stop is requested; a second Ctrl-C or SIGTERM ends the process at once"
    ]


def test_ctrl_c_outside_of_a_run_is_one_line_and_exit_1(monkeypatch, capsys):
    stopped = explain.run._replace(run=Mock(side_effect=KeyboardInterrupt, __doc__="Stop."))
    monkeypatch.setattr(explain, "run", stopped)
    assert cli.main(["explain", "seed"]) == cli.FAILED == 1
    assert capsys.readouterr() == ("", "spheretwin: interrupted\n")


def test_a_terminal_without_greek_letters_gets_escapes(monkeypatch):
    written = io.BytesIO()
    monkeypatch.setattr(sys, "stdout", io.TextIOWrapper(written, encoding="ascii"))
    assert cli.main(["explain", "plant.viscous_Nm_s"]) == cli.DONE == 0
    assert b"N\\xb7m\\xb7s" in written.getvalue()


@pytest.mark.parametrize(("before", "after"), [(None, "off"), ("info", "info")])
def test_the_log_of_rerun_is_off_unless_it_was_set(monkeypatch, before, after):
    monkeypatch.setenv("RUST_LOG", before or "")
    if before is None:
        monkeypatch.delenv("RUST_LOG")
    assert cli.main(["explain", "seed"]) == cli.DONE
    assert os.environ["RUST_LOG"] == after
