"""Tables as they are printed at 80 columns: no broken word, no cell of more than three lines."""

import pytest
from rich.cells import cell_len
from rich.console import Console
from rich.table import Table
from rich.text import Text

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
