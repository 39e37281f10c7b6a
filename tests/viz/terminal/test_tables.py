"""Checks and other tables in a wide and in a narrow terminal."""

import numpy as np
import pytest

from spheretwin.models.base.checks import Check
from spheretwin.viz.terminal import tables
from spheretwin.viz.terminal.tables import print_checks

CHECKS = [
    Check("mesh [1]", "this mesh with that", 3, 1e-6, 5e-3, "as much as is known"),
    Check("need", "what is wanted over what there is", 7, 2.0, 1.0, "asked for"),
    Check("trace", "two runs", 5000, np.nan, None, "no bound", unit="rad"),
]


@pytest.fixture
def printed(monkeypatch, capsys):
    def lines(verbose):
        monkeypatch.setenv("COLUMNS", "80")
        print_checks("magnetics check", CHECKS, verbose)
        return [line.rstrip() for line in capsys.readouterr().out.splitlines()]

    return lines


def row(lines, name):
    (line,) = (line for line in lines if line.endswith(f"{name:8} |"))
    return [cell.strip() for cell in line.strip("|").split("|")]


def test_a_check_is_a_line_with_its_verdict(printed):
    lines = printed(verbose=False)
    assert lines[0] == "magnetics check"
    assert row(lines, "mesh [1]") == ["holds", "1.00e-06", "≤ 5.00e-03", "mesh [1]"]
    assert row(lines, "need") == ["BROKEN", "2", "≤ 1", "need"]
    assert row(lines, "trace") == ["", "nan rad", "reported", "trace"]
    assert "2 of 3 checks hold" in lines
    assert "--verbose" in lines[-1]
    assert not any("as much as is known" in line for line in lines)


def test_verbose_checks_explain_comparison_and_bound(printed):
    lines = printed(verbose=True)
    where = lines.index("mesh [1], 3 states")
    assert lines[where + 1] == "compares: this mesh with that"
    assert lines[where + 2] == "bound ≤ 5.00e-03: as much as is known"
    for text in ("what is wanted over what there is", "no bound"):
        assert any(text in line for line in lines)
    assert lines[-1] == "2 of 3 checks hold"
    assert max(map(len, lines)) <= 80


def test_a_pipe_gets_plain_text_of_a_width_that_can_be_read(monkeypatch, capsys):
    monkeypatch.delenv("COLUMNS", raising=False)
    print_checks("magnetics check", CHECKS)
    out = capsys.readouterr().out
    assert "\x1b" not in out
    assert max(map(len, out.splitlines())) <= tables.WIDTH_WITHOUT_TERMINAL
    assert set("─━│┃").isdisjoint(out)


@pytest.mark.parametrize(
    ("value", "text"),
    [
        (1261.3, "1260"),
        (30.24, "30.2"),
        (0.10451, "0.105"),
        (0.99951, "1.000"),  # rounding may add a place
        (-2.5, "-2.50"),
        (0.0, "0"),
        (1e-9, "< 0.001"),
        (np.inf, "–"),
    ],
)
def test_figures_have_three_significant_digits(value, text):
    assert tables.three_digits(value) == text


def test_a_title_is_not_wrapped_to_a_narrow_table(monkeypatch, capsys):
    monkeypatch.setenv("COLUMNS", "80")
    table = tables.new_table("a title much wider than its table [is]", "a", "b")
    table.add_row("1", "2")
    tables.terminal_console().print(table)
    assert capsys.readouterr().out.splitlines()[0].rstrip() == "a title much wider than its table [is]"
