"""Warnings where model, torque curve and scenario do not agree."""

import re

import pytest

from spheretwin import cli
from spheretwin import scenario as scenarios
from spheretwin.models import actuator as actuators
from spheretwin.session import Session
from tests.twin.cli.calls import call, refusal

# A copy finds its meshes where they are.
TEXT = actuators.MJCF_PATH.read_text(encoding="utf-8").replace(
    'meshdir="assets"', f'meshdir="{actuators.FOLDER / "assets"}"'
)
OPTION = '<option integrator="RK4" timestep="0.0005">'
FLAGS = '<flag autoreset="disable" contact="disable"/>'
CURVE = "torque curve torque_curve.csv was computed for "


@pytest.fixture
def written(tmp_path):
    def write(*edits):
        text = TEXT
        for old, new in edits:
            assert old in text
            text = text.replace(old, new)
        (path := tmp_path / "mine.xml").write_text(text, encoding="utf-8")
        return path

    return write


def warnings(path, overrides):
    """Return the warnings of a session."""
    with Session(scenarios.load("hold", {"plant.mjcf": str(path)} | overrides)) as session:
        return session.warnings()


def warnings_of_a_run(path, *flags):
    """Return the warnings among the figures of a run, which prints nothing else."""
    # Started where it is to be held, the rotor needs no torque that would be worth a warning.
    pose = ["--plant.initial-rad", "0.2", "-0.1", "0.3", "--controller.law", "pd"]
    result = call("simulate", "hold", "--duration", "0.003", "--plant.mjcf", path, *pose, *flags, "--json")
    assert (result.code, result.err) == (cli.DONE, "")
    return result.json["warnings"]


GEOMETRY = {
    "poles inward": ('pos="0.045 0 0"', 'pos="0.0445 0 0"', "magnet distance_m 0.045, the model has 0.0445"),
    "coils outward": ('pos="0.063 0 0"', 'pos="0.0635 0 0"', "coil distance_m 0.063, the model has 0.0635"),
    "turns": ('_turns" data="320"', '_turns" data="300"', "coil turns 320, the model has 300"),
    "remanence": ('data="1.2"', 'data="1.25"', "magnet remanence_T 1.2, the model has 1.25"),
    "pole radius": ('size="0.010 0.005"', 'size="0.009 0.005"', "magnet radius_m 0.01, the model has 0.009"),
    "bore": ('data="0.003"', 'data="0.004"', "coil inner_radius_m 0.003, the model has 0.004"),
}  # fmt: skip


def test_each_difference_of_the_geometry_has_its_line(written):
    for old, new, line in GEOMETRY.values():
        assert warnings(written((old, new)), {}) == [CURVE + line]
    lines = warnings(written(*((old, new) for old, new, _ in GEOMETRY.values())), {})
    assert sorted(lines) == sorted(CURVE + line for _, _, line in GEOMETRY.values())


OVERRIDDEN = {
    "timestep": (((OPTION, OPTION.replace("0.0005", "0.001")),), {},
                 "timestep of 0.001 s is not used: plant.step_s is 0.0005 s"),
    "timestep that differs by little": (((OPTION, OPTION.replace("0.0005", "0.00050000001")),), {},
                                        "timestep of 0.00050000001 s is not used: plant.step_s is 0.0005 s"),
    "step": ((), {"plant.step_s": 1e-4}, "timestep of 0.0005 s is not used: plant.step_s is 0.0001 s"),
    "integrator": (((OPTION, OPTION.replace("RK4", "implicitfast")),), {},
                   "integrator implicitfast is not used: plant.integrator is RK4"),
    "integrator that a scenario cannot name": (((OPTION, OPTION.replace("RK4", "discrete")),), {},
                                               "integrator discrete is not used: plant.integrator is RK4"),
    "another integrator": ((), {"plant.integrator": "Euler"},
                           "integrator RK4 is not used: plant.integrator is Euler"),
    "gravity": (((OPTION, OPTION.replace(">", ' gravity="0 0 -1.62">')),), {"plant.gravity_m_s2": 9.81},
                "gravity of 0 0 -1.62 m/s² is not used: plant.gravity_m_s2 is 9.81 m/s²"),
    "gravity aslant": (((OPTION, OPTION.replace(">", ' gravity="1 0 -9.8">')),), {"plant.gravity_m_s2": 9.8},
                       "gravity of 1 0 -9.8 m/s² is not used: plant.gravity_m_s2 is 9.8 m/s²"),
    "gravity switched off": (((FLAGS, '<flag gravity="disable"/>'),), {"plant.gravity_m_s2": 9.81},
                             "gravity of 0 0 0 m/s² is not used: plant.gravity_m_s2 is 9.81 m/s²"),
}  # fmt: skip


