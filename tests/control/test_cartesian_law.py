"""A law that writes the torque of the stator frame: what the controller allocates and logs."""

import numpy as np
import pytest

from spheretwin import scenario as scenarios
from spheretwin.control.law import Law
from spheretwin.models.kinematics import rate_jacobian
from spheretwin.models.magnetics import torque_matrix
from spheretwin.simulation import simulate

TORQUE_S = np.array([0.02, -0.03, 0.01])
POSE = [0.4, 1.2, -0.5]


def constant(t, reference, measurement, parameters, state, torque):
    torque[:] = parameters


def first_tick(cartesian, **fields):
    law = Law("constant", constant, TORQUE_S, [], cartesian=cartesian)
    changes = {"plant.initial_rad": POSE, "plant.engine": "lagrangian", "duration": 1e-3}
    changes |= {key.replace("__", "."): value for key, value in fields.items()}
    run = simulate(scenarios.load("hold", changes), law=law)
    return {name: run.telemetry[name][0] for name in ("torque_command_Nm", "current_command_A")}


def test_cartesian_torque_is_allocated_as_it_is_and_logged_on_the_hinges(actuator):
    tick = first_tick(True)
    G, E = torque_matrix(np.array(POSE), actuator), rate_jacobian(np.array(POSE))
    np.testing.assert_allclose(G @ tick["current_command_A"], TORQUE_S, rtol=1e-9)
    np.testing.assert_allclose(tick["torque_command_Nm"], E.T @ TORQUE_S, rtol=1e-12)


def test_generalised_torque_is_mapped_to_the_stator_frame(actuator):
    tick = first_tick(False)
    G, E = torque_matrix(np.array(POSE), actuator), rate_jacobian(np.array(POSE))
    np.testing.assert_allclose(E.T @ G @ tick["current_command_A"], TORQUE_S, rtol=1e-9)
    np.testing.assert_array_equal(tick["torque_command_Nm"], TORQUE_S)


@pytest.mark.parametrize("cartesian", [False, True])
def test_feed_forward_adds_its_torque_on_the_hinges(actuator, cartesian):
    """Viscous friction at the rate of the reference."""
    changes = {
        "trajectory.shape": "jog", "trajectory.start_rad": POSE, "trajectory.rate_rad_s": [0.1, -0.2, 0.3],
        "controller.feed_forward.friction": 1.0, "nominal.viscous_Nm_s": [1e-3, 2e-3, 3e-3],
    }  # fmt: skip
    fields = {key.replace(".", "__"): value for key, value in changes.items()}
    tick = first_tick(cartesian, **fields)
    G, E = torque_matrix(np.array(POSE), actuator), rate_jacobian(np.array(POSE))
    of_law = E.T @ TORQUE_S if cartesian else TORQUE_S
    added = tick["torque_command_Nm"] - of_law
    np.testing.assert_allclose(added, np.array([1e-3, 2e-3, 3e-3]) * [0.1, -0.2, 0.3], rtol=1e-9)
    np.testing.assert_allclose(E.T @ G @ tick["current_command_A"], of_law + added, rtol=1e-9)
