"""Nominal model of the controller where it differs from the truth."""

import numpy as np
import pytest

from spheretwin.analysis.recorded_run import read
from spheretwin.analysis.review import nominal_errors
from spheretwin.models import actuator as actuators
from tests.twin.analysis.runs import written


def errors(folder, **changes):
    telemetry, _ = written(folder, scenario="sinusoid", **{"duration": 0.02, **changes})
    return {error.field: error for error in nominal_errors(read(telemetry))}


def test_the_modelling_error_is_in_the_inertia_alone(tmp_path):
    (inertia,) = errors(tmp_path, **{"plant.modelling_error": 0.2}).values()
    own = actuators.load().inertia
    assert inertia.field == "nominal.inertia_kg_m2"
    # Four digits are printed.
    assert np.array(inertia.nominal.split(), float) == pytest.approx(own, rel=5e-4)
    assert np.array(inertia.true.split(), float) == pytest.approx(1.2 * own, rel=5e-4)


def test_friction_sensors_and_delay_that_the_controller_does_not_know_are_listed(tmp_path):
    friction = (0.002, 0.002, 0.003)
    changes = {"plant.modelling_error": 0.0, "plant.coulomb_Nm": friction, "nominal.torque_scale": 1.1}
    result = errors(tmp_path, **changes, **{"drive.delay_s": 0.001})
    assert set(result) == {"nominal.coulomb_Nm", "nominal.torque_scale", "nominal.delay_s"}
    assert result["nominal.coulomb_Nm"][1:] == ("0 0 0", "0.002 0.002 0.003")
    assert result["nominal.torque_scale"][1:] == ("1.1", "1")
    assert result["nominal.delay_s"][1:] == ("0", "0.001")


def test_a_controller_that_knows_the_truth_has_no_error(tmp_path):
    changes = {"plant.modelling_error": 0.2, "drive.delay_s": 0.001, "nominal.equals_truth": True}
    assert errors(tmp_path, **changes) == {}
