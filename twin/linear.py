"""Linear model of the actuator about a pose: linearised actuation and equations of motion."""

from __future__ import annotations

import importlib
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal, NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from spheretwin.config.active_config import check_pose, initial_config
from spheretwin.config.plant_model import parameters_of
from spheretwin.models.actuator import Actuator
from spheretwin.models.base import extras
from spheretwin.models.base.arrays import Array
from spheretwin.models.base.errors import InputError, distinct_texts, shown
from spheretwin.models.coil_group import PerGroup, of_each_group
from spheretwin.models.kinematics import rate_jacobian
from spheretwin.models.lagrangian import gravity_stiffness, gravity_torque, inertia_matrix
from spheretwin.models.mjcf_reader import HINGES
from spheretwin.models.scatter import Scatter, summed_torque_matrix
from spheretwin.plant.part_scatter import scatter_of
from spheretwin.scenario import scenario_of
from spheretwin.scenario.files import Files
from spheretwin.scenario.sections import ResolvedScenario, Scenario


class Magnetics(NamedTuple):
    """Torque matrix of an actuator, each column times a gain."""

    actuator: Actuator
    gain: Array  # (n,)
    scatter: Scatter | None = None


class LinearisationData(NamedTuple):
    """Values of a resolved scenario that a linear model depends on."""

    inertia: Array
    """Principal inertias about the joint centre, (3,) in kg·m²; payload included."""
    weight_moment: float
    """m g l of the payload, N·m."""
    viscous_Nm_s: Array
    """Viscous friction of each hinge, (3,)."""
    unmodelled_torque_Nm: Array
    """Torque against the coils at angles of 0, (3,): constant, and of the cable."""
    spring_Nm_rad: Array
    """Stiffness of the cable about each hinge, (3,)."""
    magnetics: Magnetics
    """Magnetics from currents to torque."""
    nominal_magnetics: Magnetics
    """Magnetics of the allocation, from torque to currents."""
    lag_s: PerGroup
    """Time constant of the currents."""
    current_limit_A: float
    """Limit of the allocation; for the true model at most that of the drive."""


def linearisation_data(scenario: ResolvedScenario, files: Files, *, nominal: bool) -> LinearisationData:
    """Return the values of a resolved scenario, true or nominal.

    Raises
    ------
    InputError
        The Lagrangian does not support the model.
    """
    sheet, section, drive = scenario.nominal, scenario.plant, scenario.drive
    groups = len(files.actuator.groups)
    nominal_magnetics = Magnetics(files.nominal, np.full(groups, sheet.torque_scale))
    if nominal:
        return LinearisationData(
            inertia=np.array(sheet.inertia_kg_m2),
            weight_moment=0.0,
            viscous_Nm_s=np.array(sheet.viscous_Nm_s),
            unmodelled_torque_Nm=np.zeros(3),
            spring_Nm_rad=np.zeros(3),
            magnetics=nominal_magnetics,
            nominal_magnetics=nominal_magnetics,
            lag_s=sheet.time_constant_s,
            current_limit_A=sheet.current_limit_A,
        )
    true = parameters_of(scenario, files)
    if true.joint["on"][0]:
        raise InputError(
            "linear model: expected an ideal joint, received plant.mass or a model file with mass properties"
            " or hinges that differ from it"
        )
    return LinearisationData(
        inertia=true.inertia_kg_m2,
        weight_moment=true.weight_moment_Nm,
        viscous_Nm_s=true.viscous_Nm_s,
        unmodelled_torque_Nm=true.constant_torque_Nm,
        spring_Nm_rad=true.spring_Nm_rad,
        magnetics=Magnetics(
            files.actuator, true.torque_gain, scatter_of(section, scenario.seed, files.actuator)
        ),
        nominal_magnetics=nominal_magnetics,
        lag_s=drive.lag_s,
        current_limit_A=min(sheet.current_limit_A, drive.current_limit_A),
    )


# Step of fourth-order differences: with a tenth of it slopes differ by 3e-10 of the largest, with ten times
# it by 6e-7, as the steps then extend over knots of the spline of the curve.
DIFFERENCE_rad = 1e-4


