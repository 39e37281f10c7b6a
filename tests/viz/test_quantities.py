"""Derived quantities against their definitions, computed in another way."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from spheretwin.models import lagrangian
from spheretwin.models.kinematics import rate_jacobian, rotation
from spheretwin.models.telemetry.signals import ANGLES, Signal, common_signals, width
from spheretwin.models.telemetry.table import Table
from spheretwin.viz import quantities
from spheretwin.viz.quantities import (
    COPPER_LOSS,
    COUPLING,
    DELIVERED,
    ERROR_ANGLE,
    MARGIN,
    QUANTITIES,
    TIP_DISTANCE,
    QuantityRows,
    angle_between,
)

SIGNALS = (
    *common_signals(18),
    Signal("q_measured_rad", "rad", 3, "measured", ANGLES),
    Signal("qdot_estimated_rad_s", "rad/s", 3, "estimated", ANGLES),
)
COUNT = 60
LIMIT_A = 8.0


@pytest.fixture
def rows(actuator):
    """Anything that telemetry may hold, within half a turn of β."""
    generator = np.random.default_rng(0)
    table = Table(SIGNALS, generator.normal(size=(COUNT, width(SIGNALS))))
    table["q_rad"][:, 1] = generator.uniform(-1.2, 1.2, COUNT)
    table["t_s"][:] = 1e-3 * np.arange(COUNT)
    table["allocation_scale"][:] = 1.0
    return QuantityRows(table, table.rows(0, 1), actuator, LIMIT_A)


def test_the_error_angle_is_that_of_the_rotation_between_both_poses(rows):
    actual, desired = (Rotation.from_euler("XYZ", rows.table[name]) for name in ("q_rad", "q_ref_rad"))
    expected = np.degrees((desired.inv() * actual).magnitude())
    # Both take the angle from quaternions with an error of some 1e-16; near a half turn SciPy's has 1e-14.
    np.testing.assert_allclose(ERROR_ANGLE.values(rows)[:, 0], expected, rtol=1e-12)


@pytest.mark.parametrize("angle", [0.0, 1e-12, 1e-6, 0.1, 3.0, np.pi])
def test_a_turn_about_one_axis_is_its_own_error_to_the_last_digits(angle):
    for axis in range(3):
        turned = np.zeros((1, 3))
        turned[0, axis] = angle
        # Of quaternions of size 1, some units in the last place of 1; near π the sine is flat.
        assert angle_between(turned, np.zeros((1, 3)))[0] == pytest.approx(angle, abs=1e-15, rel=1e-7)


def test_a_whole_turn_is_no_error(rows):
    q = rows.table["q_rad"]
    np.testing.assert_allclose(angle_between(q + [0, 0, 2 * np.pi], q), 0, atol=1e-14)


def test_tip_distance_is_that_of_both_rotations(rows, actuator):
    expected = [
        1e3 * np.linalg.norm((rotation(q) - rotation(desired)) @ actuator.shaft_tip_m)
        for q, desired in zip(rows.table["q_rad"], rows.table["q_ref_rad"], strict=True)
    ]
    # Some ten rounded operations on lengths of 100 mm; an absolute bound, as distances may cancel.
    np.testing.assert_allclose(TIP_DISTANCE.values(rows)[:, 0], expected, atol=1e-11)


def test_the_delivered_torque_does_the_work_of_the_coils_on_the_hinges(rows):
    expected = [
        rate_jacobian(q).T @ torque
        for q, torque in zip(rows.table["q_rad"], rows.table["torque_Nm"], strict=True)
    ]
    np.testing.assert_allclose(DELIVERED.values(rows), expected, atol=1e-14)  # torques of some N·m


def test_the_margin_is_how_far_a_command_can_be_scaled(rows):
    commands = rows.table["current_command_A"]
    commands *= np.linspace(0.01, 4.0, COUNT)[:, None]
    factor = 1 + MARGIN.values(rows)
    scaled = np.max(np.abs(factor * commands), axis=1)
    largest = np.max(np.abs(commands), axis=1)
    expected = largest > LIMIT_A / (1 + quantities.MOST)
    assert 0 < np.count_nonzero(expected & (largest <= LIMIT_A)) < COUNT
    within = expected & (largest <= LIMIT_A)
    np.testing.assert_allclose(scaled[within], LIMIT_A, rtol=1e-15)
    np.testing.assert_array_equal(factor[largest > LIMIT_A], 1.0)
    np.testing.assert_allclose(factor[~expected], 1 + quantities.MOST, rtol=1e-15)


def test_nothing_is_left_where_the_limit_has_cut_the_torque(rows):
    rows.table["allocation_scale"][::2] = 0.9
    left = MARGIN.values(rows)[:, 0]
    assert np.all(left[::2] == 0)
    assert np.any(left[1::2] > 0)


def accelerations(rows):
    change = np.diff(rows.table["qdot_rad_s"], axis=0, prepend=rows.before["qdot_rad_s"])
    return change / 1e-3


def test_coupling_is_what_of_the_motion_is_no_axis_own(rows, actuator):
    for tick, (q, rate, acceleration) in enumerate(
        zip(rows.table["q_rad"], rows.table["qdot_rad_s"], accelerations(rows), strict=True)
    ):
        M = lagrangian.inertia_matrix(q, actuator.inertia)
        C = lagrangian.coriolis_matrix(q, rate, actuator.inertia)
        expected = (M - np.diag(np.diag(M))) @ acceleration + C @ rate
        # Accelerations of some 1e3 rad/s² are differences of rates with 1e-16 over 1e-3 s.
        np.testing.assert_allclose(COUPLING.values(rows)[tick], expected, rtol=1e-9, atol=1e-13)


def test_coupling_of_equal_inertias_is_that_of_the_paper(rows, actuator):
    J = 2.2e-3
    equal = rows._replace(actuator=replace(actuator, inertia=np.full(3, J)))
    expected = [
        np.sum(lagrangian.coupling_torques(q, rate, acceleration, J), axis=0)
        for q, rate, acceleration in zip(
            rows.table["q_rad"], rows.table["qdot_rad_s"], accelerations(rows), strict=True
        )
    ]
    np.testing.assert_allclose(COUPLING.values(equal), expected, rtol=1e-9, atol=1e-13)  # as above


def test_copper_loss_is_of_cold_coils_without_a_column(rows, actuator):
    expected = [actuator.group.resistance_ohm * current @ current for current in rows.table["current_A"]]
    np.testing.assert_allclose(COPPER_LOSS.values(rows)[:, 0], expected, rtol=1e-13)
    loss = Signal("copper_loss_W", "W", 18, "heat of the coils")
    signals = (*SIGNALS, loss)
    table = Table(signals, np.hstack([rows.table.values, np.full((COUNT, 18), 0.5)]))
    np.testing.assert_array_equal(COPPER_LOSS.values(rows._replace(table=table))[:, 0], 9.0)


@pytest.mark.parametrize("quantity", QUANTITIES, ids=lambda quantity: quantity.name)
def test_every_quantity_is_the_same_whatever_the_chunks(quantity, rows):
    whole = quantity.values(rows)
    assert whole.shape == (COUNT, quantity.size) == (COUNT, len(quantity.colours))
    cut = 23
    second = rows._replace(table=rows.table.rows(cut, COUNT), before=rows.table.rows(cut - 1, cut))
    parts = [quantity.values(rows._replace(table=rows.table.rows(0, cut))), quantity.values(second)]
    np.testing.assert_array_equal(np.concatenate(parts), whole)
