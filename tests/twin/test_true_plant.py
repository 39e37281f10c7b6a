"""What is true of the plant: gains, payload, gravity, friction, and the energy of all that."""

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from spheretwin.models.kinematics import rate_jacobian
from spheretwin.models.magnetics import torque_matrix
from tests.twin.passive_cases import ASKEW, ENGINES, FREE, PAYLOAD_KG, STILL, table
from tests.twin.plant.motions import kinetic_J, order, potential_J

# --- the true torque


GAIN = np.linspace(0.0, 1.7, 18)


@pytest.mark.parametrize("engine", ENGINES)
def test_torque_is_that_of_the_currents_times_their_gains(engine, actuator):
    """At the true pose, also where the measured one is another."""
    changes = {"plant.engine": engine, "plant.group_gain": GAIN.tolist()}
    run = table(600, changes=changes | (ASKEW if engine == "mujoco" else {}))
    middle = run["q_rad"] + 0.25e-3 * run["qdot_rad_s"]  # of the first physics step
    for row in range(0, 600, 7):
        G = torque_matrix(middle[row], actuator)
        # The same 18 products and sums in another order, of torques below 1 N·m.
        expected = G @ (GAIN * run["current_A"][row])
        np.testing.assert_allclose(run["torque_Nm"][row], expected, rtol=0, atol=1e-14)
    bare = torque_matrix(middle[300], actuator) @ run["current_A"][300]
    assert np.abs(bare - run["torque_Nm"][300]).max() > 1e-3


# --- gravity and rates at the start


@pytest.mark.parametrize("engine", ENGINES)
@pytest.mark.parametrize("gravity", [0.0, 1.62, 9.81])
def test_a_payload_falls_as_a_pendulum(engine, gravity, actuator):
    changes = STILL | {
        "plant.engine": engine, "plant.payload_kg": PAYLOAD_KG, "plant.gravity_m_s2": gravity,
        "plant.initial_rad": [0.1, 0.0, 0.0], "plant.initial_rad_s": [0.5, 0.0, 0.0],
    }  # fmt: skip
    run = table(301, "hold", changes, FREE)
    height = actuator.payload_mount_m[2]
    inertia = actuator.inertia[0] + PAYLOAD_KG * height**2

    def flow(_, state):
        return [state[1], PAYLOAD_KG * gravity * height / inertia * np.sin(state[0])]

    exact = solve_ivp(flow, (0, 0.3), [0.1, 0.5], "DOP853", t_eval=run["t_s"], rtol=1e-13, atol=1e-14).y
    # RK4 of half a millisecond at some 5 1/s: (5 * 5e-4)^4 / 120 a unit of growth.
    np.testing.assert_allclose(run["q_rad"][:, 0], exact[0], rtol=0, atol=1e-11)
    np.testing.assert_allclose(run["qdot_rad_s"][:, 0], exact[1], rtol=0, atol=1e-10)
    np.testing.assert_allclose(run["q_rad"][:, 1:], 0, atol=1e-14)
    if gravity == 0:
        np.testing.assert_allclose(run["q_rad"][:, 0], 0.1 + 0.5 * run["t_s"], rtol=0, atol=1e-13)


# --- friction in the loop


LOADED = {
    "controller.law": "pd", "plant.payload_kg": PAYLOAD_KG, "plant.coulomb_Nm": [4e-3, 3e-3, 2e-3],
    "plant.viscous_Nm_s": [1e-4, 2e-4, 3e-4], "plant.friction_smoothing_rad_s": 0.1,
    "plant.initial_rad_s": [1.0, -2.0, 3.0], "plant.modelling_torque_Nm": [0.01, -0.01, 0.005],
}  # fmt: skip


@pytest.mark.parametrize("name", ["sinusoid", "nutation"])
def test_both_engines_agree_on_a_loop_with_friction_payload_and_gravity(name):
    changes = LOADED | {"disturbance.load": 0.5}
    one, other = (table(3000, name, changes | {"plant.engine": engine}) for engine in ENGINES)
    assert len(one) == 3000
    # Both take the same RK4 steps of the same equations: they differ by rounding, which PD does not amplify.
    bounds = {"q_rad": 1e-11, "qdot_rad_s": 1e-10, "friction_Nm": 1e-11, "current_A": 1e-9}
    for column, bound in bounds.items():
        np.testing.assert_allclose(one[column], other[column], rtol=0, atol=bound)


# --- energy


def works_J(run, step_s, unmodelled_Nm):
    """Work of coils, friction, disturbance and what is not modelled, each from the rows alone."""
    moved = np.diff(run["q_rad"], axis=0)
    middle = run["q_rad"] + 0.5 * step_s * run["qdot_rad_s"]
    coils = np.array([rate_jacobian(q).T @ tau for q, tau in zip(middle, run["torque_Nm"], strict=True)])
    has_friction = any(signal.name == "friction_Nm" for signal in run.signals)
    return {
        "coils": np.sum(coils[:-1] * moved),
        "friction": np.sum(run["friction_Nm"][:-1] * moved) if has_friction else 0.0,
        "disturbance": -np.sum(run["disturbance_Nm"][:-1] * moved),
        "unmodelled": -np.sum(moved @ unmodelled_Nm),
    }


FRICTIONLESS = {"plant.coulomb_Nm": [0.0] * 3, "plant.viscous_Nm_s": [0.0] * 3}


def unbalanced_J(engine, step_s, actuator, changes):
    """Energy over 0.4 s that the works do not account for, and the works."""
    changes = changes | {"plant.engine": engine, "plant.step_s": step_s, "controller.period_s": step_s}
    run = table(round(0.4 / step_s) + 1, changes=LOADED | changes | {"plant.modelling_error": 0.2})
    ends = [
        kinetic_J(q, qdot, actuator, PAYLOAD_KG, 0.2) + potential_J(q, actuator, PAYLOAD_KG)
        for q, qdot in zip(run["q_rad"][[0, -1]], run["qdot_rad_s"][[0, -1]], strict=True)
    ]
    work_J = works_J(run, step_s, np.array(LOADED["plant.modelling_torque_Nm"]))
    return abs(ends[1] - ends[0] - sum(work_J.values())), work_J


@pytest.mark.parametrize("engine", ENGINES)
def test_energy_is_kept_by_the_rows_of_the_telemetry_alone(engine, actuator):
    # A row each physics step. Torques on the hinges are held over it, so that their works are exact; what is
    # left is the error of the Runge-Kutta steps, of fourth order.
    steps = np.array([8e-3, 4e-3, 2e-3])
    left_J = [unbalanced_J(engine, step_s, actuator, FRICTIONLESS)[0] for step_s in steps]
    assert 3.7 < order(steps, left_J) < 4.3, left_J
    left_J, work_J = unbalanced_J(engine, 5e-4, actuator, FRICTIONLESS)
    # Measured 1e-14 J of some 20 mJ that go in and out; any of the works left out would be seen.
    assert left_J < 1e-13
    assert min(abs(work) for name, work in work_J.items() if name != "friction") > 1e-5


@pytest.mark.parametrize("engine", ENGINES)
def test_friction_takes_the_energy_that_its_rows_say_to_second_order(engine, actuator):
    # The mean of friction over a step times the way: its halves act on rates that differ.
    steps = np.array([2e-3, 1e-3, 5e-4])
    left_J = [unbalanced_J(engine, step_s, actuator, {})[0] for step_s in steps]
    assert 1.8 < order(steps, left_J) < 2.2, left_J
    assert left_J[-1] < 1e-3 * abs(unbalanced_J(engine, 5e-4, actuator, {})[1]["friction"])