class Actuation(NamedTuple):
    """Torque of the coils on the hinges about a pose at which currents of n groups hold the rotor."""

    of_currents: Array
    """(3, n) N·m/A: torque per ampere."""
    of_commands: Array
    """(3, 3): torque per commanded N·m; the unit matrix if the nominal magnetics are true."""
    holding_torque_Nm: Array
    """(3,): commanded torque that holds the rotor."""
    holding_current_A: Array
    """(n,): currents of that command."""
    stiffness_of_currents: Array
    """(3, 3) N·m/rad: derivative of the torque by the pose with constant currents."""
    stiffness_of_commands: Array
    """(3, 3) N·m/rad: derivative of the torque by the pose with a constant command."""


def actuation(data: LinearisationData, q: Array, holding_Nm: Array) -> Actuation:
    """Return the actuation about a pose.

    Parameters
    ----------
    data : LinearisationData
    q : (3,) array, rad
        Pose.
    holding_Nm : (3,) array, N·m
        Torque of the coils on the hinges that holds the rotor.
    """
    matrix, matrix_slopes = hinge_matrix(q, data.magnetics), slopes(q, data.magnetics)
    nominal_matrix = hinge_matrix(q, data.nominal_magnetics)
    inverse = np.asarray(np.linalg.pinv(nominal_matrix), np.float64)
    differs = not _same(data.magnetics, data.nominal_magnetics)
    of_commands = matrix @ inverse if differs else np.eye(3)
    command = np.asarray(np.linalg.solve(of_commands, holding_Nm), np.float64)
    current = inverse @ command
    stiffness = np.column_stack([slope @ current for slope in matrix_slopes])
    command_stiffness = np.zeros((3, 3))
    if differs:
        current_slopes = [
            _inverse_slope(nominal_matrix, inverse, slope) @ command
            for slope in slopes(q, data.nominal_magnetics)
        ]  # (n,) each, A/rad
        command_stiffness = stiffness + matrix @ np.column_stack(current_slopes)
    return Actuation(matrix, of_commands, command, current, stiffness, command_stiffness)


def hinge_matrix(q: Array, magnetics: Magnetics) -> Array:
    """Return the torque on the hinges per ampere of each group, ``E^T G_t(q)`` times gain; (3, n), N·m/A.

    It uses the torque curve itself: the table of the compiled torque matrix agrees with it within 2e-7 of its
    peak, but its slopes are not accurate.
    """
    matrix = summed_torque_matrix(q, magnetics.actuator, magnetics.scatter)
    return rate_jacobian(q).T @ matrix * magnetics.gain


def slopes(q: Array, magnetics: Magnetics) -> Array:
    """Return the derivatives of `hinge_matrix` by the angles; (3, 3, n), the first index is the angle."""

    def moved(angle: int, steps: int) -> Array:
        return hinge_matrix(q + steps * DIFFERENCE_rad * np.eye(3)[angle], magnetics)

    return np.array(
        [
            (8 * (moved(i, 1) - moved(i, -1)) - (moved(i, 2) - moved(i, -2))) / (12 * DIFFERENCE_rad)
            for i in range(3)
        ]
    )


def _inverse_slope(matrix: Array, inverse: Array, slope: Array) -> Array:
    """Return the derivative of the least-norm inverse of a matrix with independent rows."""
    across = np.eye(matrix.shape[1]) - inverse @ matrix
    return -inverse @ slope @ inverse + across @ slope.T @ inverse.T @ inverse


def _same(first: Magnetics, second: Magnetics) -> bool:
    scattered = first.scatter or second.scatter
    return first.actuator is second.actuator and not scattered and bool(np.all(first.gain == second.gain))


Inputs = Literal["torque", "currents"]
Kind = Literal["scipy", "control"]


@dataclass(frozen=True, eq=False)
class LinearModel:
    """Linear model about a pose at rest: ``x' = A x + B u, y = C x``, with deviations from this pose.

    Attributes
    ----------
    system : scipy.signal.StateSpace or control.StateSpace
        Continuous.
    pose_rad : (3,) array, rad
        Pose at rest.
    input_at_rest : (m,) array, N·m or A
        Input that holds the pose; inputs of the system are deviations from it.
    states, inputs, outputs : tuple of str
        Names, each with its unit at the end.
    """

    system: Any
    pose_rad: Array
    input_at_rest: Array
    states: tuple[str, ...]
    inputs: tuple[str, ...]
    outputs: tuple[str, ...]


