"""Readings of the control law: what each changes, and the score by hand."""

import numpy as np
import pytest

from spheretwin.paper import readings
from spheretwin.paper.experiment import Outcomes
from spheretwin.paper.experiment_file import PAPER_LAWS, PRINTED_rad, printed_rad
from spheretwin.paper.readings import READINGS, case
from spheretwin.paper.runner import scenario_of
from spheretwin.paper.sinusoid import FIGURE6, FIGURE7
from tests.twin.paper.cases import outcome


def made_up(ratio, only=READINGS):
    """Outcomes that are so many times the printed ones, by reading."""
    return Outcomes(
        {
            case(reading, law.law, *condition).name: [
                outcome(ratio(reading) * np.array(printed_rad(law.law, *condition)), saturated_fraction=0.0)
            ]
            for reading in only
            for condition in PRINTED_rad
            for law in PAPER_LAWS
        }
    )


def test_the_shipped_reading_is_what_figures_6_and_7_run():
    for law in PAPER_LAWS:
        for (m, L), figure in zip(PRINTED_rad, (FIGURE6, FIGURE7), strict=True):
            ours = scenario_of(case(READINGS[0], law.law, m, L), None)
            assert ours == scenario_of(figure.case(law=law.law, m=m, L=L), None)


def test_a_reading_is_level_rate_and_slope_and_nothing_else():
    for reading in READINGS:
        scenario = scenario_of(case(reading, "afsm", 0.2, 1.0), None)
        assert scenario.controller.level == reading["level"]
        assert f", {1e-3 / scenario.controller.period_s:g} kHz" in reading["reading"]
        assert scenario.controller.surface_slope == ((reading.get("slope", 50.0)),) * 3
        assert scenario.controller.reaching_gain == (20.0,) * 3


def test_score_is_the_rms_of_the_logarithm():
    (double,) = readings.results(made_up(lambda reading: 2.0, READINGS[:1]))
    assert double.score == pytest.approx(np.log(2))
    assert double.ratios.size == 18
    (half,) = readings.results(made_up(lambda reading: np.array([0.5, 2.0, 1.0]), READINGS[:1]))
    assert half.score == pytest.approx(np.log(2) * np.sqrt(2 / 3))


def test_the_finding_names_the_nearest_reading():
    (finding,) = readings.findings(made_up(lambda reading: 1.1 if reading is READINGS[2] else 3.0))
    assert finding.reproduced
    assert READINGS[2]["reading"] in finding.text
    # Gains other than the printed ones are no reading of the paper.
    (finding,) = readings.findings(made_up(lambda reading: 1.1 if "slope" in reading else 3.0))
    assert not finding.reproduced
    assert "λ = 5" in finding.text
    assert "AFSM's errors then differ from the print by a factor of 1.10 to 1.10 at L = 1 and" in finding.text
    assert readings.findings(made_up(lambda _: 1.0, READINGS[:3])) == []
