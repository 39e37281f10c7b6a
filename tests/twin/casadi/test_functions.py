"""CasADi functions of the plant next to the compiled ones, at random states."""

import subprocess
import sys

import casadi as ca
import numpy as np
import pytest

from spheretwin import casadi, plant
from spheretwin.models import lagrangian
from spheretwin.models.base.errors import InputError
from spheretwin.models.kinematics import rate_jacobian
from tests.requirements import C_COMPILER, needs_c_compiler

STATES = 60
LOADED = {
    "plant.coulomb_Nm": [0.01, 0.02, 0.03],
    "plant.coulomb_asymmetry": [0.2, -0.5, 0.0],
    "plant.viscous_Nm_s": [0.001, 0.002, 0.003],
}
SCATTERED = {
    "plant.poles.gain_error": 0.03,
    "plant.coils.angle_error_rad": 0.01,
    "plant.group_gain": [0.9] * 18,
}
PLANTS = {"sinusoid": {}, "tilt": LOADED}


@pytest.fixture(scope="module", params=PLANTS)
def parameters(request):
    return plant.parameters(request.param, PLANTS[request.param])


def states():
    random = np.random.default_rng(3)
    return zip(random.uniform(-1.3, 1.3, (STATES, 3)), random.normal(0, 3, (STATES, 3)), strict=True)


def acceleration(parameters, q, qdot, current):
    """Closed-form equations of motion under the torque of the compiled torque matrix."""
    smooth = np.sqrt(qdot**2 + parameters.friction_smoothing_rad_s**2)
    torque = rate_jacobian(q).T @ (plant.torque_matrix(q, parameters) @ current)
    levels = parameters.coulomb_Nm * (1 + np.sign(qdot) * parameters.coulomb_asymmetry)
    torque -= (parameters.viscous_Nm_s + levels / smooth) * qdot
    torque -= parameters.spring_Nm_rad * q + parameters.constant_torque_Nm
    return lagrangian.acceleration(q, qdot, torque, parameters.inertia_kg_m2, parameters.weight_moment_Nm)


def test_dynamics_are_the_equations_of_motion(parameters):
    f, p = casadi.dynamics(parameters), casadi.parameter_vector(parameters)
    current = np.linspace(-8, 8, 18)
    for q, qdot in states():
        expected = np.concatenate([qdot, acceleration(parameters, q, qdot, current)])
        xdot = np.array(f(np.concatenate([q, qdot]), current, p)).ravel()
        # The bound that users are promised; rounding alone is 2e-13 of the largest entry.
        np.testing.assert_allclose(xdot, expected, rtol=0, atol=1e-12 * max(1, np.abs(expected).max()))


@pytest.mark.parametrize("changes", [{}, SCATTERED], ids=["drawing", "scattered"])
def test_the_torque_matrix_is_the_compiled_one(changes):
    parameters = plant.parameters("sinusoid", changes)
    function = casadi.torque_matrix(parameters)
    for q, _ in [(np.zeros(3), None), *states()]:  # at 0 poles are in front of coils: cosines of 1
        expected = plant.torque_matrix(q, parameters)
        # The same cubics in another basis: some roundings, far below the promised 1e-7 of the peak.
        np.testing.assert_allclose(function(q), expected, rtol=0, atol=1e-12 * np.abs(expected).max())


def test_the_derivative_of_the_torque_matrix_is_that_of_its_cubics(parameters):
    q = ca.MX.sym("q", 3)
    function = casadi.torque_matrix(parameters)
    slope = ca.Function("slope", [q], [ca.jacobian(ca.vec(function(q)), q)])
    pose, step = np.array([0.31, -0.22, 0.43]), 1e-6
    for axis, direction in enumerate(np.eye(3)):
        ahead, behind = (plant.torque_matrix(pose + sign * step * direction, parameters) for sign in (1, -1))
        numeric = ((ahead - behind) / (2 * step)).ravel(order="F")
        # Central differences over 1e-6 rad: 1e-10 of rounding, and jumps of the slope between two cubics.
        np.testing.assert_allclose(np.array(slope(pose))[:, axis], numeric, rtol=0, atol=2e-4)


@needs_c_compiler
def test_casadi_generates_c_code_that_agrees(parameters, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    function = casadi.dynamics(parameters)
    function.generate("plant.c")
    subprocess.run([*C_COMPILER, "-shared", "-fPIC", "-O1", "plant.c", "-o", "plant.so", "-lm"], check=True)
    compiled = ca.external("f", f"{tmp_path}/plant.so")
    x, u = np.array([0.3, -0.2, 0.4, 1.0, 2.0, -1.0]), np.linspace(-2, 2, 18)
    p = casadi.parameter_vector(parameters)
    # The compiler may order and fuse operations otherwise.
    np.testing.assert_allclose(compiled(x, u, p), function(x, u, p), rtol=1e-11)


def test_a_general_joint_is_refused():
    parameters = plant.parameters("sinusoid", {"plant.mass.centre_m": [1e-3, 0.0, 0.0]})
    with pytest.raises(InputError, match="expected a plant with an ideal joint"):
        casadi.dynamics(parameters)


def test_other_magnetics_are_refused(parameters):
    tables = parameters.magnetics.tables._replace(curve=np.empty((0, 4)))
    field = parameters.magnetics._replace(tables=tables)
    with pytest.raises(InputError, match="expected an actuator with a torque curve, received one with a"):
        casadi.torque_matrix(parameters._replace(magnetics=field))


def test_a_missing_package_is_named(parameters, monkeypatch):
    monkeypatch.setitem(sys.modules, "casadi", None)
    with pytest.raises(InputError, match="expected casadi, which the extra casadi installs"):
        casadi.dynamics(parameters)
