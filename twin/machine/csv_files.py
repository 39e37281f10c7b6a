"""CSV files as they come: delimiter, decimal mark, names, units and encoding are guessed unless stated."""

from __future__ import annotations

import codecs
import csv
import gzip
import io
import re
from collections import Counter
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Annotated, Literal, NamedTuple

import pyarrow as pa
import pyarrow.csv
from pydantic import Field

from spheretwin.machine.raw_table import MISSING, RawTable, column_names, repeated_names
from spheretwin.models.base.errors import InputError, shown
from spheretwin.models.base.files import regular_file
from spheretwin.scenario.plant_sections import Section

_GZIP = b"\x1f\x8b"
WHITESPACE = "whitespace"
DELIMITERS = (",", ";", "\t", "|", WHITESPACE)
_NAMES_OF_DELIMITERS = {"\t": "tab", " ": "blank", WHITESPACE: WHITESPACE}

_SAMPLE_LINES = 400
_LEAST_SHARE = 0.3
"""Share of the values that are numbers under the right delimiter; others may be texts and times."""
_MOST_OF_A_ROW = 0.6
"""Share of the values of a row of numbers that are some; another may be an error of a sensor."""
_MOST_OF_NAMES = 0.2
"""The same of a row of names."""

_MOST_INVALID = 0.01
"""Share of lines of another length that are left out; with more of them the file is refused."""


class CsvFormat(Section):
    """Section [csv] of a column map: each entry is guessed unless it is given."""

    delimiter: Annotated[str, Field(pattern=r"^([^\n\r\"]|whitespace)$")] | None = Field(
        None, description="character between the columns, or whitespace for any number of blanks and tabs"
    )
    decimal: Literal[".", ","] | None = Field(None, description="decimal mark")
    comment: Annotated[str, Field(min_length=1, max_length=8)] | None = Field(
        None, description="beginning of lines that are left out (default: # and %)"
    )
    header_rows: Annotated[int, Field(ge=0, le=100_000)] | None = Field(
        None, description="lines above the first row of numbers; the last of them has the names, or the units"
    )
    units_row: bool | None = Field(None, description="whether the last line above the numbers has units")
    encoding: str | None = Field(None, description="name of the encoding, such as utf-8, utf-16 or cp1252")


class _Layout(NamedTuple):
    """Layout of a text."""

    delimiter: str
    decimal: str
    comment: tuple[str, ...]
    names: list[str]
    units: list[str]
    names_line: int | None
    """Index of the line of the names; None for none."""
    first: int
    """Index of the first line of numbers."""


def read(path: Path, given: CsvFormat | None = None) -> RawTable:
    """Read a CSV file.

    Raises
    ------
    InputError
        It cannot be read or decoded, no delimiter gives columns of numbers, or lines differ in their length.
    """
    given = given or CsvFormat()
    text, encoding, notes = _decode(path, given.encoding)
    lines = text.splitlines()
    layout = _layout(path, lines, given)
    rows = lines[layout.first :]
    if rows and not text.endswith(("\n", "\r")) and _is_cut(rows[-1], layout):
        rows.pop()
        notes = (*notes, "the last line is cut and left out")
    places, kept, others = _complete_rows(rows, layout)
    if len(others) > max(2, _MOST_INVALID * len(rows)) or not kept:
        place = others[0] if others else 0
        line = rows[place] if rows else ""
        raise InputError(
            f"log {path}: expected {len(layout.names)} values between {_shown_delimiter(layout.delimiter)} in"
            f" line {layout.first + place + 1}, received {len(_cells(line, layout.delimiter))}: {shown(line)}"
        )
    if others:
        notes = (
            *notes,
            f"{len(others)} lines of another length left out, first line {layout.first + others[0] + 1}",
        )
    return RawTable(
        str(path),
        _columns(path, kept, layout),
        dict(zip(layout.names, layout.units, strict=False)),
        {},
        (*_notes(layout, encoding), *notes),
        repeated_names(layout.names),
        layout.decimal,
        lambda row: layout.first + places[row] + 1,
    )


