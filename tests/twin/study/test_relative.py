"""Relative axes: factors of the field's own value give the rows of the values that they stand for."""

import pytest

from spheretwin.models.base.errors import InputError
from spheretwin.study.grid import Grid
from spheretwin.study.relative import absolute
from spheretwin.study.study import made

MODEL_OHM = 1.3
"""Resistance of the model file, which no scenario names."""


def study(*axes, **fields):
    return made({"name": "made", "scenario": "hold", "axis": list(axes)} | fields, "made")


def axis(kind, field, **numbers):
    return {"kind": kind, "field": field, "relative": True} | numbers


@pytest.mark.parametrize(
    ("given", "more", "values"),
    [
        (axis("linspace", "drive.resistance_ohm", first=0.9, last=1.1, count=3), {}, [1.17, 1.3, 1.43]),
        (axis("logspace", "drive.resistance_ohm", first=0.5, last=2.0, count=3), {}, [0.65, 1.3, 2.6]),
        (axis("values", "plant.modelling_error", values=[1, 2.0]), {"scenario": "nutation"}, [0.2, 0.4]),
        (
            axis("values", "plant.coulomb_Nm.1", values=[2.0]),
            {"fields": {"plant.coulomb_Nm": [1e-3, 2e-3, 3e-3]}},
            [4e-3],
        ),
        (axis("values", "plant.group_gain.3", values=[0.9, 1.1]), {}, [0.9, 1.1]),
    ],
)
def test_listed_values_are_factors_times_the_value_of_scenario_study_or_model_file(given, more, values):
    rows = Grid(absolute(study(given, **more)))
    assert [row.values[given["field"]] for row in rows] == pytest.approx(values, rel=1e-12)


def test_rows_and_keys_are_those_of_the_same_axis_with_values():
    """Also of a negative value, whose bounds change places."""
    fields = {"sensors.angle_offset_rad": [0.0, -0.02, 0.0]}
    relative = study(
        axis("uniform", "sensors.angle_offset_rad.1", low=0.5, high=2.0),
        axis("normal", "drive.inductance_H", mean=1.0, deviation=0.1),
        fields=fields,
        samples=8,
    )
    direct = study(
        {"kind": "uniform", "field": "sensors.angle_offset_rad.1", "low": -0.04, "high": -0.01},
        {"kind": "normal", "field": "drive.inductance_H", "mean": 9e-4, "deviation": 9e-5},
        fields=fields,
        samples=8,
    )
    assert list(Grid(absolute(relative))) == list(Grid(direct))
    assert absolute(direct) is direct


def test_a_gain_is_relative_to_that_of_the_scenario_s_law():
    given = axis("values", "controller.stiffness.0", values=[1.5])
    (row,) = Grid(absolute(study(given, fields={"controller.law": "pid"})))
    assert row.values["controller.stiffness.0"] == 1.5 * 4800


@pytest.mark.parametrize(
    ("given", "more", "message"),
    [
        (axis("values", "plant.modelling_error", values=[1.1]), {}, "a number other than 0 .* received 0"),
        (axis("values", "trajectory.shape", values=[1.1]), {}, "a number other than 0 .* received none"),
        (axis("values", "drive.resistance_ohm", values=["a"]), {}, "expected numbers as factors"),
        (
            axis("values", "controller.damping.0", values=[2.0]),
            {"law": [{"law": "pd"}]},
            "each .*law.* own gains",
        ),
        (axis("uniform", "drive.resistance_ohm", low=1.0, high=1e9), {"samples": 2}, "relative to 1.3: high"),
    ],
)
def test_a_factor_without_a_value_is_refused(given, more, message):
    with pytest.raises(InputError, match=message):
        absolute(study(given, **more))
