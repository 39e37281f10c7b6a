"""``spheretwin magnetics``: arguments, files and exit codes, of constructed results and of computed ones."""

import sys

import pytest

from spheretwin import cli
from spheretwin.models.base.extras import install_command
from spheretwin.models.design import curve_check, field_check, torque_map
from spheretwin.viz.pages import magnetics, markdown
from tests.content.verdicts import computed_curve, field_verdict, judged_curve, survey, workspace_verdict
from tests.twin.cli.calls import call, refusal


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
