"""``spheretwin magnetics`` as its users meet it; long parts on small numbers of poses."""

import json
import sys

import numpy as np
import pytest

from spheretwin import cli
from spheretwin.models import actuator as actuators
from spheretwin.models import torque_curve
from spheretwin.models.base.extras import install_command
from spheretwin.models.design import curve_check, direct_summation, torque_map
from spheretwin.models.design import field_check as field_verdict
from spheretwin.models.torque_curve import TorqueCurve
from spheretwin.viz.pages import magnetics, markdown
from tests.models.design.quadrature import sample_coarsely, sum_coarsely

ASSETS = str(actuators.FOLDER / "assets")


def here(capsys, *arguments):
    """The same in this process, so that parts of it can be replaced: exit code, stdout, stderr."""
    code = cli.main(["magnetics", *map(str, arguments)])
    return code, *capsys.readouterr()


def one_line(stderr):
    (line,) = stderr.splitlines()
    assert line.startswith("spheretwin: ")
    return line


@pytest.fixture
def changed_model(tmp_path):
    """Write the shipped MJCF with pieces of its text replaced."""

    def write(*replacements):
        text = actuators.MJCF_PATH.read_text().replace('meshdir="assets"', f'meshdir="{ASSETS}"')
        for old, new in replacements:
            assert old in text
            text = text.replace(old, new)
        path = tmp_path / "changed.xml"
        path.write_text(text)
        return path

    return write


@pytest.fixture
def user_csv(tmp_path):
    """Coarse data of a weaker magnet, as from a bench."""

    def write(scale=0.93):
        shipped_curve = actuators.load().torque_curve
        rows = np.r_[0:120:4, 120:721:20]
        path = tmp_path / "bench.csv"
        curve = TorqueCurve(shipped_curve.phi_rad[rows], scale * shipped_curve.torque_Nm_per_A[rows])
        path.write_text(torque_curve.to_csv(curve, ["bench"]))
        return path

    return write


@pytest.fixture(scope="module")
def results():
    """Results of the long computations, by their arguments."""
    return {}


def computed_once(monkeypatch, results, module, name):
    """Let a function of a module return the result of an earlier test for the same arguments."""
    function = getattr(module, name)

    def from_results(*arguments):
        key = name, repr([argument for argument in arguments if not callable(argument)])
        if key not in results:
            results[key] = function(*arguments)
        return results[key]

    monkeypatch.setattr(module, name, from_results)


# curve


@pytest.mark.release("recomputes curves or fields for 0.7 to 4 s; content of command_magnetics has the texts")
def test_user_s_curve_is_judged_in_a_table(capsys, user_csv, monkeypatch, results):
    computed_once(monkeypatch, results, curve_check, "judge")
    code, out, err = here(capsys, "curve", "--csv", user_csv())
    assert (code, err) == (0, "")
    assert "0.93" in out
    assert "leave-one-out" in out


@pytest.mark.release("recomputes curves or fields for 1.4 to 4 s; content of command_magnetics has the texts")
def test_user_s_curve_is_judged_in_json(capsys, user_csv, monkeypatch, results):
    computed_once(monkeypatch, results, curve_check, "judge")
    code, out, err = here(capsys, "curve", "--csv", user_csv(), "--json")
    assert (code, err) == (0, "")
    figures = json.loads(out)
    assert figures["rows"] == 61
    assert figures["geometry"]["scale"] == pytest.approx(0.93, abs=1e-6)
    assert figures["geometry"]["difference_after_scaling"]["worst"] < 1e-6
    assert figures["geometry"]["difference"]["worst"] == pytest.approx(0.07, rel=0.01)
    assert 0 < figures["leave_one_out"]["rms"] < 0.01
    assert 0 < figures["lookup_error"] < 1e-4
    assert figures["checks"] == []


@pytest.fixture
def few_samples(monkeypatch):
    """A twentieth of the samples: the checks and their exit code, not the figures."""
    sample_coarsely(monkeypatch)


@pytest.mark.release("recomputes curves or fields for 0.7 to 4 s; content of command_magnetics has the texts")
@pytest.mark.usefixtures("few_samples")
def test_a_warning_of_the_model_is_printed_with_the_verdict_on_a_curve(capsys, user_csv, changed_model):
    model = changed_model(('autolimits="true"', 'autolimits="true" settotalmass="3"'))
    code, out, err = here(capsys, "curve", "--csv", user_csv(), "--mjcf", model, "--json")
    assert (code, json.loads(out)["rows"]) == (0, 61)
    assert "settotalmass" in one_line(err)