def _decode(path: Path, encoding: str | None) -> tuple[str, str, tuple[str, ...]]:
    """Return text and encoding of a file, and notes; zeros that a killed recorder left are no text."""
    try:
        content = regular_file(path).read_bytes()
    except OSError as error:
        raise InputError(f"log {path}: expected a readable CSV file, {error.strerror}") from None
    if content.startswith(_GZIP):
        try:
            content = gzip.decompress(content)
        except (OSError, EOFError) as error:
            raise InputError(f"log {path}: expected a complete gzip file, {error}") from None
    stripped = content.rstrip(b"\0") if encoding is None else content
    if content.startswith((codecs.BOM_UTF16_LE, codecs.BOM_UTF16_BE)):
        encodings, stripped = ["utf-16"], content[: len(content) - len(content) % 2]
    elif content[1:20:2] == b"\0" * 10:
        encodings, stripped = ["utf-16-le"], content[: len(content) - len(content) % 2]
    else:
        encodings = ["utf-8-sig", "cp1252", "latin-1"]
    for name in [encoding] if encoding else encodings:
        try:
            text = stripped.decode(name)
        except (UnicodeDecodeError, LookupError):
            continue
        if "\0" in (text := text.rstrip("\0")):
            raise InputError(f"log {path}: expected a text, received bytes 0 in it: no CSV, Parquet or MCAP")
        is_cut = len(stripped) < len(content) and "utf-16" not in name
        return text, name, ("zero bytes at its end left out",) if is_cut else ()
    raise InputError(f"log {path}: expected text in the encoding {encoding or encodings[0]}, received others")


