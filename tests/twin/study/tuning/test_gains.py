"""Gains and the fields that they set, and what is refused before the first trial."""

import pytest

from spheretwin.control.law_components.feedback import triple_pole
from spheretwin.control.laws import LAWS
from spheretwin.study.optimise import Gain
from spheretwin.study.row import Rows
from spheretwin.study.study import load
from spheretwin.study.tuning.gains import gains_of, middle, numbers, values
from tests.twin.study.tuning.cases import gain, study

SHIPPED = load("tuning")
PID_GAINS = next(gains_of(SHIPPED, law, Rows(SHIPPED)) for law in SHIPPED.law if law["law"] == "pid")
STIFFNESS, DAMPING = "controller.stiffness", "controller.damping"


@pytest.mark.parametrize("law", SHIPPED.law, ids=lambda law: law["law"])
def test_the_shipped_tuning_starts_with_the_laws_own_gains(law):
    preset = {name: law[name] for name in ("preset",) if name in law}
    gains, default = gains_of(SHIPPED, law, Rows(SHIPPED)), LAWS[law["law"]](**preset)
    own = {name: tuple(value) for name, value in law.items() if name not in ("law", "preset")}
    for field, value in values(gains, middle(gains)).items():
        name, _, entry = field.removeprefix("controller.").partition(".")
        at = [int(entry)] if entry else [0, 1, 2]
        # Gains that are the products of factors and powers: some units in the last place.
        assert [getattr(default, name)[i] for i in at] == pytest.approx([value] * len(at), rel=1e-15)
    assert own == {name: getattr(default, name) for name in own}


def test_a_gain_may_set_several_fields_and_a_field_be_set_by_several():
    chosen = {"bandwidth_rad_s": 25.0, "stiffness_ratio": 1.5, "damping_ratio": 0.5}
    stiffness, damping, integral = triple_pole(25.0)
    expected = {STIFFNESS: 1.5 * stiffness, DAMPING: 0.5 * damping, "controller.integral": integral}
    # The factors are the same in another order: some units in the last place.
    assert values(PID_GAINS, chosen) == pytest.approx(expected, rel=1e-15)


def test_without_a_start_gains_are_tried_in_the_middle_of_their_ranges(tmp_path):
    even = gain("damping", 10.0, 30.0, log=False)
    two = study(tmp_path, gains=(gain(low=30.0, high=3000.0), even))
    gains = gains_of(two, None, Rows(two))
    assert middle(gains) == pytest.approx({STIFFNESS: 300.0, DAMPING: 20.0})


def test_an_optional_gain_that_is_off_leaves_its_fields_alone():
    gains = [Gain.model_validate(gain(optional=True)), Gain.model_validate(gain("damping", 5.0, 500.0))]
    assert list(numbers(gains)) == [STIFFNESS, DAMPING, gains[0].switch]
    chosen = {STIFFNESS: 300.0, DAMPING: 20.0}
    assert values(gains, {**chosen, gains[0].switch: 0.5}) == values(gains, dict(chosen)) == chosen
    assert values(gains, {**chosen, gains[0].switch: 0.49}) == {DAMPING: 20.0}