@pytest.mark.release("recomputes curves or fields for 0.7 to 4 s; content of command_magnetics has the texts")
@pytest.mark.usefixtures("few_samples")
def test_computed_curve_gives_its_figures_as_json(capsys, monkeypatch, results):
    computed_once(monkeypatch, results, curve_check, "compute")
    compute, computations = curve_check.compute, []

    def compute_and_keep(*arguments):
        computed = compute(*arguments)
        mesh = computed.doubled_mesh._replace(worst=3 * computed.doubled_mesh.peak)
        computations.append(computed._replace(doubled_mesh=mesh))
        return computations[-1]

    monkeypatch.setattr(curve_check, "compute", compute_and_keep)
    _, out, _ = here(capsys, "curve", "--json")
    figures, (computed,) = json.loads(out), computations
    assert figures["doubled_mesh_moves_peak"] == computed.doubled_mesh.peak
    assert figures["doubled_mesh_moves_worst_sample"] == computed.doubled_mesh.worst
    assert figures["lookup_error"] == computed.lookup_error
    assert {name: figures[name] for name in computed.peak._fields} == computed.peak._asdict()
    assert len(figures["checks"]) == len(computed.checks)


@pytest.mark.release("recomputes curves or fields for 1.4 to 4 s; content of command_magnetics has the texts")
@pytest.mark.usefixtures("few_samples")
def test_computed_curve_is_written_and_judged(capsys, tmp_path, monkeypatch, results):
    computed_once(monkeypatch, results, curve_check, "compute")
    out = tmp_path / "curve.csv"
    code, text, err = here(capsys, "curve", "--out", out)
    assert code == 0
    assert one_line(err).endswith("torque_curve.csv: the curve is the same")
    assert "2 of 2 checks hold" in text
    assert len(torque_curve.read(out).phi_rad) == 37
    code, text, err = here(capsys, "curve")
    assert (code, text) == (0, out.read_text())
    assert err.splitlines()[1].startswith("peak 0.02")


@pytest.mark.release("recomputes curves or fields for 0.7 to 4 s; content of command_magnetics has the texts")
@pytest.mark.usefixtures("few_samples")
def test_computed_curve_that_breaks_a_bound_fails(capsys, monkeypatch):
    right = curve_check.lookup_table
    monkeypatch.setattr(curve_check, "lookup_table", lambda curve: (1 + 1e-5) * right(curve))
    code, out, err = here(capsys, "curve", "--json")
    assert code == 1
    assert err.splitlines()[-1] == "spheretwin: magnetics curve: broken: lookup"
    mesh, lookup = json.loads(out)["checks"]
    assert set(mesh) >= {"name", "value", "bound", "ok", "why"}
    assert (mesh["ok"], lookup["ok"]) == (True, False)


# check


@pytest.fixture
def coarse(monkeypatch):
    """Fewer points in the windings."""
    sum_coarsely(monkeypatch)


@pytest.fixture
def one_check(monkeypatch, coarse, results):
    computed_once(monkeypatch, results, field_verdict, "judge")


@pytest.mark.release("recomputes curves or fields for 0.7 to 4 s; content of command_magnetics has the texts")
def test_check_gives_its_verdict_as_json(capsys, one_check, monkeypatch):
    judge, verdicts = field_verdict.judge, []

    def judge_and_keep(actuator, poses, seed, *more):
        assert (poses, seed) == (2, 5)
        verdicts.append(judge(actuator, poses, seed, *more))
        return verdicts[-1]

    monkeypatch.setattr(field_verdict, "judge", judge_and_keep)
    code, out, err = here(capsys, "check", "--poses", 2, "--seed", 5, "--json")
    assert (code, err) == (0, "")
    figures, (verdict,) = json.loads(out), verdicts
    assert list(figures) == list(verdict._fields)
    assert [row["tilt_deg"] for row in figures["by_tilt"]] == [[0, 12], [12, 24]]
    assert figures["by_tilt"][1]["largest_relative_error"] == verdict.by_tilt[1].largest_relative_error
    assert figures["checks"] == [check.row() for check in verdict.checks]
    assert figures["sources"] == verdict.sources._asdict()


@pytest.mark.release("recomputes curves or fields for 1.4 to 4 s; content of command_magnetics has the texts")
def test_check_prints_a_table(capsys, one_check):
    code, out, err = here(capsys, "check", "--poses", 2, "--seed", 5)
    assert (code, err) == (0, "")
    assert "0° to 12°" in out
    assert "Sources of the error" in out
    assert "8 of 8 checks hold" in out


