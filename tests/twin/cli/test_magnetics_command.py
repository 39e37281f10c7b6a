"""``spheretwin magnetics``: arguments, files and exit codes, of constructed results and of computed ones."""

import sys

import pytest

from spheretwin import cli
from spheretwin.models import actuator as actuators
from spheretwin.models import torque_curve
from spheretwin.models.base.extras import install_command
from spheretwin.models.design import curve_check, field_check, torque_map
from spheretwin.models.torque_curve import TorqueCurve
from spheretwin.viz.pages import magnetics, markdown
from tests.content.verdicts import computed_curve, field_verdict, judged_curve, survey, workspace_verdict
from tests.twin.cli.calls import call, refusal


@pytest.fixture
def user_csv(tmp_path):
    """Coarse data of another magnet, as from a bench."""

    def write(scale):
        curve, path = actuators.load().torque_curve, tmp_path / "bench.csv"
        rows = [*range(0, 120, 4), *range(120, 721, 20)]
        scaled = TorqueCurve(curve.phi_rad[rows], scale * curve.torque_Nm_per_A[rows])
        path.write_text(torque_curve.to_csv(scaled, ["bench"]))
        return path

    return write


@pytest.fixture
def constructed(monkeypatch):
    """Replace the long computations and the pages; return their arguments."""
    calls = {}

    def replace(module, name, result):
        def record(*given):
            calls[name] = given
            return result

        monkeypatch.setattr(module, name, record)

    replace(curve_check, "judge", judged_curve())
    replace(curve_check, "compute", computed_curve())
    replace(field_check, "judge", field_verdict())
    replace(torque_map, "survey", survey())
    replace(torque_map, "judge", workspace_verdict())
    replace(magnetics, "write_check", ["page"])
    replace(magnetics, "write_map", ["page"])
    return calls


def broken(*arguments):
    """Return the streams of a call of which a bound is broken."""
    result = call("magnetics", *arguments)
    assert result.code == cli.FAILED
    return result


# The JSON and the tables of constructed results are the content of magnetics_pages.


@pytest.mark.usefixtures("constructed")
def test_a_user_s_curve_has_no_bounds(user_csv):
    path, judged = user_csv(0.93), judged_curve()
    warning = "spheretwin: warning: too few samples\n"
    table = call("magnetics", "curve", "--csv", path)
    assert (table.code, table.err) == (cli.DONE, warning)
    assert "leave-one-out" in table.out
    result = call("magnetics", "curve", "--csv", path, "--json")
    assert (result.code, result.err) == (cli.DONE, warning)
    difference, scale, scaled = judged.geometry
    assert result.json == {
        "path": str(path),
        "rows": 61,
        **judged.peak._asdict(),
        "leave_one_out": judged.leave_one_out._asdict(),
        "geometry": {
            "difference": difference._asdict(),
            "scale": scale,
            "difference_after_scaling": scaled._asdict(),
        },
        "lookup_error": judged.lookup_error,
        "checks": [],
        "warnings": judged.warnings,
    }


@pytest.mark.usefixtures("constructed")
def test_a_computed_curve_is_written_or_printed(tmp_path):
    path, csv = tmp_path / "curve.csv", computed_curve().csv
    written = broken("curve", "--out", path)
    assert path.read_text() == csv
    assert "1 of 2 checks hold" in written.out
    assert f"written  {path}" in written.out
    printed = broken("curve")
    assert printed.out == csv
    same, peak, message = printed.err.splitlines()
    assert same.endswith("torque_curve.csv: the curve is the same")
    assert peak == "peak 0.01250 N·m/A at 9.50°; a doubled mesh moves it by 1e-05 of itself"
    assert message == "spheretwin: magnetics curve: broken: lookup"


@pytest.mark.parametrize(
    ("flags", "settings", "command"),
    [
        (["check", "--poses", 2, "--seed", 5], [2, 5], "check --poses 2 --seed 5"),
        (["map", "--largest-tilt", 4, "--need", 0.5], [0.5], "map --largest-tilt 4 --need 0.5"),
        (["map"], [None], "map --largest-tilt 57"),
    ],
)
def test_a_page_states_the_command_of_its_settings(constructed, tmp_path, flags, settings, command):
    result = broken(*flags, "--out", tmp_path, "--figure-format", "pdf")
    assert constructed["judge"][1 : 1 + len(settings)] == tuple(settings)
    folder, *_, stated, figure_format = constructed[f"write_{flags[0]}"]
    assert (folder, stated, figure_format) == (tmp_path, f"spheretwin magnetics {command}", "pdf")
    assert "written  page" in result.out
    if flags[0] == "map":
        assert constructed["survey"][1] == float(command.split()[2])


def test_a_curve_of_another_geometry_is_named(monkeypatch):
    verdict = field_verdict()
    sources = verdict.sources._replace(curve_between_samples_of_peak=0.029)
    far = verdict._replace(sources=sources, checks=verdict.checks[::-1])
    monkeypatch.setattr(field_check, "judge", lambda *_: far)
    assert "2.9 % of its peak away" in broken("check").err


def test_missing_packages_are_named_before_the_work(monkeypatch, tmp_path):
    monkeypatch.setattr(markdown, "find_spec", lambda name: None)
    assert install_command("plots") in refusal("magnetics", "map", "--out", tmp_path / "figures")
    assert not (tmp_path / "figures").exists()
    monkeypatch.setitem(sys.modules, "magpylib.magnet", None)
    assert install_command("magnetics") in refusal("magnetics", "check", "--poses", "1")
