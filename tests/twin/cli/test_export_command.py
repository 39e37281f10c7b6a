"""Verb `export`: JSON, fields of a scenario and of a twin, exit codes and messages of one line."""

import json
import zipfile

import pytest

from spheretwin import cli
from spheretwin.cli import completion
from spheretwin.export import compiler, fmu
from tests.requirements import needs_c_compiler

TWIN = """format = 1
scenario = "hold"
[fields]
"plant.payload_kg" = 0.05
"plant.coulomb_Nm" = [0.003, 0.003, 0.004]
"""


def parameters_of(path):
    """Start values of an FMU by name."""
    from fmpy import read_model_description

    variables = read_model_description(str(path)).modelVariables
    return {variable.name: float(variable.start) for variable in variables if variable.start is not None}


@pytest.fixture(autouse=True)
def folder(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    return tmp_path


def test_an_fmu_has_the_fields_of_twin_and_command_line(folder, capsys, monkeypatch):
    monkeypatch.setattr(fmu, "host_compiler", lambda: None)
    (folder / "twin.toml").write_text(TWIN)
    arguments = ["--twin", "twin.toml", "--plant.viscous-Nm-s", "[1e-4,1e-4,1e-4]", "--fmi", "3", "--json"]
    assert cli.main(["export", "fmu", "hold", *arguments]) == 0
    printed = capsys.readouterr()
    written = json.loads(printed.out)
    assert written["binaries"] == []
    assert "no C compiler for this machine" in printed.err
    assert (written["fmu"], written["fmi"], written["kind"]) == ("hold.fmu", 3, "co-simulation")
    starts = parameters_of(folder / "hold.fmu")
    assert starts["coulomb_Nm.gamma"] == 0.004
    assert starts["viscous_Nm_s.alpha"] == 1e-4
    assert starts["weight_moment_Nm"] == pytest.approx(0.05 * 9.81 * 0.1)
    assert set(written["parameters"]) <= set(starts)


def test_voltages_replace_the_commanded_currents(folder, monkeypatch):
    monkeypatch.setattr(fmu, "host_compiler", lambda: None)
    assert cli.main(["export", "fmu", "hold", "--inputs", "voltages", "--out", "v.fmu"]) == 0
    starts = parameters_of(folder / "v.fmu")
    assert "voltage_V[17]" in starts
    assert "inductance_H" in starts
    assert not {"current_command_A[0]", "lag_s"} & set(starts)


def test_c_files_of_both_parts_or_of_one(folder, capsys):
    assert cli.main(["export", "c", "hold", "--controller.law", "pid", "--json"]) == 0
    written = json.loads(capsys.readouterr().out)
    assert {"st_plant.c", "st_controller.c", "st_example.c"} <= set(written["files"])
    assert written["controller"]["law"] == "pid"
    assert {path.name for path in (folder / "hold_c").iterdir()} == set(written["files"])
    assert cli.main(["export", "c", "hold", "--part", "plant", "--out", "only"]) == 0
    names = {path.name for path in (folder / "only").iterdir()}
    assert "st_plant.c" in names
    assert not any("controller" in name or "example" in name for name in names)


def test_targets_need_the_extra_and_a_known_name(folder, capsys, monkeypatch):
    monkeypatch.setattr(compiler, "find_spec", lambda name: None)
    assert cli.main(["export", "fmu", "hold", "--target", "x86_64-windows"]) == 2
    assert "which the extra cross installs" in capsys.readouterr().err
    assert cli.main(["export", "fmu", "hold", "--target", "x86_64-window"]) == 2
    assert "did you mean x86_64-windows?" in capsys.readouterr().err
    monkeypatch.setattr(compiler, "find_spec", lambda name: object())
    assert cli.main(["export", "fmu", "hold", "--target", "aarch64-linux"]) == 2
    assert "expected FMI 3 for aarch64-linux" in capsys.readouterr().err


@needs_c_compiler
def test_an_error_of_the_compiler_is_one_line_and_leaves_no_file(folder, capsys, monkeypatch):
    monkeypatch.setattr(fmu, "PLANT_SOURCES", ("st_plant.c", "st_example.c"))  # needs the controller's files
    assert cli.main(["export", "fmu", "hold"]) == 1
    printed = capsys.readouterr().err
    assert "expected library to compile" in printed
    assert printed.count("\n") == 1
    assert not (folder / "hold.fmu").exists()


def test_an_fmu_is_a_zip_archive_with_the_description_at_its_root(folder, monkeypatch):
    monkeypatch.setattr(fmu, "host_compiler", lambda: None)
    assert cli.main(["export", "fmu", "tilt", "--kind", "model-exchange"]) == 0
    with zipfile.ZipFile(folder / "tilt.fmu") as archive:
        assert archive.testzip() is None
        assert "modelDescription.xml" in archive.namelist()


def test_its_parts_complete_their_options_and_the_fields_of_a_scenario():
    assert completion.words(["export", ""]) == ["fmu", "c"]
    assert completion.words(["export", "fmu", "hold", "--ki"]) == ["--kind"]
    assert "--controller.law" in completion.words(["export", "c", "hold", "--controller.l"])
