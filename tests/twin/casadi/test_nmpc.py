"""Predictive control: no error under a constant load, limits of the currents, and the law in a session."""

import numpy as np
import pytest

from spheretwin import plant
from spheretwin.casadi import nmpc, nmpc_file
from spheretwin.casadi.nmpc import PredictiveControl
from spheretwin.control.law import NominalModel
from spheretwin.models import magnetics
from spheretwin.models.kinematics import rate_jacobian
from spheretwin.scenario import load
from spheretwin.simulation import simulate

PERIOD_s = 1e-3


@pytest.fixture(scope="module")
def parameters():
    return plant.parameters("hold")


def known(actuator):
    return NominalModel(PERIOD_s, 0.0, np.array(actuator.inertia))


class Loop:
    """Law, least-norm allocation and the plant step, without anything else of a session."""

    def __init__(self, parameters, actuator, target, load_Nm, **gains):
        self.law = PredictiveControl(**gains).build(known(actuator))
        self.state, self.memory = plant.State(np.zeros(3), np.zeros(3)), self.law.state.copy()
        self.applied, self.currents = np.zeros(3), []
        self.reference = np.array([target, np.zeros(3), np.zeros(3)])
        self._settings = parameters, actuator, np.full(3, load_Nm)

    def run(self, ticks):
        parameters, actuator, load_Nm = self._settings
        for tick in range(ticks):
            q, qdot = self.state
            torque, measurement = np.full(3, np.nan), np.array([q, qdot, self.applied])
            self.law.step(
                tick * PERIOD_s, self.reference, measurement, self.law.parameters, self.memory, torque
            )
            hinge_matrix = rate_jacobian(q).T @ magnetics.torque_matrix(q, actuator)
            current = np.linalg.pinv(hinge_matrix) @ torque
            self.currents.append(current)
            self.applied = torque
            for _ in range(2):
                self.state = plant.step(self.state, current, load_Nm, parameters, PERIOD_s / 2)


@pytest.mark.release("0.9 s; changes with CasADi and IPOPT")
def test_a_constant_load_leaves_no_error(parameters, actuator):
    target = np.array([0.1, -0.05, 0.15])
    loop = Loop(parameters, actuator, target, load_Nm=0.03)
    loop.run(800)
    # The slowest pole of the observer, 30 1/s, leaves e^-24 of the first error; the solver has a tolerance
    # of 1e-6, of a cost that is scaled by 1e6.
    np.testing.assert_allclose(loop.state.q_rad, target, rtol=0, atol=1e-7)
    np.testing.assert_allclose(loop.state.qdot_rad_s, 0, rtol=0, atol=1e-6)


def test_planned_currents_stay_within_their_limit(parameters, actuator):
    loop = Loop(parameters, actuator, np.array([0.4, 0.0, 0.0]), 0.0, current_limit_A=1.0, ticks=5)
    loop.run(50)
    largest = np.abs(loop.currents).max()
    # The plan uses the allocation at the pose of the solve; until the next the rotor turns by 0.02 rad.
    assert 0.95 < largest < 1.05


@pytest.mark.uncompiled
@pytest.mark.parametrize("allocation", ["least_norm", "bounded"])
def test_no_command_exceeds_the_limit_between_solves(allocation):
    """With the limit in the plan alone, pose and correction need 2.70 A."""
    fields = {"controller.law": nmpc_file(), "controller.current_limit_A": 2.0, "allocation": allocation}
    run = simulate(load("hold", {**fields, "duration": 0.06}))
    largest_A = np.abs(run.telemetry["current_command_A"]).max(axis=1)
    assert largest_A.max() == 2.0
    assert np.count_nonzero(largest_A > 1.99) > 40


def test_between_solves_the_torque_follows_the_estimated_disturbance(parameters, actuator):
    loop = Loop(parameters, actuator, np.array([0.1, 0.0, 0.0]), load_Nm=0.03)
    loop.run(15)
    planned = loop.memory[nmpc.TORQUE : nmpc.TORQUE + 3].copy()
    loop.run(3)
    np.testing.assert_array_equal(loop.memory[nmpc.TORQUE : nmpc.TORQUE + 3], planned)
    change = loop.memory[nmpc.DISTURBANCE :][:3] - loop.memory[nmpc.ASSUMED :][:3]
    assert np.abs(change).max() > 0
    np.testing.assert_array_equal(loop.applied, planned - loop.memory[nmpc.DISTURBANCE :][:3]
                                  + loop.memory[nmpc.ASSUMED :][:3])  # fmt: skip


def test_the_same_inputs_give_the_same_torques(parameters, actuator):
    loops = [Loop(parameters, actuator, np.array([0.1, 0.0, 0.0]), 0.01) for _ in range(2)]
    for loop in loops:
        loop.run(12)
    np.testing.assert_array_equal(*(loop.memory for loop in loops))


def test_the_file_is_a_law_of_a_scenario():
    scenario = load("tilt", {"controller.law": nmpc_file(), "controller.ticks": 20})
    assert scenario.controller.ticks == 20
    law = scenario.controller.build(NominalModel(PERIOD_s, 0.5e-3, np.array([2e-3, 2e-3, 2e-3])))
    assert [signal.name for signal in law.signals] == [signal.name for signal in nmpc.SIGNALS]
