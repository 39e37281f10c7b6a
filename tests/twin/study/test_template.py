"""A template's scenarios are those that the same fields make one by one, and so are its complaints."""

import json
import math

import pytest

from spheretwin.models.base.errors import InputError
from spheretwin.scenario import reading
from spheretwin.study.template import are_numbers, template_of

GAPS = ("seed", "plant.payload_kg", "plant.coulomb_Nm.1", "disturbance.load", "duration")
SOME = (3, 0.01, 0.002, 1, 0.5)


def fields():
    return {
        **reading.read("sinusoid"),
        "seed": 0,
        "duration": 1.0,
        "plant": {"payload_kg": 0.0, "coulomb_Nm": [0.001, 0.001, 0.001]},
        "disturbance": {"load": 0.0},
    }


def one_by_one(values):
    made = fields()
    for dotted, value in zip(GAPS, values, strict=True):
        reading.override(made, dotted, value)
    return reading.validated(made, "sinusoid")


def complaint(work, values):
    with pytest.raises(InputError) as refusal:
        work(values)
    return str(refusal.value)


@pytest.mark.parametrize(
    "values", [SOME, (2**53 - 1, 1e-7, 5e-324, -3.5, 1e3), (2**70, 0, 1, 2, 1), (1, 0.1 + 0.2, 1e8, 1e-5, 7)]
)
def test_scenarios_are_the_same(values):
    template = template_of(fields(), GAPS, "sinusoid")
    for _ in range(2):  # the first one, of which the texts are looked at, and those that follow
        ours, theirs = template.scenario(values), one_by_one(values)
        assert ours == theirs
        assert ours.model_dump_json() == theirs.model_dump_json()


def test_scenarios_share_the_sections_without_a_gap():
    template = template_of(fields(), GAPS, "sinusoid")
    first, second = template.scenario(SOME), template.scenario((4, *SOME[1:]))
    assert first.seed == 3
    assert second.seed == 4
    assert first.controller is second.controller
    assert first.trajectory is second.trajectory
    assert first.plant is not second.plant


@pytest.mark.parametrize(
    ("place", "value"),
    [(0, -1), (0, 0.5), (1, 2**300), (1, -1.0), (2, math.inf), (3, math.nan), (4, 0), (4, -math.inf)],
)
def test_complaints_are_the_same(place, value):
    values = [*SOME[:place], value, *SOME[place + 1 :]]
    template = template_of(fields(), GAPS, "sinusoid")
    assert complaint(template.scenario, values) == complaint(one_by_one, values)


def test_texts_are_looked_at():
    template = template_of({**fields(), "name": "a\x07b"}, GAPS, "sinusoid")
    for _ in range(2):
        assert "without control characters" in complaint(template.scenario, SOME)


def test_a_gap_that_is_written_over_has_no_template():
    assert template_of(fields(), ("plant.coulomb_Nm.1", "plant.coulomb_Nm.01"), "sinusoid") is None
    # Nor has one whose mark somebody has written.
    assert template_of({**fields(), "description": "\x010\x01"}, GAPS, "sinusoid") is None


@pytest.mark.parametrize("other", [True, None, "1", [1.0], json.loads("{}")])
def test_only_numbers_fill_a_gap(other):
    assert are_numbers([1, 2.5])
    assert not are_numbers([1, other])
