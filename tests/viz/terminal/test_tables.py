"""Tables in a pipe and in a narrow terminal, and numbers of three digits."""

import numpy as np
import pytest

from spheretwin.models.base.checks import Check
from spheretwin.viz.terminal import tables
from spheretwin.viz.terminal.tables import print_checks


def test_a_pipe_gets_plain_text_of_a_width_that_can_be_read(monkeypatch, capsys):
    monkeypatch.delenv("COLUMNS", raising=False)
    print_checks("magnetics check", [Check("trace", "two runs", 5000, np.nan, None, "no bound", unit="rad")])
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