def test_check_writes_a_page(capsys, one_check, tmp_path):
    code, out, err = here(capsys, "check", "--poses", 2, "--seed", 5, "--out", tmp_path, "--json")
    assert (code, err) == (0, "")
    figures = json.loads(out)
    names = {"magnetics_check.md", "magnetics_check.html", "magnetics_margins.svg"}
    assert {path.name for path in tmp_path.iterdir()} == names
    text = (tmp_path / "magnetics_check.md").read_text(encoding="utf-8")
    assert "Number of checks: 8. **No bound is exceeded.**" in text.split("- [Figures]")[0]
    for check in figures["checks"]:
        assert f"| {check['name']} | {check['compares']} |" in text
    for band in figures["by_tilt"]:
        low, high = band["tilt_deg"]
        assert f"| {low:.0f}° to {high:.0f}° | 1 | {100 * band['median_relative_error']:.3f} % |" in text
    assert "Created by `spheretwin magnetics check --poses 2 --seed 5` with" in text
    with_one_bound = [
        check["name"] for check in figures["checks"] if check["bound"] and not check["at_least"]
    ]
    html = (tmp_path / "magnetics_check.html").read_text(encoding="utf-8")
    assert all(f">{name}</text>" in html for name in with_one_bound)


@pytest.fixture
def wrong_field(monkeypatch):
    """Direct sums that are wrong and take no time."""
    monkeypatch.setattr(direct_summation, "direct_torque_matrix", lambda *_: -np.ones((3, 18)))


@pytest.mark.release("recomputes curves or fields for 0.7 to 4 s; content of command_magnetics has the texts")
def test_check_fails_where_the_field_is_another(capsys, coarse, wrong_field):
    code, out, err = here(capsys, "check", "--poses", 1, "--json")
    assert code == 1
    assert "broken: torque" in one_line(err)
    assert json.loads(out)["checks"][0]["value"] == pytest.approx(1, rel=0.1)


@pytest.mark.release("recomputes curves or fields for 0.7 to 4 s; content of command_magnetics has the texts")
def test_check_finds_a_wrong_curve_and_says_so(capsys, coarse, user_csv):
    code, out, err = here(capsys, "check", "--poses", 1, "--csv", user_csv(1.03), "--json")
    assert code == 1
    assert not json.loads(out)["checks"][0]["ok"]
    assert "2.9 % of its peak away" in err
    assert "broken: torque" in err


# map


@pytest.mark.release("recomputes curves or fields for 0.7 to 4 s; content of command_magnetics has the texts")
def test_map_prints_tables_and_writes_a_page(capsys, tmp_path, actuator):
    folder = tmp_path / "page"
    arguments = ["map", "--largest-tilt", 4, "--need", 0.5, "--out", folder, "--figure-format", "pdf"]
    code, out, err = here(capsys, *arguments)
    assert (code, err) == (0, "")
    assert "weakest poses" in out
    figures = {f"capability_{name}.{kind}" for name in ("by_tilt", "map") for kind in ("svg", "pdf")}
    pages = ["magnetics_map.md", "magnetics_map.html"]
    assert {path.name for path in folder.iterdir()} == {*pages, *figures}
    assert all(f"written  {folder / name}" in out for name in pages)
    text = (folder / pages[0]).read_text(encoding="utf-8")
    surveyed = torque_map.survey(actuator, largest_tilt_deg=4)
    verdict = torque_map.judge(surveyed, 0.5)
    worst = {
        name: min(getattr(pose, name) for pose in verdict.weakest) for name in ("least_norm_Nm", "best_Nm")
    }
    summary = text.split("- [Figures]")[0]
    assert "up to a tilt of 4°" in summary
    assert f"least-norm currents give at least {worst['least_norm_Nm']:.3f} N·m in every direction" in summary
    assert f"the best currents give at least {worst['best_Nm']:.3f} N·m" in summary
    assert "Number of checks: 2. **No bound is exceeded.**" in summary
    headings = [line for line in text.splitlines() if line.startswith("## ")]
    assert [heading.split(" at ")[0] for heading in headings] == [
        "## Figures", "## Torque in every direction",
        "## Torque matrix and copper loss in the worst of these poses", "## Weakest poses", "## Checks",
    ]  # fmt: skip
    first = verdict.by_tilt[0]
    assert (
        f"| 0° | {first.least_norm_Nm:.3f} | {first.least_norm_median_Nm:.3f} | {first.best_Nm:.3f} |" in text
    )
    assert "Created by `spheretwin magnetics map --largest-tilt 4 --need 0.5` with" in text
    html = (folder / pages[1]).read_text(encoding="utf-8")
    assert html.count("<svg") == 2
    assert ">tilt of the shaft, degrees</text>" in html


