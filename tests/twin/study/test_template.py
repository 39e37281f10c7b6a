"""A template's scenarios are those that the same fields make one by one, and so are its refusals."""

import math

import pytest

from spheretwin.models.base.errors import InputError
from spheretwin.scenario import reading
from spheretwin.study.template import is_number, template_of

GAPS = ("seed", "plant.payload_kg", "plant.coulomb_Nm.1", "disturbance.load", "duration")
SOME = (3, 0.01, 0.002, 1, 0.5)


def fields(**others):
    return {
        **reading.read("sinusoid"),
        "seed": 0,
        "duration": 1.0,
        "plant": {"payload_kg": 0.0, "coulomb_Nm": [0.001, 0.001, 0.001]},
        "disturbance": {"load": 0.0},
        **others,
    }


def template(gaps=GAPS, **others):
    return template_of(fields(**others), gaps, "sinusoid")


def one_by_one(values):
    made = fields()
    for dotted, value in zip(GAPS, values, strict=True):
        reading.override(made, dotted, value)
    return reading.validated(made, "sinusoid")


def refusal(make, values):
    with pytest.raises(InputError) as refused:
        make(values)
    return str(refused.value)


@pytest.mark.parametrize(
    "values", [SOME, (2**53 - 1, 1e-7, 5e-324, -3.5, 1e3), (2**70, 0, 1, 2, 1), (1, 0.1 + 0.2, 1e8, 1e-5, 7)]
)
def test_scenarios_are_the_same(values):
    made = template()
    for _ in range(2):  # the first one, whose texts are checked, and those that follow
        ours, theirs = made.scenario(values), one_by_one(values)
        assert ours == theirs
        assert ours.model_dump_json() == theirs.model_dump_json()


def test_scenarios_share_the_sections_without_a_gap():
    made = template()
    first, second = made.scenario(SOME), made.scenario((4, *SOME[1:]))
    assert (first.seed, second.seed) == (3, 4)
    assert first.controller is second.controller
    assert first.trajectory is second.trajectory
    assert first.plant is not second.plant


@pytest.mark.parametrize(
    ("place", "value"),
    [(0, -1), (0, 0.5), (1, 2**300), (1, -1.0), (2, math.inf), (3, math.nan), (4, 0), (4, -math.inf)],
)
def test_refusals_are_the_same(place, value):
    values = [*SOME[:place], value, *SOME[place + 1 :]]
    assert refusal(template().scenario, values) == refusal(one_by_one, values)


def test_texts_are_checked_in_every_scenario():
    made = template(name="a\x07b")
    for _ in range(2):
        assert "without control characters" in refusal(made.scenario, SOME)


def test_a_gap_that_is_written_over_or_whose_mark_is_in_a_text_has_no_template():
    assert template(("plant.coulomb_Nm.1", "plant.coulomb_Nm.01")) is None
    assert template(description="\x010\x01") is None


def test_only_numbers_fill_a_gap():
    assert all(map(is_number, (1, 2.5)))
    assert not any(map(is_number, (True, None, "1", [1.0], {})))
