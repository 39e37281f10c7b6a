"""Warnings where model, torque curve and scenario do not agree; tests/content has their texts."""

import re

from spheretwin import scenario as scenarios
from spheretwin.session import Session
from tests.models.model_files import edited
from tests.twin.cli.calls import call, refusal

OPTION = '<option integrator="RK4" timestep="0.0005">'
FLAGS = '<flag autoreset="disable" contact="disable"/>'
GEOMETRY = [
    ('pos="0.045 0 0"', 'pos="0.0445 0 0"'), ('pos="0.063 0 0"', 'pos="0.0635 0 0"'),
    ('_turns" data="320"', '_turns" data="300"'), ('data="1.2"', 'data="1.25"'),
    ('size="0.010 0.005"', 'size="0.009 0.005"'), ('data="0.003"', 'data="0.004"'),
]  # fmt: skip
DEPRECATED = ('autolimits="true"', 'autolimits="true" settotalmass="3"')
FLEX = (
    "</mujoco>",
    '<deformable><flex name="cloth" dim="1" body="rotor payload" element="0 1"/></deformable></mujoco>',
)


def test_a_change_during_the_run_is_told_from_then_on(tmp_path):
    path = edited(tmp_path, (OPTION, OPTION.replace(">", ' gravity="0 0 -1.62">')))
    with Session(scenarios.load("hold", {"plant.mjcf": str(path)})) as session:
        assert session.warnings() == []
        session.set("plant.gravity_m_s2", 9.81)
        (line,) = session.warnings()
        assert re.search(r"gravity of 0 0 -1\.62 .* is 9\.81", line)
        session.set("plant.integrator", "Euler")
        assert len(session.warnings()) == 2


def test_weightlessness_is_no_negative_zero(tmp_path):
    # It is in the record of the run.
    for edit in ((FLAGS, '<flag gravity="disable"/>'), (OPTION, OPTION.replace(">", ' gravity="0 0 0">'))):
        with Session(scenarios.load("hold", {"plant.mjcf": str(edited(tmp_path, edit))})) as session:
            assert str(session.scenario.plant.gravity_m_s2) == "0.0"


def test_the_engine_prints_nothing_of_its_own(capfd, tmp_path):
    """Its Python package raises a warning at each of three compilations, in several lines."""
    for edit in (DEPRECATED, FLEX):
        record = ["--record", tmp_path / "run.rrd"]  # which reads meshes by a compilation of its own
        run = call(
            "simulate",
            "hold",
            "--duration",
            "0.003",
            "--plant.mjcf",
            edited(tmp_path, edit),
            *record,
            "--json",
        )
        assert run.err == ""
        assert "\n" not in run.json["warnings"][0]
    grid = '<flexcomp name="cloth" type="grid" count="3 3 1" spacing="0.05 0.05 0.05" dim="2" mass="0.1"/>'
    refusal("simulate", "hold", "--plant.mjcf", edited(tmp_path, ("</worldbody>", f"{grid}</worldbody>")))
    assert capfd.readouterr() == ("", "")