@pytest.mark.release("recomputes curves or fields for 0.7 to 4 s; content of command_magnetics has the texts")
def test_headings_of_a_map_are_complete_in_80_columns_and_explained(capsys, monkeypatch):
    monkeypatch.setenv("COLUMNS", "80")
    code, out, _ = here(capsys, "map", "--largest-tilt", 10)
    assert code == 0
    lines = out.splitlines()
    assert max(map(len, lines)) <= 80
    for head in (magnetics.TORQUE_HEAD, magnetics.MATRIX_HEAD, magnetics.POSE_HEAD):
        (line,) = [line for line in lines if line.startswith("| ") and all(name in line for name in head)]
        # The row before it is empty and the one after it is the rule: the heading is one line.
        place = lines.index(line)
        assert (lines[place - 1].strip(), lines[place + 1][:2]) == ("", "|-")
    text = " ".join(out.split())
    assert magnetics.MAP_TERMS in text
    assert "best_currents" in magnetics.MAP_TERMS


@pytest.mark.release("recomputes curves or fields for 0.7 to 4 s; content of command_magnetics has the texts")
def test_page_of_a_map_names_a_need_that_is_not_met(capsys, tmp_path):
    code, _, err = here(capsys, "map", "--largest-tilt", 0, "--need", 0.88, "--out", tmp_path)
    assert code == 1
    assert "broken: need" in one_line(err)
    assert "**Exceeded bounds: need.**" in (tmp_path / "magnetics_map.md").read_text(encoding="utf-8")


@pytest.mark.release("recomputes curves or fields for 1.4 to 4 s; content of command_magnetics has the texts")
def test_map_gives_its_verdict_as_json(capsys, actuator):
    code, out, err = here(capsys, "map", "--largest-tilt", 2, "--json")
    assert (code, err) == (0, "")
    figures = json.loads(out)
    verdict = torque_map.judge(torque_map.survey(actuator, largest_tilt_deg=2))
    assert list(figures) == list(verdict._fields)
    assert figures["by_tilt"] == [row._asdict() for row in verdict.by_tilt]
    assert figures["weakest"] == [pose._asdict() for pose in verdict.weakest]
    assert figures["checks"] == [check.row() for check in verdict.checks]


def test_map_fails_where_more_is_needed(capsys):
    assert here(capsys, "map", "--largest-tilt", 0, "--need", 0.87)[0] == 0
    code, out, err = here(capsys, "map", "--largest-tilt", 0, "--need", 0.88)
    assert code == 1
    assert "BROKEN" in out
    assert "1 of 2 checks hold" in out
    assert "broken: need" in one_line(err)


def test_map_warns_of_lost_rank_and_goes_on(capsys, changed_model):
    path = changed_model(
        ('pole_lower_north" class="north"', 'pole_lower_north" class="x"'),
        ('pole_lower_south" class="south"', 'pole_lower_south" class="north"'),
        ('pole_lower_north" class="x"', 'pole_lower_north" class="south"'),
    )
    code, out, err = here(capsys, "map", "--largest-tilt", 1, "--mjcf", path, "--json")
    assert code == 0
    assert "warning: the torque matrix loses the direction" in one_line(err)
    assert "α" in err
    figures = json.loads(out)
    assert figures["warnings"][0] in err
    assert figures["by_tilt"][0]["condition"] is None
    assert figures["by_tilt"][0]["best_Nm"] == 0
    # With a bound it fails.
    assert here(capsys, "map", "--largest-tilt", 0, "--mjcf", path, "--need", 0.1)[0] == 1


@pytest.mark.parametrize("arguments", [["map", "--largest-tilt", 0], ["check", "--poses", 1]])
def test_overlapping_coils_are_named(capsys, coarse, wrong_field, changed_model, arguments):
    path = changed_model(('size="0.011 0.0125"', 'size="0.012 0.0125"'))
    code, out, err = here(capsys, *arguments, "--mjcf", path, "--json")
    warning, curve = json.loads(out)["warnings"]
    for line in (warning, curve):
        assert f"spheretwin: warning: {line}" in err.splitlines()
    assert curve.endswith("was computed for coil outer_radius_m 0.011, the model has 0.012")
    assert "coil 0 (latitude 28°, azimuth 0°) and coil 1" in warning
    assert "23 more pairs" in warning
    # The field breaks `check`, the overlap alone breaks nothing.
    assert code == (1 if arguments[0] == "check" else 0)


def test_missing_matplotlib_is_named_before_the_work(capsys, tmp_path, monkeypatch):
    monkeypatch.setattr(markdown, "find_spec", lambda name: None)
    code, _, err = here(capsys, "map", "--out", tmp_path / "figures")
    assert code == 2
    assert install_command("plots") in one_line(err)
    assert not (tmp_path / "figures").exists()


def test_missing_magpylib_is_named(capsys, monkeypatch):
    monkeypatch.setitem(sys.modules, "magpylib.magnet", None)
    code, _, err = here(capsys, "check", "--poses", "1")
    assert code == 2
    assert install_command("magnetics") in one_line(err)
