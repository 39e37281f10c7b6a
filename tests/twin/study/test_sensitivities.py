"""Derivatives of figures: an exact proportion, runs of sessions, their order, refusals."""

import numpy as np
import pytest

from spheretwin.models.base.errors import InputError
from spheretwin.simulation import simulate
from spheretwin.study.sensitivities import sensitivities

LOAD, STIFFNESS = "disturbance.load", "controller.stiffness.1"
PD = {"controller.law": "pd", "controller.stiffness": [400.0] * 3, "duration": 0.4, LOAD: 0.5}


def test_the_error_of_a_small_load_is_proportional_to_it():
    still = {**PD, LOAD: 4e-3, "plant.initial_rad": [0.2, -0.1, 0.3]}
    found = sensitivities("hold", {LOAD: 1e-3}, still, ["rms_error_rad"])
    slope = found.derivatives["rms_error_rad"][LOAD]
    # Errors of some 0.1 mrad: the loop is linear but for their products.
    np.testing.assert_allclose(slope, np.array(found.figures["rms_error_rad"]) / 4e-3, rtol=1e-3)


def test_derivatives_are_those_of_a_curve_through_runs_of_sessions():
    steps = {LOAD: 0.05, STIFFNESS: 5.0}
    found = sensitivities("nutation", steps, PD, ["rms_error_rad", "rms_torque_Nm"])
    own = {LOAD: PD[LOAD], STIFFNESS: 400.0}
    for name, step in steps.items():
        places = np.linspace(-1, 1, 7)
        rows = []
        for place in places:
            value = own[name] + place * step
            change = {name: value} if name == LOAD else {"controller.stiffness": [400.0, value, 400.0]}
            run = simulate("nutation", {**PD, **change})
            rows.append([*run.figures["rms_error_rad"], run.figures["rms_torque_Nm"]])
        slopes = np.polynomial.polynomial.polyfit(places * step, rows, 6)[1]
        ours = np.array([*found.derivatives["rms_error_rad"][name], found.derivatives["rms_torque_Nm"][name]])
        errors = np.array([*found.errors["rms_error_rad"][name], found.errors["rms_torque_Nm"][name]])
        assert np.all(np.abs(ours - slopes) <= errors), name
        assert np.all(errors < 1e-2 * np.abs(ours)), name


def test_the_stated_error_is_of_second_order():
    whole, half = (
        sensitivities("nutation", {LOAD: step}, PD).errors["rms_error_rad"][LOAD] for step in (0.1, 0.05)
    )
    np.testing.assert_allclose(whole / half, 4.0, rtol=0.1)


@pytest.mark.parametrize(
    ("steps", "changes", "received"),
    [
        ({LOAD: 0.0}, {}, "a step of disturbance.load above 0, received 0.0"),
        ({LOAD: float("nan")}, {}, "received nan"),
        ({"controller.law": 1.0}, {}, "received controller.law = 'pd'"),
        ({"controller.stiffness.3": 1.0}, {}, "received controller.stiffness.3 = none"),
        ({LOAD: 1.0}, {LOAD: 900.0}, "received left_workspace"),
        ({LOAD: 0.1}, {"plant.initial_rad": [0.2, -0.1, 0.3]}, "received no overshoot_rad"),
    ],
)
def test_refusals(steps, changes, received):
    figures = ["overshoot_rad"] if "plant.initial_rad" in changes else ["rms_error_rad"]
    with pytest.raises(InputError, match=received):
        sensitivities("hold", steps, {**PD, **changes}, figures)
