"""Figures 6 and 7: variations, printed numbers and findings."""

import numpy as np
import pytest

from spheretwin import scenario as scenarios
from spheretwin.paper import sinusoid
from spheretwin.paper.experiment import Outcomes
from spheretwin.paper.experiment_file import COMPARED_LAWS, PAPER_LAWS, PRINTED_rad, printed_rad
from spheretwin.paper.page import rows
from spheretwin.paper.runner import make_plan, run_plan, unexpected_ends
from spheretwin.paper.sinusoid import EXPERIMENT_6, EXPERIMENT_7, FIGURE6, FIGURE7
from tests.twin.paper.cases import outcome

AT = {"m": 0.2, "L": 2.0}


def test_figure_6_varies_m_alone_and_figure_7_the_load_alone():
    for experiment, field, values in (
        (EXPERIMENT_6, "plant.modelling_error", [0, 0.1, 0.2, 0.3, 0.4, 0.5]),
        (EXPERIMENT_7, "disturbance.load", [0, 1, 2, 3, 4, 5]),
    ):
        cases = experiment.cases()
        assert len(cases) == len(values) * len(COMPARED_LAWS)
        assert sorted({of_law.fields[field] for of_law in cases}) == values
        fixed = ({"plant.modelling_error", "disturbance.load"} - {field}).pop()
        assert {of_law.fields[fixed] for of_law in cases} == {1.0 if fixed.endswith("load") else 0.2}
        for of_law in cases:
            scenario = scenarios.load(of_law.scenario, of_law.fields)
            assert scenario.controller == type(scenario.controller)()  # the gains are the laws' own
            assert scenario.plant.modelling_torque_Nm == (0.002, 0.001, 0.001)  # (54), whatever m


def test_printed_numbers_are_in_their_order():
    """PD errs most, AFSM least, and the load makes it worse: a slip of the pen would show."""
    for of_laws in PRINTED_rad.values():
        assert np.all(np.diff([of_laws[law] for law in ("pd", "adaptive_fuzzy", "afsm")], axis=0) < 0)
    for law in PRINTED_rad[0.2, 1.0]:
        assert np.all(np.array(printed_rad(law, 0.2, 2.0)) > np.array(printed_rad(law, 0.2, 1.0)))
    assert printed_rad("pid", 0.2, 1.0) is printed_rad("pd", 0.3, 1.0) is None


@pytest.mark.release("1.4 s; content of figure 7 has the rows")
def test_figure_7_has_the_errors_of_the_readme_and_the_order_and_growth_of_the_paper_but_not_its_sizes():
    plan = make_plan(EXPERIMENT_7, seeds=1)
    outcomes = run_plan(plan)
    by_condition = {(row["controller"], row["L"]): row for row in rows(plan, outcomes)}
    assert by_condition["pd", 2.0]["status"] == "left_workspace"
    assert unexpected_ends(plan, outcomes) == []
    for law, L, error in (("afsm", 1, 0.030), ("afsm", 2, 0.041), ("adaptive_fuzzy", 1, 0.038)):
        row = by_condition[law, float(L)]
        assert row["max_abs_error_rad"][0] == pytest.approx(error, abs=5e-4)  # as README prints them
        assert row["rms_error_rad"][0] < row["max_abs_error_rad"][0]
        assert row["rms_torque_Nm"] > 0.05 * L  # the load alone, on three hinges
        assert row["current_variation_A_s"] > 0
    order, sizes, lost, growth = EXPERIMENT_7.findings(outcomes)
    assert [each.reproduced for each in (order, sizes, lost, growth)] == [True, False, False, True]
    assert "PD > adaptive fuzzy > AFSM over L = 0 to 5" in order.text
    assert "1 of 1 runs ended as left_workspace" in lost.text


def made_up(errors):
    """Outcomes of one seed by law, with the same error on all three hinges."""
    names = [FIGURE7.case(law=law.law, **AT).name for law in PAPER_LAWS]
    return Outcomes({name: [outcome(error)] for name, error in zip(names, errors, strict=True)})


def test_findings_are_of_the_outcomes():
    printed = [printed_rad(law.law, **AT) for law in PAPER_LAWS]
    (finding,) = sinusoid.sizes(FIGURE7, made_up(printed))
    assert finding.reproduced
    assert "PD ×1.00 to ×1.00, adaptive fuzzy ×1.00 to ×1.00, AFSM ×1.00 to ×1.00" in finding.text
    far = [np.array(error) * factor for error, factor in zip(printed, (1.24, 1.26, 0.76), strict=True)]
    texts = {finding.reproduced: finding.text for finding in sinusoid.sizes(FIGURE7, made_up(far))}
    assert "adaptive fuzzy ×1.26 to ×1.26" in texts[False]
    assert "closer than the paper says" not in texts[False]
    assert all(law in texts[True] for law in ("PD", "AFSM"))
    right, broken = (sinusoid.order(FIGURE7, made_up(each))[0] for each in ([3.0, 2.0, 1.0], [3.0, 1.0, 2.0]))
    assert (right.reproduced, broken.reproduced) == (True, False)
    assert "in 3 of 6 comparisons" in broken.text


def test_nothing_is_said_of_what_was_not_run():
    for variation in (FIGURE6, FIGURE7):
        assert sinusoid.order(variation, Outcomes()) == []
    assert sinusoid.sizes(FIGURE7, Outcomes()) == []
    assert sinusoid.growth(FIGURE7, Outcomes()) == []
