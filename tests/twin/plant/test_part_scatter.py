"""Scatter of poles and coils as fields of a scenario: drawn from the seed, and felt by the plant alone."""

import numpy as np
import pytest
from pydantic import ValidationError

import spheretwin as st
from spheretwin.models import actuator as actuators
from spheretwin.models.base.errors import InputError
from spheretwin.models.scatter import summed_torque_matrix
from spheretwin.plant.part_scatter import PartScatter, scatter_of
from spheretwin.scenario.plant_sections import PlantSection

ACTUATOR = actuators.load()
SPREAD = {"gain_error": 0.03, "angle_error_rad": 5e-3, "distance_error_m": 1e-4}


def test_errors_are_uniform_within_their_bounds_and_of_the_seed_and_the_name():
    section = PartScatter(**SPREAD)
    errors = section.part_errors(3, "plant.poles", 4000)
    for values, bound in ((errors.gain, 0.03), (errors.angle_rad, 5e-3), (errors.distance_m, 1e-4)):
        assert np.abs(values).max() <= bound
        # Standard deviation of a uniform distribution; 4000 numbers give it within 2 %.
        assert values.std() == pytest.approx(bound / np.sqrt(3), rel=0.03)
    np.testing.assert_array_equal(section.part_errors(3, "plant.poles", 16).gain, errors.gain[:16])
    for seed, name in ((4, "plant.poles"), (3, "plant.coils")):
        assert abs(np.corrcoef(section.part_errors(seed, name, 4000).gain, errors.gain)[0, 1]) < 0.06


def test_one_error_does_not_move_another():
    alone = PartScatter(gain_error=0.03).part_errors(0, "plant.coils", 36)
    together = PartScatter(**SPREAD).part_errors(0, "plant.coils", 36)
    np.testing.assert_array_equal(alone.gain, together.gain)
    assert not alone.angle_rad.any()


def test_given_errors_replace_those_of_the_seed():
    table = tuple((0.01 * (k % 3), 1e-3, -1e-3, 1e-5 * k) for k in range(16))
    plant = PlantSection(poles=PartScatter(errors=table), coils=PartScatter())
    poles, coils, _ = scatter_of(plant, 0, ACTUATOR)
    np.testing.assert_array_equal(np.column_stack([*poles[:1], poles.angle_rad, poles.distance_m]), table)
    assert not any(np.any(values) for values in coils)
    with pytest.raises(InputError, match=r"expected plant.poles.errors of 16 parts, received 3"):
        scatter_of(PlantSection(poles=PartScatter(errors=table[:3])), 0, ACTUATOR)
    with pytest.raises(ValidationError):
        PartScatter(errors=((0.0, 0.02, 0.0, 0.0),))


def test_the_torque_of_a_run_is_that_of_the_scattered_machine():
    """Telemetry against the sum over all poles and coils with the errors of the seed."""
    changes = {
        "plant.poles.gain_error": 0.03,
        "plant.coils.angle_error_rad": 5e-3,
        "plant.coils.distance_error_m": 1e-4,
        "plant.coils.gain_error": 0.03,
        "duration": 0.3,
        "seed": 7,
    }
    run = st.simulate("tilt", changes)
    plant = PlantSection(poles=PartScatter(gain_error=0.03), coils=PartScatter(**SPREAD))
    scatter = scatter_of(plant, 7, ACTUATOR)
    q, current, torque = (run.telemetry[name] for name in ("q_rad", "current_A", "torque_Nm"))
    row = int(np.argmax(np.linalg.norm(torque, axis=1)))
    expected, nominal = (summed_torque_matrix(q[row], ACTUATOR, of) @ current[row] for of in (scatter, None))
    size = np.abs(expected).max()
    # Measured: 1e-4 to 3e-4 of second order, for an effect of the scatter of 2e-2.
    np.testing.assert_allclose(torque[row], expected, rtol=0, atol=1e-3 * size)
    assert np.abs(nominal - expected).max() > 0.01 * size
