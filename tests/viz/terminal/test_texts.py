"""Fields as text: title, flag and value, meaning."""

import pytest

from spheretwin.viz.terminal.texts import FieldText, Verdict, print_facts, print_fields, print_verdicts


def test_fields_have_a_title_and_a_line_each(capsys, monkeypatch):
    monkeypatch.setenv("COLUMNS", "80")
    fields = [
        FieldText("--plant.step-s", "0.0005", "physics step, s"),
        FieldText("--controller.feed-forward.inertia", "1.0 1.0 1.0", "share of the inertia"),
    ]
    print_fields("two fields", fields)
    title, first, second, meaning = capsys.readouterr().out.strip().splitlines()
    assert title == "two fields:"
    assert first.split(maxsplit=2) == list(fields[0])
    assert second.split(maxsplit=1) == list(fields[1][:2])
    assert (meaning.strip(), meaning.index("share")) == (fields[1].meaning, first.index("physics"))


def test_facts_have_a_line_each_and_none_for_no_value(capsys, monkeypatch):
    monkeypatch.setenv("COLUMNS", "80")
    facts = [
        ("plant.a", "1.5", "V", "uniform", "data sheet", "an offset"),
        ("plant.b", "", "", "", "default", ""),
    ]
    print_facts("two", facts)
    assert capsys.readouterr().out.splitlines() == [
        "two:",
        "",
        "plant.a = 1.5 V",
        "    an offset",
        "    distribution: uniform",
        "    origin: data sheet",
        "",
        "plant.b = none",
        "    origin: default",
    ]


@pytest.mark.parametrize(("count", "space"), [(1, 34), (2, 16), (35, 0), (50, 0)])
def test_verdicts_share_the_lines_of_one_screen(capsys, monkeypatch, count, space):
    monkeypatch.setenv("COLUMNS", "80")
    results = [(None, "new"), (True, "good"), (False, "bad"), *[(True, f"{place}") for place in range(60)]]
    print_verdicts([Verdict(f"figure{place}", "Title", results) for place in range(count)])
    *lines, last = capsys.readouterr().out.splitlines()
    assert last.startswith("--verbose")
    assert len(lines) == count * (1 + space)
    first = lines[1 : 1 + space]
    assert first[:2] == ["  - not reproduced: bad.", "  - reproduced: good."][: len(first)]
    assert [line.endswith(" …") for line in first] == [False] * (space - 1) + [True] * (space > 0)


@pytest.mark.parametrize("more", [-1, 0, 1])
def test_results_that_fit_have_no_mark_of_omission(capsys, monkeypatch, more):
    monkeypatch.setenv("COLUMNS", "80")
    print_verdicts([Verdict("figure6", "Title", [(True, f"{place}") for place in range(34 + more)])])
    lines = capsys.readouterr().out.splitlines()[1:-1]
    assert len(lines) == min(34, 34 + more)
    assert lines[-1].endswith(" …") == (more > 0)
