"""Quantities of compared runs against the definitions of a rotation and of virtual power."""

import numpy as np
import pytest

from spheretwin.models.kinematics import generalised_torque, rotation
from spheretwin.models.telemetry.signals import ANGLES, Signal, common_signals, width
from spheretwin.models.telemetry.table import Table
from spheretwin.viz.quantities import (
    COMPARED_QUANTITIES,
    MARGIN,
    QuantityRows,
    angle_between,
    compared_quantities,
    on_the_hinges,
)

RANDOM = np.random.default_rng(0)


def test_the_whole_error_is_the_angle_of_the_rotation_between():
    q, q_ref = RANDOM.uniform(-1.2, 1.2, size=(2, 200, 3))
    for result, pose, wanted in zip(angle_between(q, q_ref), q, q_ref, strict=True):
        R = rotation(pose).T @ rotation(wanted)
        # The trace loses half of the digits near 0 and π, where none of these are.
        assert result == pytest.approx(np.arccos((np.trace(R) - 1) / 2), abs=1e-9)


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
    assert compared_quantities([slides, slides]) == list(COMPARED_QUANTITIES)
    common = compared_quantities([slides, table()])
    assert {each.group for each in COMPARED_QUANTITIES} - {each.group for each in common} == {"sliding"}


def test_every_quantity_has_a_number_a_row_and_a_name_of_its_own(actuator):
    of = rows(table(Signal("sliding_s", "rad/s", 3, "s", ("α", "β", "γ"))), actuator)
    for each in COMPARED_QUANTITIES:
        assert each.values(of).shape == (7, 1)
        assert np.array_equal(each.column(of), each.values(of)[:, 0])
        assert each.desired is None or each.desired(of).shape == (7,)
        assert each.heading == f"{each.title} [{each.unit}]"
    assert (
        len({each.name for each in COMPARED_QUANTITIES})
        == len({each.heading for each in COMPARED_QUANTITIES})
        == 14
    )


def test_compared_quantities_are_those_of_a_recording_or_of_the_telemetry(actuator):
    of = rows(table(Signal("sliding_s", "rad/s", 3, "s", ("α", "β", "γ"))), actuator)
    values = {quantity.name: quantity.column(of) for quantity in COMPARED_QUANTITIES}
    expected = {
        "error_angle_deg": np.degrees(angle_between(of.table["q_rad"], of.table["q_ref_rad"])),
        "torque_command_norm_Nm": np.sqrt(np.sum(of.table["torque_command_Nm"] ** 2, axis=1)),
        "largest_current_A": np.abs(of.table["current_A"]).max(axis=1),
        "torque_margin": MARGIN.values(of)[:, 0],
        "torque_delivered_norm_Nm": np.sqrt(
            np.sum(on_the_hinges(of.table["q_rad"], of.table["torque_Nm"]) ** 2, axis=1)
        ),
    }
    for place, axis in enumerate(ANGLES):
        expected[f"error_{axis}_mrad"] = 1e3 * of.table["error_rad"][:, place]
        expected[f"angle_{axis}_rad"] = of.table["q_rad"][:, place]
        expected[f"sliding_{axis}_rad_s"] = of.table["sliding_s"][:, place]
    assert set(values) == set(expected)
    for name, column in expected.items():
        np.testing.assert_allclose(values[name], column, rtol=1e-15, err_msg=name)
    desired = {each.name: each.desired(of) for each in COMPARED_QUANTITIES if each.desired}
    assert list(desired) == [f"angle_{axis}_rad" for axis in ANGLES]
    np.testing.assert_array_equal(np.stack(list(desired.values()), axis=1), of.table["q_ref_rad"])


def test_compared_quantities_have_units_titles_and_limits():
    by_name = {quantity.name: quantity for quantity in COMPARED_QUANTITIES}
    assert by_name["error_β_mrad"].heading == "β error [mrad]"
    assert by_name["angle_γ_rad"].heading == "γ angle [rad]"
    assert by_name["sliding_α_rad_s"].heading == "α sliding [rad/s]"
    assert by_name["error_angle_deg"].heading == "error as one angle [°]"
    assert by_name["largest_current_A"].heading == "top current [A]"
    assert by_name["torque_command_norm_Nm"].heading == "command [N·m]"
    assert by_name["torque_margin"].limits == pytest.approx((-0.15, 3.15))  # 5 % of the largest, 3
    groups = [quantity.group for quantity in COMPARED_QUANTITIES]
    assert list(dict.fromkeys(groups)) == ["whole", "error", "angle", "sliding", "effort", "more"]
    assert sorted(groups, key=list(dict.fromkeys(groups)).index) == groups  # contiguous
