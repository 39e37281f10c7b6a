"""The journal: what was finished is kept, whatever happens to its file."""

import json
import tracemalloc

import pytest

from spheretwin.models.base.errors import InputError, SpheretwinError
from spheretwin.study import journal
from spheretwin.study.grid import Row
from spheretwin.study.journal import Journal
from spheretwin.study.row import RowResult
from tests.twin.study.cases import Full, loads, run_rows, study, table, values

ROWS = [Row(number, f"{number:016x}", number, {}, None, 0) for number in range(6)]


def result(number):
    return RowResult("completed", None, None, {"rms_error_rad": [0.1 * number, None, float(number)]})


@pytest.fixture
def path(tmp_path):
    """A journal of six rows, written in another order than theirs."""
    path = tmp_path / journal.NAME
    with Journal(path, "d", 6) as writer:
        for row in (ROWS[3], ROWS[0], ROWS[5], ROWS[1], ROWS[2], ROWS[4]):
            writer.add(row, result(row.number))
    return path


def contents_of(path):
    with Journal(path, "d", 6) as reader:
        return dict(reader.results()), reader.torn, reader.damaged


def test_results_come_in_the_order_of_the_study(path):
    results, torn, damaged = contents_of(path)
    assert (list(results), torn, damaged) == (list(range(6)), False, 0)
    assert results == {number: result(number) for number in range(6)}
    with Journal(path, "d", 6) as writer:
        assert (writer.done(2), writer.done()) == (2, 6)


def test_a_journal_torn_anywhere_keeps_the_lines_before(path):
    whole = path.read_bytes()
    ends = [place + 1 for place, byte in enumerate(whole) if byte == ord("\n")]
    for length in range(len(whole) + 1):
        path.write_bytes(whole[:length])
        results, torn, damaged = contents_of(path)
        lines = sum(end <= length for end in ends)
        assert len(results) == max(lines - 1, 0)
        assert torn == (length > ends[0] and length not in ends)
        assert damaged == 0
        remaining = whole[: ends[lines - 1]] if lines else whole[: ends[0]]
        assert path.read_bytes() == remaining


def test_a_line_damaged_in_the_middle_loses_itself_alone(path):
    whole = path.read_bytes()
    lines = whole.splitlines(keepends=True)
    begin = len(lines[0]) + len(lines[1])  # the line of row 0
    for place in range(len(lines[2]) - 1):
        changed = bytearray(whole)
        changed[begin + place] ^= 1
        path.write_bytes(changed)
        results, torn, damaged = contents_of(path)
        assert list(results) == [1, 2, 3, 4, 5]
        # A bit may turn a sign into the end of a line: two damaged ones.
        assert (torn, damaged) == (False, 1 + (changed[begin + place] == ord("\n")))
        assert path.read_bytes() == changed


def test_a_row_whose_line_was_damaged_is_run_again_and_the_table_is_the_same(tmp_path):
    whole = run_rows(loads(), tmp_path / "a")
    path = tmp_path / "a" / journal.NAME
    before = table(tmp_path / "a")
    lines = path.read_bytes().splitlines(keepends=True)
    lines[5] = lines[5].replace(b"completed", b"cmopleted")
    path.write_bytes(b"".join(lines))
    assert run_rows(loads(), tmp_path / "a") == whole
    assert table(tmp_path / "a") == before
    assert path.read_bytes().startswith(b"".join(lines))
    assert len(path.read_bytes().splitlines()) == len(lines) + 1


@pytest.mark.parametrize("text", [b"my notes", b"my notes\nand more\n", b"[1, 2]\n", b"\n", b"\x00\xff\n"])
def test_a_file_that_is_no_journal_is_refused_and_left_as_it_is(tmp_path, text):
    path = tmp_path / journal.NAME
    path.write_bytes(text)
    with pytest.raises(InputError, match=r"expected a journal of a study, received .*journal\.jsonl"):
        contents_of(path)
    assert path.read_bytes() == text


@pytest.mark.parametrize(
    "other",
    [
        {"seed": 1},
        {"seeds": 2},
        {"fields": {"duration": 0.03}},
        {"metrics": ["rms_error_rad"]},
        {"law": [{"law": "pd"}]},
        {"axis": [values("disturbance.load", 0.0)], "samples": None},
    ],
)
def test_whatever_changes_a_figure_makes_another_study(tmp_path, other):
    run_rows(loads(), tmp_path, limit=1)
    before = table(tmp_path), (tmp_path / journal.NAME).read_bytes()
    message = r"expected .* to be a journal of this study .*, received one of others; remove it"
    with pytest.raises(InputError, match=message):
        run_rows(loads(**other), tmp_path)
    assert (table(tmp_path), (tmp_path / journal.NAME).read_bytes()) == before
    assert len(run_rows(loads(description="another"), tmp_path, limit=1)) == 1


def test_an_edited_file_of_the_user_s_makes_another_study(tmp_path):
    mine = tmp_path / "mine.py"
    mine.write_text("def ticks(run): return len(run.telemetry)")
    chosen = study(metrics=[f"{mine}:ticks"])
    assert run_rows(chosen, tmp_path / "out")[0]["ticks"] == 20
    mine.write_text("def ticks(run): return 2 * len(run.telemetry)")
    with pytest.raises(InputError, match="received one of others"):
        run_rows(chosen, tmp_path / "out")


def test_a_full_disk_ends_a_study_which_goes_on_when_there_is_room(tmp_path, monkeypatch):
    whole = run_rows(loads(), tmp_path / "whole")
    opened = journal._opened
    with monkeypatch.context() as patch:
        patch.setattr(journal, "_opened", lambda path: Full(opened(path), 3000))
        with pytest.raises(SpheretwinError, match="No space left on device; the rows before are kept"):
            run_rows(loads(), tmp_path / "full")
    # What of the last line was written is gone again.
    *lines, after_last = (tmp_path / "full" / journal.NAME).read_bytes().split(b"\n")
    assert after_last == b""
    assert 2 < len(lines) < 1 + len(whole)
    assert {json.loads(line)[0] for line in lines[1:]} < {row["row"] for row in whole}
    assert run_rows(loads(), tmp_path / "full") == whole
    assert table(tmp_path / "full") == table(tmp_path / "whole")


def test_of_rows_that_there_may_be_none_takes_memory(tmp_path):
    tracemalloc.start()
    with Journal(tmp_path / journal.NAME, "d", 10**8):
        # Addresses are all that is taken before a row is finished: eight bytes a row, none of them written.
        assert tracemalloc.get_traced_memory()[1] < 8 * 10**8 + 10**6
    tracemalloc.stop()


@pytest.mark.parametrize("rows", [3, 5])
def test_lines_of_rows_that_the_study_does_not_have_are_damaged(path, rows):
    with Journal(path, "d", rows) as journal_of_fewer:
        assert list(dict(journal_of_fewer.results())) == list(range(rows))
        assert journal_of_fewer.damaged == 6 - rows
