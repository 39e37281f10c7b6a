"""Quantities of compared runs against the definitions of a rotation and of virtual power."""

import numpy as np
import pytest

from spheretwin.models.kinematics import generalised_torque, rotation
from spheretwin.models.telemetry.signals import ANGLES, Signal, common_signals, width
from spheretwin.models.telemetry.table import Table
from spheretwin.viz.quantities import (
    ERROR,
    ERROR_ANGLE,
    MARGIN,
    SCALAR_QUANTITIES,
    QuantityRows,
    angle_between,
    on_the_hinges,
    scalar_quantities,
)

RANDOM = np.random.default_rng(0)


def test_the_whole_error_is_the_angle_of_the_rotation_between():
    q, q_ref = RANDOM.uniform(-1.2, 1.2, size=(2, 200, 3))
    for found, pose, wanted in zip(angle_between(q, q_ref), q, q_ref, strict=True):
        R = rotation(pose).T @ rotation(wanted)
        # The trace loses half of the digits near 0 and π, where none of these are.
        assert found == pytest.approx(np.arccos((np.trace(R) - 1) / 2), abs=1e-9)


@pytest.mark.parametrize("angle", [0.0, 1e-12, 1e-6, 0.1, 3.0, np.pi])
def test_a_turn_about_one_axis_is_its_own_error_to_the_last_digits(angle):
    for axis in range(3):
        turned = np.zeros((1, 3))
        turned[0, axis] = angle
        # Of quaternions of size 1, some units in the last place of 1; near π the sine is flat.
        assert angle_between(turned, np.zeros((1, 3)))[0] == pytest.approx(angle, abs=1e-15, rel=1e-7)


def test_a_whole_turn_is_no_error():
    q = RANDOM.uniform(-1, 1, size=(20, 3))
    np.testing.assert_allclose(angle_between(q + [0, 0, 2 * np.pi], q), 0, atol=1e-14)


def test_torque_on_the_hinges_is_that_of_the_model():
    q, torque_S = RANDOM.uniform(-1, 1, size=(2, 50, 3))
    expected = np.empty((50, 3))
    for pose, torque, row in zip(q, torque_S, expected, strict=True):
        generalised_torque(pose, torque, row)
    # Sums of three products up to 1.
    np.testing.assert_allclose(on_the_hinges(q, torque_S), expected, rtol=0, atol=1e-15)


def table(*more):
    signals = (*common_signals(5), *more)
    return Table(signals, RANDOM.uniform(-1, 1, size=(7, width(signals))))


def rows(of, actuator):
    return QuantityRows(of, of.rows(0, 1), actuator, 8.0)


def test_only_what_all_runs_have_is_drawn():
    slides = table(Signal("sliding_s", "rad/s", 3, "s", ("α", "β", "γ")))
    assert scalar_quantities([slides, slides]) == list(SCALAR_QUANTITIES)
    common = scalar_quantities([slides, table()])
    assert {each.group for each in SCALAR_QUANTITIES} - {each.group for each in common} == {"sliding"}


def test_every_quantity_has_a_number_a_row_and_a_name_of_its_own(actuator):
    of = rows(table(Signal("sliding_s", "rad/s", 3, "s", ("α", "β", "γ"))), actuator)
    for each in SCALAR_QUANTITIES:
        assert each.values(of).shape == (7,)
        assert each.desired is None or each.desired(of).shape == (7,)
        assert each.heading == f"{each.title} [{each.unit}]"
    assert (
        len({each.name for each in SCALAR_QUANTITIES})
        == len({each.heading for each in SCALAR_QUANTITIES})
        == 14
    )


def test_what_one_run_s_recording_has_too_is_the_same_number(actuator):
    of = rows(table(), actuator)
    beside = {each.name: each.values(of) for each in SCALAR_QUANTITIES if "sliding" not in each.name}
    for alone in (ERROR_ANGLE, MARGIN):
        np.testing.assert_array_equal(beside[alone.name], alone.values(of)[:, 0])
    errors = np.stack([beside[f"error_{angle}_mrad"] for angle in ANGLES], axis=1)
    np.testing.assert_array_equal(errors, ERROR.values(of))