@pytest.mark.parametrize(("edits", "overrides", "line"), OVERRIDDEN.values(), ids=OVERRIDDEN)
def test_an_option_of_the_model_that_the_scenario_overrides_is_named(written, edits, overrides, line):
    assert warnings(written(*edits), overrides) == [f"the model's own {line}"]


SILENT = {
    "the shipped model": ((), {}),
    "no options": (((OPTION, "<option>"),), {}),
    "gravity that is used": (((OPTION, OPTION.replace(">", ' gravity="1 0 -1.62">')),), {}),
    "weightlessness that is used": (((FLAGS, '<flag gravity="disable"/>'),), {}),
    "the same said twice": (
        ((OPTION, '<option integrator="implicitfast" timestep="0.001" gravity="0 0 -1.62">'),),
        {"plant.integrator": "implicitfast", "plant.step_s": 0.001, "plant.gravity_m_s2": 1.62},
    ),
}  # fmt: skip


@pytest.mark.parametrize(("edits", "overrides"), SILENT.values(), ids=SILENT)
def test_without_a_difference_there_is_no_warning(written, edits, overrides):
    assert warnings(written(*edits), overrides) == []


def test_defaults_of_the_engine_that_a_file_states_are_named(written):
    stated = (OPTION, '<option integrator="Euler" timestep="0.002" gravity="0 0 -9.81">')
    lines = warnings(written(stated), {"plant.gravity_m_s2": 1.62})
    assert [line.split()[3] for line in lines] == ["timestep", "integrator", "gravity"]


def test_a_run_has_the_warnings_of_its_session(written):
    (old, new, line), (edits, _, own) = GEOMETRY["turns"], OVERRIDDEN["timestep"]
    path = written((old, new), *edits)
    assert warnings_of_a_run(path) == warnings(path, {}) == [CURVE + line, f"the model's own {own}"]
    assert warnings_of_a_run(written()) == []


def test_a_change_during_the_run_is_told_from_then_on(written):
    path = written((OPTION, OPTION.replace(">", ' gravity="0 0 -1.62">')))
    with Session(scenarios.load("hold", {"plant.mjcf": str(path)})) as session:
        assert session.warnings() == []
        session.set("plant.gravity_m_s2", 9.81)
        (line,) = session.warnings()
        assert re.search(r"gravity of 0 0 -1\.62 .* is 9\.81", line)
        session.set("plant.integrator", "Euler")
        assert len(session.warnings()) == 2


def test_weightlessness_is_no_negative_zero(written):
    # It is in the record of the run.
    for edit in ((FLAGS, '<flag gravity="disable"/>'), (OPTION, OPTION.replace(">", ' gravity="0 0 0">'))):
        with Session(scenarios.load("hold", {"plant.mjcf": str(written(edit))})) as session:
            assert str(session.scenario.plant.gravity_m_s2) == "0.0"


DEPRECATED = 'autolimits="true"', 'autolimits="true" settotalmass="3"'
FLEX = '<deformable><flex name="cloth" dim="1" body="rotor payload" element="0 1"/></deformable>'
COMPILER = {
    "settotalmass": (DEPRECATED, "compiler attribute 'settotalmass' is deprecated"),
    "flex": (("</mujoco>", FLEX + "</mujoco>"), "flex 'cloth' is not rigid and has no equality constraints"),
}


@pytest.mark.parametrize(("edit", "line"), COMPILER.values(), ids=COMPILER)
def test_a_warning_of_the_compiler_is_one_line_of_ours(written, edit, line, capfd, tmp_path):
    """The engine's Python package raises it as a warning at each of three compilations, in several lines.

    A recording adds none, though meshes are read by a compilation of their own.
    """
    path, record = written(edit), ["--record", tmp_path / "run.rrd"]
    for received in (warnings(path, {"plant.engine": "mujoco"}), warnings_of_a_run(path, *record)):
        (text,) = received
        assert text.startswith(f"model {path}: {line}")
        assert "\n" not in text
    assert capfd.readouterr() == ("", "")


def test_a_flexible_grid_has_no_line_but_the_refusal(written, capfd):
    grid = (
        '<flexcomp name="cloth" type="grid" count="3 3 1" spacing="0.05 0.05 0.05" dim="2" mass="0.1"'
        ' pos="0 0 1"/></worldbody>'
    )
    message = refusal("simulate", "hold", "--plant.mjcf", written(("</worldbody>", grid)))
    assert message.startswith("model: expected three degrees of freedom, received 30")
    assert capfd.readouterr() == ("", "")


def test_other_verbs_print_it_once(written, capfd):
    result = call("magnetics", "map", "--largest-tilt", "0", "--mjcf", written(DEPRECATED))
    assert result.code == cli.DONE
    (line,) = result.err.splitlines()
    assert line.startswith("spheretwin: warning: model ")
    assert capfd.readouterr() == ("", "")
