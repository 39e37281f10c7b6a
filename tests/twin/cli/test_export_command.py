"""Verb `export`: JSON, fields of a scenario and of a twin, exit codes and messages of one line."""

import zipfile

import pytest
from fmpy import read_model_description

from spheretwin.export import compiler, fmu
from tests.requirements import needs_c_compiler
from tests.twin.cli.calls import call, refusal

TWIN = """format = 1
sha256 = "unchecked"
scenario = "hold"
[fields]
"plant.payload_kg" = 0.05
"plant.coulomb_Nm" = [0.003, 0.003, 0.004]
"""


def parameters_of(path):
    """Start values of an FMU by name."""
    variables = read_model_description(str(path)).modelVariables
    return {variable.name: float(variable.start) for variable in variables if variable.start is not None}


@pytest.fixture(autouse=True)
def folder(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    return tmp_path


@pytest.fixture
def no_compiler(monkeypatch):
    monkeypatch.setattr(fmu, "host_compiler", lambda: None)


@pytest.mark.usefixtures("no_compiler")
def test_an_fmu_has_the_fields_of_twin_and_command_line(folder):
    (folder / "twin.toml").write_text(TWIN)
    arguments = ["--twin", "twin.toml", "--plant.viscous-Nm-s", "[1e-4,1e-4,1e-4]", "--fmi", "3", "--json"]
    result = call("export", "fmu", "hold", *arguments)
    assert result.code == 0
    assert "no C compiler for this machine" in result.err
    written = result.json
    assert written["binaries"] == []
    assert (written["fmu"], written["fmi"], written["kind"]) == ("hold.fmu", 3, "co-simulation")
    starts = parameters_of(folder / "hold.fmu")
    assert starts["coulomb_Nm.gamma"] == 0.004
    assert starts["viscous_Nm_s.alpha"] == 1e-4
    assert starts["weight_moment_Nm"] == pytest.approx(0.05 * 9.81 * 0.1)
    assert set(written["parameters"]) <= set(starts)


@pytest.mark.usefixtures("no_compiler")
def test_voltages_replace_the_commanded_currents(folder):
    assert call("export", "fmu", "hold", "--inputs", "voltages", "--out", "v.fmu").code == 0
    starts = parameters_of(folder / "v.fmu")
    assert {"voltage_V[17]", "inductance_H[17]"} <= set(starts)
    assert not {"current_command_A[0]", "lag_s[0]"} & set(starts)
    with zipfile.ZipFile(folder / "v.fmu") as archive:
        assert archive.testzip() is None
        assert "modelDescription.xml" in archive.namelist()


def test_c_files_of_both_parts_or_of_one(folder):
    written = call("export", "c", "hold", "--controller.law", "pid", "--json").json
    assert {"st_plant.c", "st_controller.c", "st_example.c"} <= set(written["files"])
    assert written["controller"]["law"] == "pid"
    assert {path.name for path in (folder / "hold_c").iterdir()} == set(written["files"])
    assert call("export", "c", "hold", "--part", "plant", "--out", "only").code == 0
    names = {path.name for path in (folder / "only").iterdir()}
    assert "st_plant.c" in names
    assert not any("controller" in name or "example" in name for name in names)


@pytest.mark.parametrize(
    ("spec", "target", "message"),
    [
        (None, "x86_64-windows", "which the extra cross installs"),
        (object(), "aarch64-linux", "expected FMI 3 for aarch64-linux"),
    ],
)
def test_targets_need_the_extra_and_their_version(spec, target, message, monkeypatch):
    monkeypatch.setattr(compiler, "find_spec", lambda name: spec)
    assert message in refusal("export", "fmu", "hold", "--target", target)


@needs_c_compiler
def test_an_error_of_the_compiler_is_one_line_and_leaves_no_file(folder, monkeypatch):
    monkeypatch.setattr(fmu, "PLANT_SOURCES", ("st_plant.c", "st_example.c"))  # needs the controller's files
    result = call("export", "fmu", "hold")
    assert (result.code, result.err.count("\n")) == (1, 1)
    assert "expected library to compile" in result.err
    assert not (folder / "hold.fmu").exists()
