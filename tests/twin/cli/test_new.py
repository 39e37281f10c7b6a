"""Templates: each is complete, and runs with the command that is printed."""

import ast
import shlex

import pytest

import spheretwin
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


def test_a_law_imports_public_names_alone(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    assert cli.main(["new", "law", "my_own"]) == cli.DONE
    tree = ast.parse((tmp_path / "my_own.py").read_text(encoding="utf-8"))
    imports = [node for node in ast.walk(tree) if isinstance(node, ast.ImportFrom)]
    assert {node.module for node in imports} == {"pydantic", "spheretwin"}
    names = {alias.name for node in imports if node.module == "spheretwin" for alias in node.names}
    assert names <= set(spheretwin.__all__)
