"""Fields as text: title, flag and value, meaning."""

from spheretwin.viz.terminal.texts import FieldText, print_fields


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
