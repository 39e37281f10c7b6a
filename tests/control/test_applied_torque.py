"""Applied torque of the controller against the torque of the plant."""

import numba
import numpy as np
import pytest
from scipy.integrate import quad

from spheretwin import scenario as scenarios
from spheretwin.control.applied_torque import (
    AppliedTorque,
    delay_capacity,
    estimate_applied_torque,
    fill_applied_torque,
)
from spheretwin.control.law import Law
from spheretwin.models.kinematics import rate_jacobian
from spheretwin.models.magnetics import torque_matrix
from spheretwin.models.telemetry.signals import ANGLES, Signal
from spheretwin.session import Session
from spheretwin.simulation import simulate
from tests.control.compensators.cases import response

PERIOD_S = 1e-3
BELIEVED = (Signal("believed_Nm", "N·m", 3, "torque of the last period, as believed", ANGLES),)


@pytest.mark.parametrize("delay", [0.0, 0.3, 1.0, 2.0, 2.75])
@pytest.mark.parametrize("lag_s", [0.0, 1e-4, 7e-4, 5e-2])
def test_mean_current_is_that_of_the_delayed_and_lagged_command(delay, lag_s):
    """Against the convolution of the piecewise constant command with the lag, by quadrature."""
    generator = np.random.default_rng(3)
    commands = generator.normal(size=12)
    delay_s = delay * PERIOD_S
    mine = AppliedTorque.filled(
        fill_applied_torque, True, PERIOD_S, delay_s, (2e-4, lag_s),  # the second group is measured
        groups=2, delays=delay_capacity(delay_s, PERIOD_S),
    )[0]  # fmt: skip
    G, pose = np.zeros((3, 2)), np.zeros(3)

    def current(t):
        return response(commands, (np.arange(len(commands)) + delay) * PERIOD_S, lag_s, t)

    for tick in range(len(commands)):
        estimate_applied_torque(mine, pose, G, np.repeat(commands[tick], 2))
        begin, end = tick * PERIOD_S, (tick + 1) * PERIOD_S
        switch = begin + (delay % 1) * PERIOD_S
        parts = [(begin, switch), (switch, end)] if switch > begin else [(begin, end)]
        # Midpoints of a jump are no matter: each part is smooth. Quadrature keeps 1e-12 of the largest.
        inside = 1e-13
        mean = sum(quad(current, a + inside, b - inside, epsabs=0, epsrel=1e-11)[0] for a, b in parts)
        np.testing.assert_allclose(mine.mean_current[1], mean / PERIOD_S, rtol=1e-8, atol=1e-9)


@numba.njit
def asking_step(t, reference, measurement, parameters, state, torque):
    for i in range(3):
        state[i] = measurement[2, i]
        error = measurement[0, i] - reference[0, i]
        torque[i] = -parameters[0] * error - parameters[1] * (measurement[1, i] - reference[1, i])


def asking(asks=True):
    return Law("asking", asking_step, np.array([0.5, 0.03]), np.zeros(3), BELIEVED if asks else (), asks)


@pytest.mark.parametrize("engine", ["mujoco", "lagrangian"])
def test_where_the_model_is_true_it_is_the_torque_of_the_coils(engine):
    """Against G_t(q) times the mean current of the plant, over the whole period."""
    scenario = scenarios.load("hold", {"plant.engine": engine, "duration": 0.1, "plant.step_s": 1e-3})
    table = simulate(scenario, law=asking()).telemetry
    np.testing.assert_array_equal(table["believed_Nm"][0], 0)
    actuator = Session(scenario).actuator
    for row in range(99):
        q = table["q_rad"][row]
        # One physics step a period, so that what is logged is the mean over the period.
        torque_q = rate_jacobian(q).T @ torque_matrix(q, actuator) @ table["current_A"][row]
        # Sums of 18 products of 1e-2 N·m in another order.
        np.testing.assert_allclose(table["believed_Nm"][row + 1], torque_q, rtol=0, atol=1e-15)


def test_an_unused_applied_torque_is_nan_and_changes_no_bit():
    scenario = scenarios.load("hold", {"duration": 0.1})
    silent, logged = simulate(scenario, law=asking(asks=False)), simulate(scenario, law=asking())
    np.testing.assert_array_equal(silent.telemetry["q_rad"], logged.telemetry["q_rad"])
    logging = Law("unasked", asking_step, np.array([0.5, 0.03]), np.zeros(3), BELIEVED)
    lost = simulate(scenario, law=logging)
    assert (lost.status, len(lost.telemetry)) == ("diverged", 0)  # it logs what is no number
