"""Checks and other tables as a person reads them, in a wide terminal and in a narrow one."""

import numpy as np
import pytest

from spheretwin.models.base.check import Check
from spheretwin.viz.terminal import style
from spheretwin.viz.terminal.checks import print_checks

CHECKS = [
    Check("mesh [1]", "this mesh with that", 3, 1e-6, 5e-3, "as much as is known"),
    Check("need", "what is wanted over what there is", 7, 2.0, 1.0, "asked for"),
    Check("trace", "two runs", 5000, np.nan, None, "no bound", unit="rad"),
]


@pytest.fixture
def printed(monkeypatch, capsys):
    def lines(columns):
        monkeypatch.setenv("COLUMNS", str(columns))
        print_checks("magnetics check", CHECKS)
        return capsys.readouterr().out.splitlines()

    return lines


def row(lines, name):
    (line,) = (line for line in lines if line.lstrip().startswith(name))
    return line.split()


def test_a_narrow_terminal_has_one_line_a_check(printed):
    lines = printed(80)
    assert lines[0].rstrip() == "magnetics check"
    assert row(lines, "mesh") == ["mesh", "[1]", "3", "1.00e-06", "≤", "5.00e-03"]
    assert row(lines, "need") == ["need", "7", "2", "BROKEN", "≤", "1"]
    assert row(lines, "trace") == ["trace", "5000", "nan", "rad", "reported"]
    assert "2 of 3 checks hold" in lines
    assert "wider terminal" in lines[-1]
    assert not any("as much as is known" in line for line in lines)


def test_a_wide_terminal_says_what_is_compared_and_why(printed):
    lines = printed(120)
    for text in (
        "this mesh with that",
        "as much as is known",
        "what is wanted over what there is",
        "no bound",
    ):
        assert any(text in line for line in lines)
    assert lines[-1] == "2 of 3 checks hold"
    assert max(len(line) for line in lines) <= 120


def test_a_file_is_as_wide_as_reasons_need(monkeypatch, capsys):
    monkeypatch.delenv("COLUMNS", raising=False)
    assert style.console().width == style.WIDTH_WITHOUT_TERMINAL
    print_checks("magnetics check", CHECKS)
    assert "as much as is known" in capsys.readouterr().out


def test_a_title_is_not_wrapped_to_a_narrow_table(monkeypatch, capsys):
    monkeypatch.setenv("COLUMNS", "80")
    table = style.table("a title much wider than its table [is]", "a", "b")
    table.add_row("1", "2")
    style.console().print(table)
    assert capsys.readouterr().out.splitlines()[0].rstrip() == "a title much wider than its table [is]"
