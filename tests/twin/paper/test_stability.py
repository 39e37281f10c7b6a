"""Stability: V from its definition, margins by their ends, and the reduction of a run."""

from types import SimpleNamespace

import numpy as np
import pytest

from spheretwin import scenario as scenarios
from spheretwin.models.telemetry.status import Status
from spheretwin.paper import stability
from spheretwin.paper.experiment import Outcomes
from spheretwin.paper.frequency_response import LINES_Hz, linear_loop
from spheretwin.paper.lyapunov import consequents, descent, regressor
from spheretwin.paper.runner import make_plan, scenario_of
from spheretwin.paper.stability import REACHED_rad_s, reduce
from spheretwin.simulation import simulate
from tests.twin.paper.cases import outcome

FAST = {"plant.engine": "lagrangian", "duration": 2.0}


@pytest.fixture(scope="module")
def run():
    return simulate(scenarios.load("sinusoid", {**FAST, "controller.law": "afsm"}))


def test_consequents_from_the_telemetry_give_the_logged_fuzzy_torque(run):
    table, gains = run.telemetry, run.scenario.controller
    for axis, inertia in enumerate(run.scenario.nominal.inertia_kg_m2):
        psi = regressor(table["qdot_rad_s"][:, axis], table["q_rad"][:, axis])
        theta = consequents(psi, table["sliding_s"][:, axis], gains.fuzzy_rate[axis], gains.period_s)
        ours = inertia * np.sum(theta * psi, axis=1)
        logged = table["fuzzy_torque_Nm"][:, axis]
        # Sums of 2000 steps in another order: some thousand roundings.
        np.testing.assert_allclose(ours, logged, atol=1e-11 * np.abs(logged).max())


def test_rules_of_the_regressor_sum_to_one():
    psi = regressor(np.linspace(-8, 8, 50), np.linspace(-1, 1, 50))
    np.testing.assert_allclose(psi[:, :25].sum(axis=1), 1.0, rtol=1e-14)
    np.testing.assert_allclose(psi[:, 25:50].sum(axis=1), np.linspace(-8, 8, 50), atol=1e-13)


def test_v_falls_and_is_of_afsm_alone(run):
    course = descent(run)
    assert course.risen < course.fallen
    assert 0 < course.of_parameters < 1
    for other in {"controller.law": "pid"}, {"controller.law": "afsm", "controller.level": "torque"}:
        assert descent(simulate(scenarios.load("sinusoid", {**FAST, "duration": 0.1, **other}))) is None


def test_v_rises_if_the_adaptation_has_the_wrong_sign(run):
    """With the sign of the adaptation turned in the telemetry, the errors of the parameters grow."""
    table = run.telemetry
    turned = type(table)(table.signals, table.values.copy())
    for gain in ("switching_gain", "bound_gain"):
        turned[gain][:] *= -1
    other = SimpleNamespace(scenario=run.scenario, telemetry=turned)
    assert descent(other).rises > 0.9


def test_reaching_is_the_first_time_on_the_surface(run):
    data, table = reduce(run), run.telemetry
    s = np.abs(table["sliding_s"]).max(axis=1)  # AFSM's own λ is that of the figure
    first = np.flatnonzero(s < REACHED_rad_s)
    assert data.reached_s == (table["t_s"][first[0]] if len(first) else None)
    assert data.early is None
    assert data.gains[0] == table["switching_gain"][-1].max()


def test_ends_of_a_margin():
    held = [True, True, False, True], [True, True], [False, True]
    assert list(map(stability.ends_of, held)) == [(1, 2), (1, None), (None, 0)]


def test_a_law_holds_by_its_error_and_its_end():
    assert stability.holds(outcome([0.0, 0.0, 0.99 * stability.HOLDS_rad]))
    for lost in ([0.0, 0.0, 1.01 * stability.HOLDS_rad],), (np.nan,), (0.0, Status.DIVERGED):
        assert not stability.holds(outcome(*lost))


def test_margins_begin_at_what_is_healthy_and_are_compared_with_no_other_plant():
    cases = stability.cases()
    assert len({case.name for case in cases}) == len(cases)
    healthy = {"unknown delay": 0, "control rate, slower": 1000, "control rate, faster": 1000}
    for law in stability.LAWS:
        for quantity in stability.UNITS:
            steps = [entry["step"] for entry in stability.FILE["worse"] if entry["quantity"] == quantity]
            assert steps[0] == healthy.get(quantity, 0)
            for step in steps:
                case = stability.FILE.case(law=law.law, quantity=quantity, step=step)
                scenario = scenario_of(case, None)
                assert not case.comparable
                if quantity == "unknown delay":
                    assert scenario.drive.delay_s == pytest.approx(1e-3 * step)
                    assert scenario.nominal.delay_s == 0.0  # no law knows it
    jobs = make_plan(stability.EXPERIMENT, seeds=1).sample
    assert {job.case.fields["controller.law"] for job in jobs} == {law.law for law in stability.LAWS}
    assert all(job.case.comparable for job in jobs)


def test_frequency_responses_are_a_section_with_margins_and_a_figure():
    case = stability.with_multisine(stability.FILE.case(part="response"))
    response = linear_loop(scenarios.load("hold", case.fields)).response(LINES_Hz)
    parts = np.stack([response.real, response.imag])
    data = stability.StabilityMeasures(None, None, None, None, None, parts)
    outcomes = Outcomes({case.name: [outcome(0.0)._replace(data=data)]})
    section = stability.sections(outcomes)[-1]
    measured, linear = section.tables[0].rows
    assert measured[:2] == ("tuned PID", "measured")
    assert measured[2:] == linear[2:]  # as the response is that of the linear loop
    assert "–" not in "".join(measured)
    assert [len(axes.lines) for axes in section.drawings[0]().figure.axes] == [3, 3]