def linearise(
    scenario: Scenario | str | Path,
    pose_rad: ArrayLike | None = None,
    changes: Mapping[str, Any] | None = None,
    *,
    inputs: Inputs = "torque",
    lag: bool = False,
    nominal: bool = False,
    kind: Kind = "scipy",
) -> LinearModel:
    """Return the linear model of the actuator of a scenario about a pose at rest.

    Parameters
    ----------
    scenario : Scenario or str or Path
        From `scenario.load` or built in Python; the name of a shipped scenario or the path of a TOML file.
    pose_rad : (3,) array, rad, optional
        Pose at rest; default: the first pose of the scenario.
    changes : mapping, optional
        Values by dotted name, such as ``{"plant.payload_kg": 0.1}``.
    inputs : {"torque", "currents"}
        Inputs of the model: the generalised torque that a law commands (N·m), through the allocation and the
        coils, or the currents of the groups (A).
    lag : bool
        If true, the lag of the currents, if the drive has one, adds states: the torque of the coils, or their
        currents.
    nominal : bool
        If true, the nominal model of the controller instead of the true one: nominal inertia, magnetics,
        friction, lag and current limit; no payload or gravity.
    kind : {"scipy", "control"}
        Library of the class of the system; python-control is only imported for its own class.

    Returns
    -------
    LinearModel
        States: the angles (rad), their rates (rad/s), and the states of the lag. Outputs: the angles.

    Raises
    ------
    InputError
        A pose beyond the workspace (where the joint locks), or one that the coils cannot hold within the
        current limit; a model that the Lagrangian does not support; a missing library.

    Notes
    -----
    Effects without a linear part at rest are omitted: Coulomb and static friction, hysteresis, limits of
    current and voltage. Delays and sampling, which belong to the discretisation, and disturbances, sensors
    and faults are also omitted. Mass, gravity, cable and friction are differentiated in closed form, the
    torque of currents by differences.
    """
    _check_choice("inputs", inputs, ("torque", "currents"))
    _check_choice("kind", kind, ("scipy", "control"))
    # Before the computation, so that a missing library is reported at once.
    library = python_control() if kind == "control" else importlib.import_module("scipy.signal")
    config = initial_config(scenario_of(scenario, changes), None, None)
    actuator = config.files.actuator
    pose = _pose(config.scenario.plant.initial_rad if pose_rad is None else pose_rad, actuator)
    data = linearisation_data(config.scenario, config.files, nominal=nominal)
    coils, lag_s = _holding_actuation(data, pose), data.lag_s if lag else 0.0
    if inputs == "torque":
        if isinstance(lag_s, tuple):
            raise InputError(
                'linear model: expected one lag of all groups for the torque as input, or inputs="currents",'
                f" received lags of {min(lag_s):g} to {max(lag_s):g} s"
            )
        at_rest, (A, B) = coils.holding_torque_Nm, _driven_by_torque(data, coils, pose, lag_s)
        quantity, unit, channels = "torque", "Nm", tuple(HINGES)
    else:
        at_rest, (A, B) = coils.holding_current_A, _driven_by_currents(data, coils, pose, lag_s)
        quantity, unit, channels = "current", "A", tuple(f"{j:02}" for j in range(len(actuator.groups)))
    lagging = tuple(f"{quantity}_{channel}_{unit}" for channel in channels) if lag_s else ()
    angles, rates = (tuple(f"{hinge}_{end}" for hinge in HINGES) for end in ("rad", "rad_s"))
    names = {
        "states": angles + rates + lagging,
        "inputs": tuple(f"{quantity}_command_{channel}_{unit}" for channel in channels),
        "outputs": angles,
    }
    matrices = A, B, np.eye(3, len(A)), np.zeros((3, B.shape[1]))
    system = library.StateSpace(*matrices, **(names if kind == "control" else {}))
    return LinearModel(system, pose, at_rest, **names)


