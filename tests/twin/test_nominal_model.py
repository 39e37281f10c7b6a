"""What the controller knows may differ from what is true: nominal matrix, inertia and limit, sensors."""

import numpy as np
import pytest

from spheretwin.models.kinematics import rate_jacobian
from spheretwin.models.magnetics import torque_matrix
from tests.twin.passive_cases import ASKEW, ENGINES, OFFSET, PD, STILL, table
from tests.twin.session_cases import write_curve

# --- the nominal torque matrix


@pytest.mark.parametrize("engine", ENGINES)
@pytest.mark.parametrize("scale", [2.0, 0.5, 4.0, -1.0])
def test_a_scale_of_the_nominal_matrix_divides_the_currents(engine, scale):
    changes = {"plant.engine": engine}
    true = table(1, "hold", changes | PD)
    assumed = table(1, "hold", changes | PD | {"nominal.torque_scale": scale})
    assert true["allocation_scale"][0] == assumed["allocation_scale"][0] == 1
    # A power of two moves exponents alone: not one bit of a mantissa.
    np.testing.assert_array_equal(assumed["current_command_A"][0], true["current_command_A"][0] / scale)
    np.testing.assert_array_equal(assumed["torque_command_Nm"], true["torque_command_Nm"])
    np.testing.assert_array_equal(assumed["torque_Nm"][0], true["torque_Nm"][0] / scale)


def test_a_nominal_curve_of_half_the_torque_is_a_scale_of_a_half(actuator, tmp_path):
    half = write_curve(tmp_path / "half.csv", actuator.torque_curve, 0.5)
    by_curve = table(300, changes=PD | {"nominal.torque_curve": half})
    by_scale = table(300, changes=PD | {"nominal.torque_scale": 0.5})
    # Samples are halved without rounding; the spline through them rounds anew.
    np.testing.assert_allclose(by_curve.values, by_scale.values, rtol=1e-9, atol=1e-12)
    assert not np.array_equal(by_curve["q_rad"], table(300, changes=PD)["q_rad"])


# --- nominal inertia, currents


@pytest.mark.parametrize("law", ["pd", "adaptive_fuzzy", "afsm"])
def test_the_nominal_inertia_scales_what_the_law_asks_for(law, actuator):
    changes = STILL | {"controller.law": law}
    true = table(1, "hold", changes)["torque_command_Nm"][0]
    factors = np.array([2.0, 0.5, 4.0])
    assumed = {"nominal.inertia_kg_m2": (factors * actuator.inertia).tolist()}
    np.testing.assert_array_equal(table(1, "hold", changes | assumed)["torque_command_Nm"][0], factors * true)
    changes |= {"controller.level": "torque"}
    commands = (table(1, "hold", changes | more)["torque_command_Nm"] for more in ({}, assumed))
    np.testing.assert_array_equal(*commands)


@pytest.mark.parametrize("allocation", ["least_norm", "bounded"])
def test_the_lower_of_two_limits_binds(allocation):
    changes = {"allocation": allocation}
    low = table(300, "hold", changes | {"nominal.current_limit_A": 0.3})
    assert np.abs(low["current_command_A"]).max() == 0.3
    assert np.any(low["allocation_scale"] < 1)
    unknown = changes | PD | {"nominal.current_limit_A": 100.0, "drive.current_limit_A": 0.2}
    high = table(300, "hold", unknown)
    assert np.abs(high["current_command_A"]).max() > 0.25
    np.testing.assert_array_equal(high["allocation_scale"], 1)  # the controller does not know of the limit
    assert 0.19 < np.abs(high["current_A"]).max() <= 0.2
    # Without a lag each current is its command, as far as the amplifiers go.
    ideal = table(300, "hold", unknown | {"drive.time_constant_s": 0.0})
    np.testing.assert_array_equal(ideal["current_A"], np.clip(ideal["current_command_A"], -0.2, 0.2))


# --- sensors


def test_the_rotor_rests_where_the_sensors_see_no_error():
    stiff = {"controller.stiffness": 900.0, "controller.damping": 60.0}
    run = table(3000, "hold", PD | ASKEW | stiff)
    # Critically damped at 30 1/s: after 3 s the start is gone to exp(-90) of 0.3 rad.
    np.testing.assert_allclose(run["error_rad"][-1], -OFFSET, rtol=0, atol=1e-14)
    np.testing.assert_allclose(run["q_measured_rad"][-1], run["q_ref_rad"][-1], rtol=0, atol=1e-14)


def test_measured_columns_are_what_the_controller_has():
    run = table(500, changes=ASKEW)
    np.testing.assert_array_equal(run["q_measured_rad"], run["q_rad"] + OFFSET)
    np.testing.assert_array_equal(run["qdot_estimated_rad_s"], run["qdot_rad_s"])
    np.testing.assert_array_equal(run["error_rad"], run["q_rad"] - run["q_ref_rad"])
    s = 50 * (run["q_measured_rad"] - run["q_ref_rad"]) + run["qdot_rad_s"] - run["qdot_ref_rad_s"]
    np.testing.assert_allclose(run["sliding_s"], s, rtol=0, atol=1e-13)  # of some 10 rad/s


@pytest.mark.parametrize("scale", [1.0, 0.8])
@pytest.mark.parametrize("allocation", ["least_norm", "bounded"])
def test_currents_are_allocated_at_the_measured_pose_by_the_nominal_matrix(allocation, scale, actuator):
    changes = {"allocation": allocation, "nominal.torque_scale": scale, "nominal.current_limit_A": 0.1}
    run = table(800, "hold", PD | ASKEW | changes)
    assert len(run) == 800
    assert 0 < np.count_nonzero(run["allocation_scale"] < 1) < 800
    for row in range(0, 800, 7):
        seen, command = run["q_measured_rad"][row], run["current_command_A"][row]
        wanted = run["allocation_scale"][row] * run["torque_command_Nm"][row]
        torque = rate_jacobian(seen).T @ (scale * torque_matrix(seen, actuator)) @ command
        np.testing.assert_allclose(torque, wanted, rtol=0, atol=1e-11)  # as in a run with ideal sensors
    q = run["q_rad"][50]
    at_the_true_pose = rate_jacobian(q).T @ (scale * torque_matrix(q, actuator))
    wanted = run["allocation_scale"][50] * run["torque_command_Nm"][50]
    assert np.abs(at_the_true_pose @ run["current_command_A"][50] - wanted).max() > 1e-4
