"""Tables of every verb at 80 columns: no broken word, no cell of more than three lines."""

import pytest
from rich.table import Table

from spheretwin import cli
from spheretwin.cli import reproduce
from spheretwin.paper import EXPERIMENTS
from spheretwin.viz.terminal import tables
from tests.twin.cli.tables import WIDTH
from tests.twin.cli.tables import checker as checker  # a fixture


@pytest.mark.parametrize("name", EXPERIMENTS)
def test_reproduce(checker, monkeypatch, name):
    """Tables of an experiment from its first cases."""
    monkeypatch.setattr(reproduce, "EXPERIMENTS", {name: EXPERIMENTS[name]})
    code = cli.main(["reproduce", name, "--seeds", "1", "--limit", "1", "--verbose"])
    assert code in (cli.DONE, cli.FAILED)
    assert checker.tables >= 1


def test_a_text_that_fits_no_cell_is_printed_as_a_list(checker, capsys):
    table = tables.new_table("gains", "law", "gains")
    gains = ", ".join(f"gain_{number} {number}" for number in range(40))
    table.add_row("AFSM", gains)
    tables.print_table(table)
    lines = capsys.readouterr().out.splitlines()
    assert checker.tables == 0
    assert lines[:2] == ["gains", "- AFSM"]
    assert " ".join(" ".join(lines[2:]).split()) == f"gains: {gains}"
    assert max(map(len, lines)) <= WIDTH


def test_a_broken_word_and_a_fourth_line_are_found(checker):
    narrow = Table(box=tables.box.MARKDOWN)
    narrow.add_column("a", width=4, overflow="fold")
    narrow.add_row("unbroken")
    with pytest.raises(AssertionError, match="broken words"):
        checker.check(tables.terminal_console(), narrow)
    high = Table(box=tables.box.MARKDOWN)
    high.add_column("a", width=2)
    high.add_row("a b c d e f g h")
    with pytest.raises(AssertionError, match="not on 3 lines"):
        checker.check(tables.terminal_console(), high)