def _driven_by_torque(
    data: LinearisationData, coils: Actuation, q: Array, lag_s: float
) -> tuple[Array, Array]:
    """Return the matrices A and B for a commanded torque.

    With a lag the torque is a state: ``T' = (W u + turning q - T) / lag + stiffness qdot``. It follows the
    command with the lag, and changes at once when the rotor turns under constant currents.
    """
    if not lag_s:
        A, per_torque = _rotor_matrices(data, q, coils.stiffness_of_commands)
        return A, np.vstack([np.zeros((3, 3)), per_torque @ coils.of_commands])
    A, per_torque = _rotor_matrices(data, q, np.zeros((3, 3)))
    follows = np.hstack([coils.stiffness_of_commands / lag_s, coils.stiffness_of_currents])
    commanded = np.vstack([np.zeros((6, 3)), coils.of_commands / lag_s])
    return _behind_lag(A, per_torque, follows, lag_s), commanded


def _driven_by_currents(
    data: LinearisationData, coils: Actuation, q: Array, lag_s: PerGroup
) -> tuple[Array, Array]:
    """Return the matrices A and B for commanded currents; with a lag the currents are states."""
    A, per_torque = _rotor_matrices(data, q, coils.stiffness_of_currents)
    groups = coils.of_currents.shape[1]
    per_ampere = per_torque @ coils.of_currents
    if not lag_s:
        return A, np.vstack([np.zeros((3, groups)), per_ampere])
    commanded = np.vstack([np.zeros((6, groups)), np.eye(groups) / of_each_group(lag_s, groups)])
    return _behind_lag(A, per_ampere, np.zeros((groups, 6)), lag_s), commanded


def _rotor_matrices(data: LinearisationData, q: Array, pull: Array) -> tuple[Array, Array]:
    """Return the matrix A of angles and rates, and the accelerations per N·m, the inverse of M.

    Rates are 0 at rest, and so are the first-order terms of the Coriolis torques, which are quadratic in
    them. The derivative of M is multiplied by accelerations that are 0.
    """
    per_torque: Array = np.linalg.inv(inertia_matrix(q, data.inertia)).astype(np.float64)
    stiffness = gravity_stiffness(q, data.weight_moment) + np.diag(data.spring_Nm_rad) - pull
    A = np.zeros((6, 6))
    A[:3, 3:] = np.eye(3)
    A[3:, :3], A[3:, 3:] = -per_torque @ stiffness, -per_torque * data.viscous_Nm_s
    return A, per_torque


def _behind_lag(A: Array, per_input: Array, follows: Array, lag_s: PerGroup) -> Array:
    """Return the matrix A of a rotor whose inputs are states with a lag that follow the motion."""
    lagging = len(follows)
    pushed = np.vstack([np.zeros((3, lagging)), per_input])
    return np.block([[A, pushed], [follows, -np.eye(lagging) / of_each_group(lag_s, lagging)]])


def _holding_actuation(data: LinearisationData, pose: Array) -> Actuation:
    """Return the actuation about a pose at which the coils balance gravity, cable and unmodelled torque."""
    try:
        load = gravity_torque(pose, data.weight_moment) + data.spring_Nm_rad * pose
        coils = actuation(data, pose, load + data.unmodelled_torque_Nm)
    except np.linalg.LinAlgError:
        raise InputError(
            "linear model: expected coils that give torque, received coils without torque"
        ) from None
    current_A = float(np.abs(coils.holding_current_A).max())
    if current_A > data.current_limit_A:
        most, received = distinct_texts(data.current_limit_A, current_A)
        raise InputError(
            f"linear model: expected a pose that the coils hold within {most} A,"
            f" received one that needs {received} A"
        )
    return coils


def _check_choice(name: str, received: str, valid: tuple[str, ...]) -> None:
    if received not in valid:
        raise InputError(
            f"linear model: expected {name} as one of {', '.join(valid)}, received {shown(received)}"
        )


def python_control() -> Any:
    """Return the package control; raise `InputError` if it is not installed."""
    try:
        library: Any = importlib.import_module("control")
    except ImportError:
        library = None
    if not hasattr(library, "StateSpace"):  # it may be a folder of that name in the working folder
        raise extras.missing("linear model", "python-control", "control", "for kind control")
    return library


def _pose(given: Any, actuator: Actuator) -> Array:
    try:
        pose = np.array(given, dtype=np.float64)
    except (TypeError, ValueError):
        pose = np.empty(0)
    if pose.shape != (3,) or not np.all(np.isfinite(pose)):
        raise InputError(f"linear model: expected a pose of three finite angles, received {shown(given)}")
    # No model of an actuator has a range of beta up to +-90 degrees, where the joint locks.
    check_pose(pose, actuator, "linear model")
    return pose
