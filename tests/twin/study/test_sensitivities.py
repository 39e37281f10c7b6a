"""Derivatives of a run: an exact proportion, runs of sessions, CasADi, their order, refusals."""

import casadi as ca
import numpy as np
import pytest

from spheretwin import casadi, plant
from spheretwin.models.base.errors import InputError
from spheretwin.simulation import simulate
from spheretwin.study.sensitivities import sensitivities

LOAD, STIFFNESS = "disturbance.load", "controller.stiffness.1"
PD = {"controller.law": "pd", "controller.stiffness": [400.0] * 3, "duration": 0.4, LOAD: 0.5}


def test_the_error_of_a_small_load_is_proportional_to_it():
    still = {**PD, LOAD: 4e-3, "plant.initial_rad": [0.2, -0.1, 0.3]}
    found = sensitivities("hold", {LOAD: 1e-3}, still, ["rms_error_rad"])
    slope = found.derivatives["rms_error_rad"][LOAD]
    # Errors of some 0.1 mrad: the loop is linear but for their products.
    np.testing.assert_allclose(slope, np.array(found.figures["rms_error_rad"]) / 4e-3, rtol=1e-3)


def test_derivatives_are_those_of_a_curve_through_runs_of_sessions():
    steps = {LOAD: 0.05, STIFFNESS: 5.0}
    found = sensitivities("nutation", steps, PD, ["rms_error_rad", "rms_torque_Nm"])
    own = {LOAD: PD[LOAD], STIFFNESS: 400.0}
    for name, step in steps.items():
        places = np.linspace(-1, 1, 7)
        rows = []
        for place in places:
            value = own[name] + place * step
            change = {name: value} if name == LOAD else {"controller.stiffness": [400.0, value, 400.0]}
            run = simulate("nutation", {**PD, **change})
            rows.append([*run.figures["rms_error_rad"], run.figures["rms_torque_Nm"]])
        slopes = np.polynomial.polynomial.polyfit(places * step, rows, 6)[1]
        ours = np.array([*found.derivatives["rms_error_rad"][name], found.derivatives["rms_torque_Nm"][name]])
        errors = np.array([*found.errors["rms_error_rad"][name], found.errors["rms_torque_Nm"][name]])
        assert np.all(np.abs(ours - slopes) <= errors), name
        assert np.all(errors < 1e-2 * np.abs(ours)), name


def test_the_stated_error_is_of_second_order():
    whole, half = (
        sensitivities("nutation", {LOAD: step}, PD).errors["rms_error_rad"][LOAD] for step in (0.1, 0.05)
    )
    np.testing.assert_allclose(whole / half, 4.0, rtol=0.1)


CURRENTS_A = [0.3 * (-1) ** group * (1 + 0.1 * group) for group in range(18)]
FREE = {
    "manual.currents_A": CURRENTS_A,
    "duration": 0.03,
    "plant.engine": "lagrangian",
    "plant.initial_rad": [0.1, -0.2, 0.3],
    "plant.initial_rad_s": [0.5, 1.0, -0.4],
    "plant.payload_kg": 0.05,
    "drive.time_constant_s": 0.0,
    "disturbance.load": 0.0,
}
STEP_s = 5e-4


def _exact(ticks):
    """Poses of `FREE` at its ticks, and their derivatives by pose, rates and currents, of CasADi."""
    parameters = plant.parameters("hold", FREE)
    field, rotor = casadi.torque_matrix(parameters), casadi.rigid_body()
    body = casadi.parameter_vector(parameters)[:4]
    q, v, current = ca.MX.sym("q", 3), ca.MX.sym("v", 3), ca.MX.sym("i", 18)
    middle = q + 0.5 * STEP_s * v
    x, y, z = ca.vertsplit(field(middle) @ current)
    (sa, sb, _), (ca_, cb, _) = ca.vertsplit(ca.sin(middle)), ca.vertsplit(ca.cos(middle))
    held = ca.vertcat(x, ca_ * y + sa * z, sb * x + cb * (ca_ * z - sa * y))
    rates, gains, slopes = [v], [rotor(q, v, held, body)], (0.5, 0.5, 1.0)
    for share in slopes:
        at = q + share * STEP_s * rates[-1], v + share * STEP_s * gains[-1]
        rates, gains = [*rates, at[1]], [*gains, rotor(*at, held, body)]
    ends = [start + STEP_s / 6 * (k[0] + 2 * k[1] + 2 * k[2] + k[3]) for start, k in ((q, rates), (v, gains))]
    state = ca.vertcat(q, v)
    step = ca.Function("step", [state, current], [ca.vertcat(*ends)])
    start, many = ca.MX.sym("x", 6), 2 * (ticks - 1)
    path = step.mapaccum("path", many)(start, ca.repmat(current, 1, many))
    poses = ca.vec(ca.horzcat(start, path)[:3, ::2])
    given = np.array(FREE["plant.initial_rad"] + FREE["plant.initial_rad_s"]), np.array(CURRENTS_A)
    by = ca.horzcat(ca.jacobian(poses, start), ca.jacobian(poses, current))
    found = [np.array(one) for one in ca.Function("all", [start, current], [poses, by])(*given)]
    return found[0].reshape(ticks, 3), found[1].reshape(ticks, 3, 24)


def test_derivatives_of_a_trajectory_are_those_of_casadi():
    steps = {"plant.initial_rad.0": 1e-3, "plant.initial_rad_s.1": 1e-2, "manual.currents_A.4": 1e-2}
    found = sensitivities("hold", steps, FREE, ["q_rad"])
    poses, exact = _exact(30)
    np.testing.assert_allclose(found.figures["q_rad"], poses, rtol=0, atol=1e-12)
    for name, place in zip(steps, (0, 4, 6 + 4), strict=True):
        difference = np.abs(found.derivatives["q_rad"][name] - exact[:, :, place])
        largest = np.abs(exact[:, :, place]).max()
        # Second derivatives of the torque curve, of cubic pieces, jump between them.
        assert np.all(difference <= found.errors["q_rad"][name] + 1e-8 * largest), name
        assert found.errors["q_rad"][name].max() < 1e-6 * largest, name


@pytest.mark.parametrize(
    ("steps", "changes", "received"),
    [
        ({LOAD: 0.0}, {}, "a step of disturbance.load above 0, received 0.0"),
        ({LOAD: float("nan")}, {}, "received nan"),
        ({"controller.law": 1.0}, {}, "received controller.law = 'pd'"),
        ({"controller.stiffness.3": 1.0}, {}, "received controller.stiffness.3 = none"),
        ({LOAD: 1.0}, {LOAD: 900.0}, "received left_workspace"),
        ({LOAD: 0.1}, {"plant.initial_rad": [0.2, -0.1, 0.3]}, "received no overshoot_rad"),
    ],
)
def test_refusals(steps, changes, received):
    figures = ["overshoot_rad"] if "plant.initial_rad" in changes else ["rms_error_rad"]
    with pytest.raises(InputError, match=received):
        sensitivities("hold", steps, {**PD, **changes}, figures)
