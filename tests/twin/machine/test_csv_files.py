"""CSV files as they come: the same numbers, whatever delimiter, header, units and encoding."""

import gzip

import numpy as np
import pytest

from spheretwin.machine import csv_files
from spheretwin.machine.csv_files import CsvFormat
from spheretwin.models.base.errors import InputError

NAMES = ["t_s", "a", "b"]
VALUES = np.array([[0.0, 0.125, -1.5], [0.001, 0.25, np.nan], [0.002, 1e-3, 2.0], [0.003, 4.0, 5.0]])
TEXTS = [[repr(number) if number == number else "" for number in row] for row in VALUES.tolist()]


def table(delimiter=",", names=NAMES, end="\n"):
    return "".join(delimiter.join(row) + end for row in (names, *TEXTS))


DIALECTS = {
    "plain": table(),
    "semicolons and decimal commas": table(";").replace(".", ","),
    "tabs": table("\t"),
    "tabs and decimal commas": table("\t").replace(".", ","),
    "bars": table("|"),
    "blanks after commas": table(", "),
    "quoted names and decimal commas": '"t_s","a","b"\n' + "".join(
        ",".join(f'"{text.replace(".", ",")}"' for text in row) + "\n" for row in TEXTS
    ),
    "comments": "# logger 2\n# firmware 1.3, of 2025\n\n" + table(),
    "comments between rows": table().replace("0.002,", "# event, here, now\n0.002,"),
    "names in a comment": "% " + table(),
    "units": table().replace("\n", "\ns,rad,rad\n", 1),
    "units of another kind": table().replace("\n", "\nSecond,Volt,Volt\n", 1),
    "units in brackets below": table().replace("\n", "\n[s],[xy],[z]\n", 1),
    "a title for groups": "motor,motor,motor\n" + table(),
    "a preamble as wide as the table": "Model,X1,\nFirmware,2.0,\n,,\n" + table(),
    "numbers in the preamble": "x0,0.0,0.0\nstep,0.001,0.001\n" + table(),
    "line of a spreadsheet": "sep=;\n" + table(";"),
    "carriage returns": table(end="\r\n"),
    "a delimiter at the end": table(end=",\n"),
    "a delimiter at the end of rows": table(end=",\n").replace("t_s,a,b,", "t_s,a,b"),
    "signs": table().replace("0.125", "+0.125").replace(",0.25", ",+0.25"),
    "exponents of Fortran": table().replace("0.125", "1.25D-1"),
    "texts for missing numbers": table().replace("0.25,", "0.25,NaN"),
    "nothing after the last row": table().rstrip("\n"),
    "a line that was not complete": table() + "0.004,5",
    "a number that was not complete": table() + "0.004,5.0,1e",
    "zeros that were not written": table() + "\0" * 600,
    "a logger that was started again": table().replace("0.002,", "t_s,a,b\n0.002,"),
}  # fmt: skip


@pytest.mark.parametrize("text", DIALECTS.values(), ids=DIALECTS)
@pytest.mark.parametrize("encoding", ["utf-8", "utf-8-sig", "utf-16"])
def test_dialects_have_the_same_numbers(text, encoding, tmp_path):
    (path := tmp_path / "log.csv").write_bytes(text.encode(encoding))
    read = csv_files.read(path)
    assert list(read.columns)[:3] == NAMES
    assert np.array_equal(np.stack([read.numbers(name) for name in NAMES], axis=1), VALUES, equal_nan=True)


def test_columns_between_blanks_and_rows_of_another_program(tmp_path):
    rows = "".join(f"  {t:.3f}   {a:8.3f} {b:8.3f}\n" for t, a, b in [(0, 1, 2), (0.001, 3, -4)])
    (path := tmp_path / "log.txt").write_text("# t_s a b\n" + rows)
    assert csv_files.read(path).numbers("b").tolist() == [2.0, -4.0]
    path.write_text('"a" "b"\n"1" 0.5 1.5\n"2" 2.5 3.5\n')  # names of R lack that of the row numbers
    assert csv_files.read(path).numbers("b").tolist() == [1.5, 3.5]
    path.write_text(rows)
    read = csv_files.read(path)
    assert read.numbers("column_1").tolist() == [1.0, 3.0]
    assert "no names, so column_0, column_1, ..." in read.notes


def test_a_compressed_file_is_read(tmp_path):
    (path := tmp_path / "log.csv.gz").write_bytes(content := gzip.compress(table().encode()))
    assert np.array_equal(csv_files.read(path).numbers("a"), VALUES[:, 1])
    path.write_bytes(content[:-12])
    with pytest.raises(InputError, match="expected a complete gzip file"):
        csv_files.read(path)


def test_units_and_what_was_guessed_are_stated(tmp_path):
    text = "Messung µ\n" + table(";").replace(".", ",").replace("\n", "\ns;°;mA\n", 1)
    (path := tmp_path / "log.csv").write_bytes(text.encode("cp1252"))
    read = csv_files.read(path)
    assert read.units == {"t_s": "s", "a": "°", "b": "mA"}
    assert read.notes == (
        "columns between ';'", "decimal comma", "names in line 2", "units s, °, mA", "numbers from line 4",
        "encoding cp1252",
    )  # fmt: skip
    path.write_text(table(names=["time [s]", "angle (deg)", "i"]))
    assert csv_files.read(path).units == {"time [s]": "s", "angle (deg)": "deg", "i": ""}


def test_a_stated_format_is_not_guessed(tmp_path):
    text = "1;2;3\n" + table(";").replace(".", ",")
    (path := tmp_path / "log.csv").write_text("// x\n" + text)
    given = CsvFormat(delimiter=";", decimal=",", comment="//", header_rows=3, units_row=False)
    assert np.array_equal(csv_files.read(path, given).numbers("a"), VALUES[:, 1])
    with pytest.raises(InputError, match="expected rows of numbers between '\\|'"):
        csv_files.read(path, CsvFormat(delimiter="|"))
    with pytest.raises(InputError, match="expected text in the encoding utf-17"):
        csv_files.read(path, CsvFormat(encoding="utf-17"))


def test_a_text_names_its_column_its_row_and_its_line(tmp_path):
    text = "# logger\n" + table().replace("0.001,0.25", "0.001,ERR")
    (path := tmp_path / "log.csv").write_text(text)
    with pytest.raises(InputError, match="column a: expected numbers, received 'ERR' in row 1, line 4 of"):
        csv_files.read(path).numbers("a")
    assert csv_files.read(path).numbers("t_s")[1] == 0.001


def test_lines_of_another_length_are_left_out_if_they_are_few(tmp_path):
    rows = [f"{t},1,2" for t in range(500)]
    rows[200] = "2001,1"
    (path := tmp_path / "log.csv").write_text("\n".join(["t_s,a,b", *rows, ""]))
    read = csv_files.read(path)
    assert len(read.numbers("a")) == 499
    assert read.notes == ("1 lines of another length left out, first line 202",)
    rows[100:200] = ["5,6"] * 100
    path.write_text("\n".join(["t_s,a,b", *rows, ""]))
    with pytest.raises(InputError, match="expected 3 values between ',' in line 102, received 2: '5,6'"):
        csv_files.read(path)


@pytest.mark.parametrize("text", ["", "t_s,a,b\n", "one\ntwo\n", "a,b,c\nx,y,z\n"])
def test_a_text_without_numbers_is_refused(text, tmp_path):
    (path := tmp_path / "log.csv").write_text(text)
    with pytest.raises(InputError, match="expected rows of numbers between ',' or ';' or tab"):
        csv_files.read(path)
