"""Tables of every verb at 80 columns: no broken word, no cell of more than three lines."""

from pathlib import Path

import pytest
from rich.table import Table

from spheretwin import cli
from spheretwin.cli import reproduce
from spheretwin.paper import EXPERIMENTS
from spheretwin.study.grid import Grid
from spheretwin.study.study import load
from spheretwin.viz.terminal import tables
from tests.twin.cli.tables import WIDTH
from tests.twin.cli.tables import checker as checker  # a fixture

FAULT = ["--fault.0.target", "coil.07", "--fault.0.mode", "open", "--fault.0.start-s", "0.1"]


@pytest.fixture(scope="module")
def runs(tmp_path_factory):
    folder = tmp_path_factory.mktemp("runs")
    commands = {
        "a.parquet": ["sinusoid"],
        "b.parquet": ["sinusoid", "--controller.law", "pd", "--plant.coulomb-Nm", "2e-3", "2e-3", "2e-3"],
        "a_long_name_of_a_file.parquet": ["nutation", *FAULT],
    }
    for name, arguments in commands.items():
        flags = ["--duration", "0.3", "--telemetry", str(folder / name), "--json"]
        assert cli.main(["simulate", *arguments, *flags]) == cli.DONE
    return [str(folder / name) for name in commands]


def test_simulate(checker):
    cli.main(["simulate", "sinusoid", "--controller.law", "pd", "--disturbance.load", "5"])
    assert checker.tables == 1


@pytest.mark.parametrize(("count", "more"), [(1, []), (2, []), (3, []), (3, ["--tolerance", "gate"])])
def test_review(checker, runs, count, more):
    cli.main(["review", *runs[:count], *more])
    assert checker.tables >= 2


def test_sweep(checker, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    study = (
        'name = "short"\nscenario = "sinusoid"\nfields = {duration = 0.02}\n'
        '[[law]]\nlaw = "backstepping_sliding_mode"\n[[law]]\nlaw = "super_twisting"\n[[law]]\nlaw = "pd"\n'
        '[[axis]]\nfield = "disturbance.load"\nkind = "values"\nvalues = [0.0, 1.0]\n'
    )
    Path("short.toml").write_text(study)
    assert cli.main(["sweep", "short.toml"]) == cli.DONE
    assert checker.tables >= 1
    checker.tables = 0
    key = Grid(load("short.toml"))[0].key
    assert cli.main(["sweep", "short.toml", "--row", key]) == cli.DONE
    assert checker.tables <= 1


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
