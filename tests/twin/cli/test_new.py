"""Templates: each is complete, and runs with the command that is printed."""

import shlex

import pytest

from spheretwin import cli
from spheretwin.cli.new import TEMPLATES


def printed_command(capsys):
    return shlex.split(capsys.readouterr().out.partition("run it:")[2].strip())[1:]


@pytest.mark.release(
    "compiles the template's law and computes a curve, 2.3 s; test_user_law.py runs laws of files"
)
@pytest.mark.parametrize(
    ("kind", "more"),
    [("law", ["--duration", "0.05"]), ("actuator", ["--duration", "0.05"]), ("study", ["--limit", "1"])],
)
def test_a_template_runs_with_the_printed_command(kind, more, tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    assert cli.main(["new", kind, "my_own"]) == cli.DONE
    (file,) = tmp_path.iterdir()
    assert file.name == f"my_own.{TEMPLATES[kind][0]}"
    assert "{" not in file.read_text().partition("\n")[0]
    assert cli.main([*printed_command(capsys), *more]) == cli.DONE


def test_an_existing_file_stays(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "mine.py").write_text("precious")
    assert cli.main(["new", "law", "mine"]) == cli.BAD_INPUT
    assert "which exists" in capsys.readouterr().err
    assert (tmp_path / "mine.py").read_text() == "precious"


@pytest.mark.parametrize("name", ["2fast", "a b", "-", "", "é", "a-b"])
def test_names_are_those_of_python(name, capsys):
    assert (
        cli.main(["new", "law", "--", name] if name.startswith("-") else ["new", "law", name])
        == cli.BAD_INPUT
    )
