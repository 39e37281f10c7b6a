"""Verdicts on many figures share the lines of one screen."""

import pytest

from spheretwin.viz.terminal.texts import Verdict, print_verdicts


@pytest.mark.parametrize(
    ("count", "results", "space"),
    [(1, 63, 34), (2, 63, 16), (35, 63, 0), (50, 63, 0), (1, 34, 34), (1, 33, 33)],
)
def test_verdicts_share_the_lines_of_one_screen(capsys, monkeypatch, count, results, space):
    monkeypatch.setenv("COLUMNS", "80")
    verdicts = [(None, "new"), (True, "good"), (False, "bad"), *[(True, f"{place}") for place in range(60)]]
    print_verdicts([Verdict(f"figure{place}", "Title", verdicts[:results]) for place in range(count)])
    *lines, last = capsys.readouterr().out.splitlines()
    assert last.startswith("--verbose")
    assert len(lines) == count * (1 + space)
    first = lines[1 : 1 + space]
    assert first[:2] == ["  - not reproduced: bad.", "  - reproduced: good."][: len(first)]
    omitted = [False] * (space - 1) + [results > space] * (space > 0)
    assert [line.endswith(" …") for line in first] == omitted
