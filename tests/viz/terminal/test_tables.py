"""Tables in a pipe and in a narrow terminal."""

import numpy as np

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


def test_a_title_is_not_wrapped_to_a_narrow_table(monkeypatch, capsys):
    monkeypatch.setenv("COLUMNS", "80")
    table = tables.new_table("a title much wider than its table [is]", "a", "b")
    table.add_row("1", "2")
    tables.terminal_console().print(table)
    assert capsys.readouterr().out.splitlines()[0].rstrip() == "a title much wider than its table [is]"


def test_lines_in_a_file_end_with_their_text(capsys):
    table = tables.new_table("longer than the columns of this table", "name", "value")
    table.add_row("a", "1")
    tables.print_table(table)
    lines = capsys.readouterr().out.splitlines()
    assert len(lines) == 6
    assert [line.rstrip() for line in lines] == lines