def _layout(path: Path, lines: Sequence[str], given: CsvFormat) -> _Layout:
    comment = (given.comment,) if given.comment else ("#", "%")
    delimiter, skipped = given.delimiter, 0
    if lines and (match := re.fullmatch(r'"?sep=(.)"?', lines[0].strip(" "))):
        delimiter, skipped = delimiter or match[1], 1
    sample = [
        line for line in lines[:_SAMPLE_LINES] if line.strip() and not line.lstrip().startswith(comment)
    ]
    candidates = [delimiter] if delimiter else list(DELIMITERS)
    scores = {one: _score(sample[len(sample) // 2 :], one, given.decimal) for one in candidates}
    best = max(scores, key=lambda one: scores[one][:2])
    share, width, decimal = scores[best]
    numeric = _numeric_columns(sample[len(sample) // 2 :], best, width, decimal)
    first = given.header_rows
    if first is None:
        first = _first_row(lines, skipped, best, _Columns(numeric, decimal), comment)
    if share < _LEAST_SHARE or first is None:
        raise InputError(
            f"log {path}: expected rows of numbers between {' or '.join(map(_shown_delimiter, candidates))},"
            f" received {shown(sample[-1]) if sample else 'no line'}: state csv.delimiter and csv.decimal in"
            " the column map"
        )
    names, units, names_line = _header(lines[skipped:first], best, width, comment, given)
    if first < len(lines) and len(names) < width:  # the names of R lack that of the row numbers
        ends_empty = not _cells(lines[first], best)[-1]
        names = [*names, ""] if ends_empty else ["", *names]
    names = column_names(names)[:width]
    line = None if names_line is None else names_line + skipped
    return _Layout(best, decimal, comment, names, units, line, first)


def _score(lines: Sequence[str], delimiter: str, decimal: str | None) -> tuple[float, int, str]:
    """Return share of numbers, width and decimal mark of lines under a delimiter."""
    rows = [_cells(line, delimiter) for line in lines]
    if not rows:
        return 0.0, 0, "."
    width = Counter(map(len, rows)).most_common(1)[0][0]
    cells = [cell for row in rows for cell in row if cell]
    marks = Counter(mark for cell in cells if (mark := _mark(cell)))
    mark = decimal or ("," if marks[","] > marks["."] else ".")
    whole = [row for row in rows if len(row) == width]
    numbers = sum(_is_number(cell, mark) for row in whole for cell in row)
    return round(numbers / max(len(cells), 1), 2) if width > 1 else 0.0, width, mark


_NUMBER = r"[+-]?(?:\d+{0}?\d*|{0}\d+)(?:[eEdD][+-]?\d+)?"
_POINT, _COMMA = (re.compile(_NUMBER.format(mark)) for mark in (r"\.", ","))


def _mark(cell: str) -> str | None:
    """Return the decimal mark of a number; None for another text, or without a mark."""
    if "," in cell:
        return "," if re.fullmatch(r"[+-]?\d*,\d+(?:[eE][+-]?\d+)?", cell) else None
    return "." if "." in cell and _POINT.fullmatch(cell) else None


def _is_number(cell: str, decimal: str) -> bool:
    return bool((_COMMA if decimal == "," else _POINT).fullmatch(cell)) or (
        bool(cell) and cell.lower() in MISSING
    )


def _numeric_columns(lines: Sequence[str], delimiter: str, width: int, decimal: str) -> list[bool]:
    """Return whether the columns of lines have numbers."""
    rows = [cells for line in lines if len(cells := _cells(line, delimiter)) == width]
    return [any(_is_number(cell, decimal) for cell in column) for column in zip(*rows, strict=True)]


class _Columns(NamedTuple):
    """Which columns have numbers, and their decimal mark."""

    numeric: Sequence[bool]
    decimal: str

    def share(self, cells: Sequence[str]) -> float | None:
        """Return the share of numbers of a row in these columns; None for a row of another length."""
        values = [cell for cell, is_numeric in zip(cells, self.numeric, strict=False) if cell and is_numeric]
        if abs(len(cells) - len(self.numeric)) > 1 or not values:
            return None
        return sum(_is_number(cell, self.decimal) for cell in values) / len(values)


def _first_row(
    lines: Sequence[str], skipped: int, delimiter: str, columns: _Columns, comment: tuple[str, ...]
) -> int | None:
    """Return the place of the first row of numbers below the names; None if there is none."""
    rows, names = [], []
    for place, line in enumerate(lines[:_SAMPLE_LINES]):
        if place < skipped or line.lstrip().startswith(comment):
            continue
        share = columns.share(_cells(line, delimiter))
        if share is not None and share >= _MOST_OF_A_ROW:
            rows.append(place)
        elif share is not None and share <= _MOST_OF_NAMES:
            names.append(place)
    for place in reversed(names):
        below = [row for row in rows if row > place]
        # A logger that was started again repeats its names.
        if len(below) >= 0.5 * len(rows) and lines[place] not in (
            lines[other] for other in names if other < place
        ):
            return below[0] if below else None
    return rows[0] if rows else None


def _cells(line: str, delimiter: str) -> list[str]:
    """Return the texts of a line, without blanks around them."""
    if delimiter == WHITESPACE:
        return [cell.strip('"') for cell in line.split()]
    if '"' in line:
        return [cell.strip() for cell in next(csv.reader([line], delimiter=delimiter, skipinitialspace=True))]
    return [cell.strip() for cell in line.split(delimiter)]


_UNITS = {
    "s", "sec", "seconds", "second", "ms", "msec", "us", "µs", "μs", "ns", "rad", "mrad", "deg", "°",
    "degree", "degrees", "turn", "turns", "rev", "a", "ma", "amp", "amps", "ampere", "v", "mv", "volt",
    "volts", "n·m", "nm", "mnm", "n.m", "n*m", "rad/s", "deg/s", "°/s", "rpm", "hz", "1", "-", "%",
    "count", "counts", "°c", "degc", "c", "k", "w", "bool", "int",
}  # fmt: skip


def _header(
    lines: Sequence[str], delimiter: str, width: int, comment: tuple[str, ...], given: CsvFormat
) -> tuple[list[str], list[str], int | None]:
    """Return names and units of the columns, and the place of the names, from the lines above the numbers."""
    rows: list[tuple[int, list[str]]] = []
    for place in reversed(range(len(lines))):
        line = lines[place].strip("\r\n")
        if not line.strip():
            continue
        is_comment = line.lstrip().startswith(comment)
        cells = _cells(_without_comment(line, comment), delimiter)
        if abs(len(cells) - width) > (0 if is_comment else 1):
            break
        rows.append((place, cells))
    if not rows:
        return [""] * width, [], None
    has_units = _has_units(rows) if given.units_row is None else given.units_row
    units = rows.pop(0)[1] if has_units and len(rows) > 1 else []
    place, names = max(rows, key=lambda row: (_names_share(row[1]), row[0]))
    bracketed = [_BRACKETED.fullmatch(name) for name in names]
    if not units and any(bracketed):
        units = [match["unit"] if match and match["unit"].lower() in _UNITS else "" for match in bracketed]
    return names, [unit.strip("[]() ") for unit in units], place


_BRACKETED = re.compile(r".*[\[(](?P<unit>[^\])]*)[\])]\s*")


def _without_comment(line: str, comment: tuple[str, ...]) -> str:
    mark = next((mark for mark in comment if line.lstrip().startswith(mark)), "")
    return line.lstrip().removeprefix(mark).lstrip(" #%") if mark else line


def _has_units(rows: Sequence[tuple[int, list[str]]]) -> bool:
    """True if the last row above the numbers has units."""
    if len(rows) < 2:
        return False
    cells = [cell for cell in rows[0][1] if cell]
    known = sum(cell.strip("[]() ").lower() in _UNITS for cell in cells)
    return bool(cells) and (
        known >= 0.5 * len(cells)
        or all(re.fullmatch(r"[\[(].*[\])]", cell) for cell in cells)
        or (len(set(cells)) < len(cells) and len(set(rows[1][1])) == len(rows[1][1]))
    )


def _names_share(cells: Sequence[str]) -> float:
    """Return how much a row looks like names: many different texts."""
    return round(len({cell for cell in cells if cell and not _is_number(cell, ".")}) / max(len(cells), 1), 1)


_FIRST_OF_NUMBERS = "0123456789+-."


def _complete_rows(rows: Sequence[str], layout: _Layout) -> tuple[list[int], list[str], list[int]]:
    """Return places and texts of the rows with all columns, and the places of others; comments are none."""
    width, places, kept, others = len(layout.names), [], [], []
    quick = layout.delimiter if layout.delimiter != WHITESPACE else None
    for place, line in enumerate(rows):
        if not line.strip() or line.lstrip().startswith(layout.comment):
            continue
        is_plain = quick and '"' not in line
        cells = line.count(quick) + 1 if quick and is_plain else len(_cells(line, layout.delimiter))
        is_padded = cells == width + 1 and quick and line.rstrip().endswith(quick)
        if cells == width or is_padded:
            if line.lstrip()[0] not in _FIRST_OF_NUMBERS and _cells(line, layout.delimiter) == layout.names:
                continue  # a logger that was started again
            places.append(place)
            kept.append(line.rstrip()[:-1] if is_padded else line)
        else:
            others.append(place)
    return places, kept, others


def _columns(path: Path, rows: Sequence[str], layout: _Layout) -> dict[str, object]:
    """Return the texts of the columns by name."""
    delimiter = layout.delimiter
    if delimiter == WHITESPACE:
        rows, delimiter = [" ".join(line.split()) for line in rows], " "
    elif '"' in rows[0]:
        rows = [_without_blanks(line, delimiter) for line in rows]
    content = "\n".join(rows).encode()
    places = [str(place) for place in range(len(layout.names))]
    try:
        table = pyarrow.csv.read_csv(
            io.BytesIO(content),
            pyarrow.csv.ReadOptions(
                column_names=places, block_size=max(len(content) + 1, 1 << 20), use_threads=False
            ),
            pyarrow.csv.ParseOptions(delimiter=delimiter, newlines_in_values=False),
            pyarrow.csv.ConvertOptions(column_types=dict.fromkeys(places, pa.string())),
        )
    except pa.ArrowException as error:
        raise InputError(f"log {path}: expected rows of CSV, {error}") from None
    return {name: table[place] for name, place in zip(layout.names, places, strict=True)}


def _without_blanks(line: str, delimiter: str) -> str:
    """Return a row without blanks before quotes, which would be part of the text."""
    return re.sub(rf'{re.escape(delimiter)} +"', f'{delimiter}"', line) if '"' in line else line


def _is_cut(line: str, layout: _Layout) -> bool:
    """True for a last line without an end that lacks columns, or ends within a number."""
    cells = _cells(line, layout.delimiter)
    return len(cells) < len(layout.names) or not (not cells[-1] or _is_number(cells[-1], layout.decimal))


def _notes(layout: _Layout, encoding: str) -> Iterator[str]:
    """Yield what differs from the CSV of this package."""
    if layout.delimiter != ",":
        yield f"columns between {_shown_delimiter(layout.delimiter)}"
    if layout.decimal != ".":
        yield "decimal comma"
    if layout.names_line is None:
        yield "no names, so column_0, column_1, ..."
    elif layout.names_line or layout.first != 1:
        yield f"names in line {layout.names_line + 1}"
    if any(layout.units):
        yield f"units {', '.join(dict.fromkeys(filter(None, layout.units)))}"
    if layout.first != 1:
        yield f"numbers from line {layout.first + 1}"
    if encoding != "utf-8-sig":
        yield f"encoding {encoding}"


def _shown_delimiter(delimiter: str) -> str:
    return _NAMES_OF_DELIMITERS.get(delimiter, repr(delimiter))
