"""Nominal model of the controller where it differs from the truth."""

from dataclasses import replace

import numpy as np
import pytest

from spheretwin import scenario as scenarios
from spheretwin.analysis.review import nominal_errors
from spheretwin.models import actuator as actuators
from spheretwin.provenance import record_of
from spheretwin.session import Session
from tests.twin.analysis.runs import PLANT, made_of


def errors(**changes):
    """Errors by their field, of the record of a session that has not begun."""
    with Session(scenarios.load("sinusoid", {**PLANT, **changes})) as session:
        run = replace(made_of([[0.0, 0.0]]), record=record_of(session))
    return {error.field: error for error in nominal_errors(run)}


def test_the_modelling_error_is_in_the_inertia_alone():
    (inertia,) = errors(**{"plant.modelling_error": 0.2}).values()
    own = actuators.load().inertia
    assert inertia.field == "nominal.inertia_kg_m2"
    # Four digits are printed.
    assert np.array(inertia.nominal.split(), float) == pytest.approx(own, rel=5e-4)
    assert np.array(inertia.true.split(), float) == pytest.approx(1.2 * own, rel=5e-4)


def test_friction_sensors_and_delay_that_the_controller_does_not_know_are_listed():
    friction = (0.002, 0.002, 0.003)
    changes = {"plant.modelling_error": 0.0, "plant.coulomb_Nm": friction, "nominal.torque_scale": 1.1}
    result = errors(**changes, **{"drive.delay_s": 0.001})
    assert set(result) == {"nominal.coulomb_Nm", "nominal.torque_scale", "nominal.delay_s"}
    assert result["nominal.coulomb_Nm"][1:] == ("0 0 0", "0.002 0.002 0.003")
    assert result["nominal.torque_scale"][1:] == ("1.1", "1")
    assert result["nominal.delay_s"][1:] == ("0", "0.001")


def test_a_controller_that_knows_the_truth_has_no_error():
    changes = {"plant.modelling_error": 0.2, "drive.delay_s": 0.001, "nominal.equals_truth": True}
    assert errors(**changes) == {}
