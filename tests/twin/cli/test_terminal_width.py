"""Tables of every verb at 80 columns: no broken word, no cell of more than three lines."""

from pathlib import Path

import pytest
from rich.cells import cell_len
from rich.console import Console
from rich.table import Table
from rich.text import Text

from spheretwin import cli
from spheretwin.cli import reproduce
from spheretwin.models.design import direct_summation
from spheretwin.paper import EXPERIMENTS
from spheretwin.study.grid import Grid
from spheretwin.study.study import load
from spheretwin.viz.terminal import tables

WIDTH, MOST_LINES = 80, 3


def words(texts):
    return sorted(word for text in texts for word in text.split())


def check_lines(lines, rows):
    """Check that each row of texts has complete words, on at most three lines; return the lines after."""
    for row in rows:
        expected = words(row)
        for height in range(1, MOST_LINES + 1):
            printed = words(cell for line in lines[:height] for cell in line.strip().strip("|").split("|"))
            if printed == expected:
                break
        else:
            raise AssertionError(f"not on {MOST_LINES} lines, or with broken words: {row}\n{lines[:5]}")
        lines = lines[height:]
    return lines


class Checker:
    """Checks each table as it is printed."""

    def __init__(self):
        self.tables = 0
        self._print = Console.print

    def __call__(self, console, *objects, **options):
        for table in objects:
            if isinstance(table, Table):
                self.check(console, table)
        self._print(console, *objects, **options)

    def check(self, console, table):
        self.tables += 1
        with console.capture() as capture:
            self._print(console, table)
        lines = [line for line in capture.get().splitlines() if line.startswith("|")]
        assert console.width == WIDTH
        assert max(map(cell_len, lines)) <= WIDTH
        cells = [[Text.from_markup(str(cell)).plain for cell in column.cells] for column in table.columns]
        head = [Text.from_markup(str(column.header)).plain for column in table.columns]
        rule = next(place for place, line in enumerate(lines) if set(line) <= set("|-"))
        assert check_lines(lines[:rule], [head]) == []
        assert check_lines(lines[rule + 1 :], zip(*cells, strict=True)) == []


@pytest.fixture
def checker(monkeypatch):
    monkeypatch.setenv("COLUMNS", str(WIDTH))
    checker = Checker()
    monkeypatch.setattr(
        Console, "print", lambda console, *objects, **options: checker(console, *objects, **options)
    )
    return checker


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
def test_reproduce(checker, capsys, monkeypatch, name):
    """Tables of an experiment from its first cases."""
    monkeypatch.setattr(reproduce, "EXPERIMENTS", {name: EXPERIMENTS[name]})
    assert cli.main(["reproduce", name, "--seeds", "1", "--limit", "1", "--verbose"]) in (
        cli.DONE,
        cli.FAILED,
    )
    assert checker.tables >= 1


@pytest.mark.parametrize(
    "arguments", [["crosscheck", "--states", "3"], ["magnetics", "map", "--largest-tilt", "6"]]
)
def test_checks(checker, arguments):
    cli.main(arguments)
    assert checker.tables >= 1


def test_magnetics_check(checker, monkeypatch):
    few = direct_summation.Quadrature(direct_summation.Rule(12, 12, 48), direct_summation.Rule(6, 6, 24))
    monkeypatch.setattr(direct_summation, "STANDARD", few)
    assert cli.main(["magnetics", "check", "--poses", "1"]) == cli.DONE
    assert checker.tables == 2


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
