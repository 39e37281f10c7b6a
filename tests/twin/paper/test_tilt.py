"""Figure 11: laws, single changes, and the paper's figure."""

import numpy as np
import pytest

from spheretwin import scenario as scenarios
from spheretwin.control.laws.pid import BANDWIDTH_rad_s
from spheretwin.paper import tilt
from spheretwin.paper.runner import make_plan, run_plan
from spheretwin.scenario.fields import flat
from spheretwin.viz.theme import LAW_COLOURS, LAW_MARKS

PRINTED = {case.columns["law"]: case for case in tilt.FILE.cases if case.columns["as_printed"]}
CHANGED = [case for case in tilt.FILE.cases if not case.columns["as_printed"]]

COMPILES = pytest.mark.release("compiles a loop for 12 s; content of figure 11 has its tables")


@pytest.fixture(scope="module")
def outcomes():
    """All cases with two seeds, by the faster engine, which agrees."""
    return run_plan(make_plan(tilt.EXPERIMENT, seeds=2, plant="lagrangian"))


def test_laws_are_the_paper_s_a_tuned_pid_and_ours():
    assert list(PRINTED) == ["pd", "adaptive_fuzzy", "afsm", "pid", "afsm_eso"]
    for looks in zip(*((LAW_COLOURS[law], *LAW_MARKS[law]) for law in PRINTED), strict=True):
        assert len(set(looks)) == len(PRINTED)  # distinct by colour, by marker and by dash
    assert f"{BANDWIDTH_rad_s:g} 1/s" in PRINTED["pid"].columns["gains"]
    for law, case in PRINTED.items():
        scenario = scenarios.load("tilt", case.fields)
        assert scenario.hardware == "electronics"
        assert scenario.plant.payload_kg == 0.05
        preset = {"preset": "prototype"} if law == "afsm_eso" else {}
        assert scenario.controller == type(scenario.controller)(**preset)  # printed gains are the defaults


@pytest.mark.parametrize(
    "case", [case for case in CHANGED if "hardware" in case.fields], ids=lambda case: case.name
)
def test_a_change_is_of_one_thing_alone(case):
    cases = case, PRINTED[case.columns["law"]]
    changed, unchanged = (flat(scenarios.load("tilt", case.fields).model_dump(mode="json")) for case in cases)
    fields = {name for name in changed | unchanged if changed.get(name) != unchanged.get(name)}
    sections, named = ({name.split(".")[place] for name in fields} for place in (0, 1))
    assert len(sections) == 1
    # Another estimator has other fields; an acceleration within bounds is of use where it becomes torque.
    if sections != {"estimator"} and named != {"governor", "feed_forward"}:
        assert len(fields) == 1


@COMPILES
def test_order_of_the_paper_is_kept_and_the_tuned_laws_are_ahead(outcomes):
    errors = [[run.measured_max_abs_error[0] for run in outcomes[case.name]] for case in PRINTED.values()]
    assert np.all(np.diff(errors[:3], axis=0) < 0)
    assert np.all(np.max(errors[3:], axis=0) < errors[2])
    assert "holds for α under 2 of 2 seeds" in tilt.printed_section(outcomes).text


def test_ideal_sensors_leave_afsm_what_the_corners_cost():
    cases = [case for case in tilt.EXPERIMENT.cases() if case.name.startswith("afsm: ideal hardware")]
    plan = make_plan(tilt.EXPERIMENT._replace(cases=lambda: cases), seeds=1, plant="lagrangian")
    outcomes = run_plan(plan)
    (ideal,) = outcomes["afsm: ideal hardware"]
    assert np.degrees(ideal.max_abs_error[0]) == pytest.approx(0.239, abs=5e-4)  # as README prints it
    (rounded,) = outcomes["afsm: ideal hardware, corners at 0.2 rad/s²"]
    assert rounded.max_abs_error[0] < 0.55 * ideal.max_abs_error[0]


@COMPILES
def test_one_change_brings_each_law_to_the_paper(outcomes):
    section = tilt.change_section(outcomes)
    said = {(law, what): reached for law, what, reached, *_ in section.tables[0].rows}
    for law in ("PD", "adaptive fuzzy", "AFSM"):
        assert "yes" in [reached for (of, what), reached in said.items() if of == law and "ideal" not in what]
        assert said[law, "true rates"] == "no"
    assert said["AFSM", "ideal hardware"] == "no"
    assert {reached for (law, _), reached in said.items() if law == "tuned PID"} == {"–"}


def test_reached_is_by_the_median():
    errors = ([0.1, 0.126, 9.0], [1.0]), ([0.127], [0.1]), ([0.127], [0.127])  # 1.05 times 0.12 is the bound
    said = [tilt.reached(0.12, *map(np.radians, each)) for each in errors]
    assert said == ["yes", "by the true error", "no"]
