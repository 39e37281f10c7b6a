"""Torques fed forward: the plant's own friction, the nominal inverse dynamics, and who knows of it."""

import numba
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from spheretwin.control.compensators.feed_forward import (
    FeedForward,
    FeedForwardSection,
    NominalRotor,
    compute_feed_forward,
    fill_feed_forward,
)
from spheretwin.control.law import Law
from spheretwin.models.lagrangian import coriolis_matrix, inertia_matrix
from spheretwin.models.telemetry.signals import ANGLES, Signal
from spheretwin.plant.friction import slow_down
from spheretwin.session import Session
from spheretwin.simulation import simulate
from tests.control.compensators import cases
from tests.twin.plant.motions import friction
from tests.twin.plant.test_friction import ideal

COULOMB, VISCOUS = np.array([2e-3, 3e-3, 4e-3]), np.array([1e-4, 2e-4, 3e-4])
INERTIA = np.array([2.0e-3, 2.3e-3, 2.6e-3])
ROTOR = NominalRotor(INERTIA, COULOMB, VISCOUS)

numbers = st.lists(st.floats(-3, 3), min_size=3, max_size=3).map(np.array)


def torque_of(reference, **shares):
    feed = FeedForward.filled(fill_feed_forward, FeedForwardSection(**shares), ROTOR, 1e-3, 0.0, delays=8)[0]
    compute_feed_forward(feed, np.array(reference))
    return feed.torque_q


@settings(max_examples=50)
@given(numbers.map(lambda q: 0.4 * q), numbers)
def test_at_a_steady_rate_it_cancels_the_plant_s_friction(q, v):
    """To rounding where both are smoothed alike; else by what the smoothing takes off Coulomb's level."""
    smooth = np.sqrt(v**2 + 0.01**2)
    torque = -(VISCOUS + COULOMB / smooth) * v
    plant, mean = friction(COULOMB, VISCOUS, 0.01, 1e-8), np.zeros(3)
    slow_down(
        plant, ideal(INERTIA), q, v.copy(), mean
    )  # the plant's own: half a step's share of the mean over a step
    # In half a step the rate changes by k h / 2J, a share of 1e-6 at most, and those it is coupled to; what
    # is lost of the rates, 1e-16 of them, is over h a torque of up to 1e-10 N·m.
    np.testing.assert_allclose(2 * mean, torque, rtol=0, atol=3e-6 * np.abs(COULOMB).max() + 1e-9)
    np.testing.assert_allclose(torque_of([q, v, 0 * v], friction=(1.0,) * 3), -torque, rtol=1e-11, atol=1e-14)
    for smoothing in (1e-6, 0.1):
        left = torque_of([q, v, 0 * v], friction=(1.0,) * 3, smoothing_rad_s=smoothing) + torque
        # c (1 - |v| / √(v² + s²)) of either.
        short = [1 - np.abs(v) / np.sqrt(v**2 + s**2) for s in (0.01, smoothing)]
        assert (np.abs(left) <= COULOMB * np.abs(short[0] - short[1]) * (1 + 1e-9) + 1e-13).all()


@settings(max_examples=50)
@given(numbers.map(lambda q: 0.4 * q), numbers, numbers)
def test_inertia_is_the_inverse_dynamics_of_the_nominal_model(q, v, a):
    torque = inertia_matrix(q, INERTIA) @ a + coriolis_matrix(q, v, INERTIA) @ v
    share = np.array([0.5, 1.0, 1.2])
    # A dozen products of 1e-2 N·m.
    np.testing.assert_allclose(torque_of([q, v, a], inertia=tuple(share)), share * torque, rtol=0, atol=1e-16)


HANDED = (Signal("accounted_Nm", "N·m", 3, "torque of the last period, as told", ANGLES),)


@numba.njit
def idle(t, reference, measurement, parameters, state, torque):
    for i in range(3):
        state[i] = measurement[2, i]
        torque[i] = 0.0


IDLE = Law("idle", idle, [], np.zeros(3), HANDED, asks_torque=True)


class Turning:
    """The third hinge at a steady rate."""

    def sample(self, t):
        samples = np.zeros((len(t), 3, 3))
        samples[:, 0, 2], samples[:, 1, 2] = 0.5 * t, 0.5
        return samples


def alone(name="hold", **changes):
    """A run whose nominal model is true, without delay and lag."""
    return cases.true_model(name, **{"drive__time_constant_s": 0.0} | changes)


@pytest.mark.parametrize("share", [1.0, 0.0])
def test_a_rotor_with_friction_coasts_for_ever_where_it_is_fed_forward(share):
    scenario = alone(
        plant__initial_rad=[0.0, 0.0, 0.0], plant__initial_rad_s=[0.0, 0.0, 0.5], duration=1.0,
        plant__coulomb_Nm=[2e-3] * 3, plant__viscous_Nm_s=[1e-4] * 3,
        controller__feed_forward__friction=share,
    )  # fmt: skip
    table = simulate(scenario, law=IDLE, trajectory=Turning()).telemetry
    gained = table["qdot_rad_s"][-1, 2] - 0.5
    if not share:
        assert gained == pytest.approx(-0.5, abs=1e-3)  # long since at rest
        return
    # Friction of first order in the step would be wrong by a share h k / J of k v, and gain 8e-4 rad/s in a
    # second. What is left of second order, and of currents held while the rotor turns by 0.5 mrad, is less
    # than a hundredth of that.
    J, k = Session(scenario).actuator.inertia[2], 1e-4 + 2e-3 / np.hypot(0.5, 0.01)
    assert abs(gained) < 0.01 * 0.5e-3 * k**2 * 0.5 / J**2


def test_inertia_alone_follows_a_motion_as_the_period_goes_to_zero():
    """Without any law: open-loop inverse dynamics, held over each period, of first order in it."""
    errors = []
    for period_s in (1e-3, 5e-4):
        scenario = alone(
            "sinusoid", plant__initial_rad_s=[0.2 * np.pi] * 3, duration=0.5, controller__period_s=period_s,
            plant__step_s=period_s / 2, controller__feed_forward__inertia=1.0,
        )  # fmt: skip
        errors.append(np.abs(simulate(scenario, law=IDLE).telemetry["error_rad"]).max())
    assert errors[0] < 2e-3
    assert 1.8 < errors[0] / errors[1] < 2.2


@pytest.mark.parametrize("delay_s", [0.0, 5e-4, 1e-3, 2.5e-3])
@pytest.mark.parametrize("predicted", [False, True])
def test_the_applied_torque_of_a_law_excludes_the_feed_forward(delay_s, predicted):
    """One that asks for nothing is told of nothing, while what is fed forward turns the rotor."""
    scenario = alone(
        "sinusoid", plant__initial_rad_s=[0.2 * np.pi] * 3, duration=0.3, drive__delay_s=delay_s,
        controller__feed_forward__inertia=1.0, controller__prediction__on=predicted,
    )  # fmt: skip
    table = simulate(scenario, law=IDLE).telemetry
    fed = np.abs(table["feed_forward_Nm"]).max()
    np.testing.assert_array_equal(table["torque_command_Nm"], table["feed_forward_Nm"])
    # From where the commands act on; the rotor turns by 2 mrad while one is on its way, and poles are many.
    assert np.abs(table["accounted_Nm"][5:]).max() < 0.06 * fed


def test_the_controller_knows_the_nominal_friction_alone():
    worn = {"plant__coulomb_Nm": [2e-3] * 3, "controller__feed_forward__friction": 0.5, "duration": 0.05}
    unknown = simulate(alone("sinusoid", **worn, nominal__equals_truth=False))
    assert unknown.scenario.nominal.coulomb_Nm == (0.0,) * 3
    assert not unknown.telemetry["feed_forward_Nm"].any()
    known = simulate(alone("sinusoid", **worn)).scenario.nominal
    assert (known.coulomb_Nm, known.viscous_Nm_s) == ((2e-3,) * 3, (0.0,) * 3)
    other = simulate(alone("sinusoid", **worn, nominal__coulomb_Nm=[0.0, 0.0, 4e-3]))
    table = other.telemetry
    rate = table["qdot_ref_rad_s"]
    expected = 0.5 * np.array([0.0, 0.0, 4e-3]) * rate / np.sqrt(rate**2 + 0.01**2)
    # A root, a quotient and two products.
    np.testing.assert_allclose(table["feed_forward_Nm"], expected, rtol=1e-14, atol=0)
