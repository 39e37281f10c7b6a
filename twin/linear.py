"""Currents to torque on the hinges about a pose, and torques asked for to currents."""

from __future__ import annotations

import importlib
from dataclasses import dataclass
from typing import Any, Literal, NamedTuple, cast

import numpy as np
from numpy.typing import ArrayLike, NDArray

from spheretwin import assembly
from spheretwin.active_config import initial_config
from spheretwin.models.actuator import Actuator
from spheretwin.models.base.errors import InputError, shown, told_apart
from spheretwin.models.kinematics import rate_jacobian, rotation
from spheretwin.models.lagrangian import gravity_stiffness, gravity_torque, inertia_matrix
from spheretwin.models.mjcf_reader import HINGES
from spheretwin.plant.lagrangian_rotor import LagrangianRotor
from spheretwin.scenario.files import Files
from spheretwin.scenario.sections import ResolvedScenario, Scenario


class Magnetics(NamedTuple):
    """A torque matrix: that of an actuator, each column times a gain."""

    actuator: Actuator
    gain: Array  # (n,)


class Knowledge(NamedTuple):
    """The numbers of a resolved scenario that a linear model depends on."""

    inertia: Array
    """Principal inertias about the joint centre, (3,) in kg·m²; payload included."""
    weight_moment: float
    """m g l of the payload, N·m."""
    viscous_Nm_s: Array
    """Of each hinge, (3,)."""
    unknown_torque_Nm: Array
    """Constant, (3,): it pulls against the coils."""
    magnetics: Magnetics
    """What makes torque of currents."""
    believed: Magnetics
    """What the allocation makes currents of torque by."""
    lag_s: float
    """Time constant of the currents."""
    current_limit_A: float
    """Of the allocation; that of the drive where it is the lower of the two and the model is the true one."""


def knowledge(scenario: ResolvedScenario, files: Files, *, nominal: bool) -> Knowledge:
    """Numbers of a resolved scenario, true or nominal.

    Raises
    ------
    InputError
        The Lagrangian does not know all that the model holds.
    """
    known, section, drive = scenario.nominal, scenario.plant, scenario.drive
    groups = len(files.actuator.groups)
    believed = Magnetics(files.nominal, np.full(groups, known.torque_scale))
    if nominal:
        return Knowledge(
            inertia=np.array(known.inertia_kg_m2),
            weight_moment=0.0,
            viscous_Nm_s=np.array(known.viscous_Nm_s),
            unknown_torque_Nm=np.zeros(3),
            magnetics=believed,
            believed=believed,
            lag_s=known.time_constant_s,
            current_limit_A=known.current_limit_A,
        )
    rotor = _lagrangian_rotor(scenario, files)
    return Knowledge(
        inertia=rotor.inertia,
        weight_moment=rotor.weight_moment,
        viscous_Nm_s=np.array(section.viscous_Nm_s),
        unknown_torque_Nm=np.array(section.modelling_torque_Nm),
        magnetics=Magnetics(files.actuator, np.array(section.group_gain)),
        believed=believed,
        lag_s=drive.lag_s,
        current_limit_A=min(known.current_limit_A, drive.current_limit_A),
    )


def _lagrangian_rotor(scenario: ResolvedScenario, files: Files) -> LagrangianRotor:
    """Rotor whose equations of motion are known in closed form, whichever engine is to move it."""
    section = scenario.plant.model_copy(update={"engine": "lagrangian", "integrator": "RK4"})
    return cast("LagrangianRotor", assembly.rotor_of(scenario.model_copy(update={"plant": section}), files))


Array = NDArray[np.float64]

# Of fourth-order differences: with a tenth of it slopes differ by 3e-10 of the largest, with ten times it by
# 6e-7, as the steps then reach over knots of the curve's spline.
DIFFERENCE_rad = 1e-4


class Actuation(NamedTuple):
    """Torque of the coils on the hinges about a pose, where currents of n groups hold the rotor."""

    of_currents: Array
    """(3, n) N·m/A: the torque of one ampere."""
    of_commands: Array
    """(3, 3): the torque that one N·m asked for leads to; the unit matrix where nothing is mistaken."""
    holding_torque_Nm: Array
    """(3,): the command that holds the rotor."""
    holding_current_A: Array
    """(n,): the currents that answer it."""
    stiffness_of_currents: Array
    """(3, 3) N·m/rad: how their torque changes with the pose while they stay the same."""
    stiffness_of_commands: Array
    """(3, 3) N·m/rad: how it does while the command stays and the allocation follows the pose."""


def actuation(known: Knowledge, q: Array, held_Nm: Array) -> Actuation:
    """Actuation about a pose.

    Parameters
    ----------
    known : Knowledge
    q : (3,) array, rad
        Pose.
    held_Nm : (3,) array, N·m
        Torque on the hinges that the coils hold there.
    """
    own, own_slopes = hinge_matrix(q, known.magnetics), slopes(q, known.magnetics)
    believed = hinge_matrix(q, known.believed)
    inverse = np.asarray(np.linalg.pinv(believed), np.float64)
    mistaken = not _same(known.magnetics, known.believed)
    of_commands = own @ inverse if mistaken else np.eye(3)
    command = np.asarray(np.linalg.solve(of_commands, held_Nm), np.float64)
    current = inverse @ command
    stiffness = np.column_stack([each @ current for each in own_slopes])
    turning = np.zeros((3, 3))
    if mistaken:
        follows = [
            _inverse_slope(believed, inverse, each) @ command for each in slopes(q, known.believed)
        ]  # (n,) each, A/rad
        turning = stiffness + own @ np.column_stack(follows)
    return Actuation(own, of_commands, command, current, stiffness, turning)


def hinge_matrix(q: Array, magnetics: Magnetics) -> Array:
    """Torque on the hinges of one ampere in each group, ``E^T G_t(q)`` times the gains; (3, n) in N·m/A.

    From the torque curve itself: the table of the compiled torque matrix meets it within 2e-7 of its peak,
    but has no slopes of use.
    """
    actuator = magnetics.actuator
    return rate_jacobian(q).T @ _torque_matrix(q, actuator) * magnetics.gain


def slopes(q: Array, magnetics: Magnetics) -> Array:
    """Derivatives of `hinge_matrix` by the three angles; (3, 3, n), the first index the angle."""

    def moved(angle: int, steps: int) -> Array:
        return hinge_matrix(q + steps * DIFFERENCE_rad * np.eye(3)[angle], magnetics)

    return np.array(
        [
            (8 * (moved(i, 1) - moved(i, -1)) - (moved(i, 2) - moved(i, -2))) / (12 * DIFFERENCE_rad)
            for i in range(3)
        ]
    )


def _torque_matrix(q: Array, actuator: Actuator) -> Array:
    """G_t(q) (15) as a sum over every pole and the two coils of every group."""
    poles, axes = actuator.pole_axes @ rotation(q).T, actuator.group_axes  # (p, 3), (n, 3)
    cosine = poles @ axes.T
    curve = actuator.torque_curve
    pull = curve.over_sine(cosine) - curve.over_sine(-cosine)  # of both coils, along r x s
    crossed = np.cross(poles[:, None], axes[None])  # (p, n, 3)
    return np.einsum("p,pn,pnk->kn", actuator.pole_polarity, pull, crossed)


def _inverse_slope(matrix: Array, inverse: Array, slope: Array) -> Array:
    """Derivative of the least-norm inverse of a matrix whose rows are independent."""
    across = np.eye(matrix.shape[1]) - inverse @ matrix
    return -inverse @ slope @ inverse + across @ slope.T @ inverse.T @ inverse


def _same(first: Magnetics, second: Magnetics) -> bool:
    return first.actuator is second.actuator and bool(np.all(first.gain == second.gain))


Inputs = Literal["torque", "currents"]
Kind = Literal["scipy", "control"]


@dataclass(frozen=True, eq=False)
class LinearModel:
    """The actuator about a pose at rest: ``x' = A x + B u, y = C x``, each as what it differs by from there.

    Attributes
    ----------
    system : scipy.signal.StateSpace or control.StateSpace
        Continuous.
    pose_rad : (3,) array, rad
        Where it rests.
    input_at_rest : (m,) array, N·m or A
        What holds it there, beside which an input of the system comes.
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
    scenario: Scenario,
    pose_rad: ArrayLike | None = None,
    *,
    inputs: Inputs = "torque",
    lag: bool = False,
    nominal: bool = False,
    kind: Kind = "scipy",
) -> LinearModel:
    """Linear model of a scenario's actuator about a pose at rest.

    Parameters
    ----------
    scenario : Scenario
        From `scenario.load`, or built in Python.
    pose_rad : (3,) array, rad, optional
        Where the rotor rests; the scenario's first pose unless given.
    inputs : {"torque", "currents"}
        What the model is driven by: the generalised torque that a law asks for (N·m), through the allocation
        and the coils, or the currents of the groups (A).
    lag : bool
        Whether the lag of the currents, where the drive has one, adds states: the torque of the coils, or
        their currents.
    nominal : bool
        The model as the controller has it, not the true one: nominal inertia, magnetics, friction, lag
        and current limit; no payload or gravity.
    kind : {"scipy", "control"}
        Whose class the system is of; python-control is imported for its own alone.

    Returns
    -------
    LinearModel
        States: the angles (rad), their rates (rad/s), and what the lag adds. Outputs: the angles.

    Raises
    ------
    InputError
        A pose beyond the workspace (and so where the joint locks), or one that the coils cannot hold within
        the current limit; a model that holds what the Lagrangian does not know; a library that is not there.

    Notes
    -----
    What has no linear part at rest is left out: Coulomb friction, limits of current and voltage. So are
    delays and sampling, which belong to the discretisation, and disturbances, sensors and faults. Mass,
    gravity and friction are differentiated in closed form, the torque of currents by differences.
    """
    _check_choice("inputs", inputs, ("torque", "currents"))
    _check_choice("kind", kind, ("scipy", "control"))
    # Before the work, so that a library that is missing is told at once.
    library = _python_control() if kind == "control" else importlib.import_module("scipy.signal")
    in_force = initial_config(scenario, None, None)
    actuator = in_force.files.actuator
    pose = _pose(in_force.scenario.plant.initial_rad if pose_rad is None else pose_rad, actuator)
    known = knowledge(in_force.scenario, in_force.files, nominal=nominal)
    coils, lag_s = _held(known, pose), known.lag_s if lag else 0.0
    if inputs == "torque":
        at_rest, (A, B) = coils.holding_torque_Nm, _driven_by_torque(known, coils, pose, lag_s)
        what, unit, channels = "torque", "Nm", tuple(HINGES)
    else:
        at_rest, (A, B) = coils.holding_current_A, _driven_by_currents(known, coils, pose, lag_s)
        what, unit, channels = "current", "A", tuple(f"{j:02}" for j in range(len(actuator.groups)))
    lagging = tuple(f"{what}_{channel}_{unit}" for channel in channels) if lag_s else ()
    angles, rates = (tuple(f"{hinge}_{end}" for hinge in HINGES) for end in ("rad", "rad_s"))
    names = {
        "states": angles + rates + lagging,
        "inputs": tuple(f"{what}_command_{channel}_{unit}" for channel in channels),
        "outputs": angles,
    }
    matrices = A, B, np.eye(3, len(A)), np.zeros((3, B.shape[1]))
    system = library.StateSpace(*matrices, **(names if kind == "control" else {}))
    return LinearModel(system, pose, at_rest, **names)


def _driven_by_torque(known: Knowledge, coils: Actuation, q: Array, lag_s: float) -> tuple[Array, Array]:
    """Matrices A and B where a torque is asked for.

    With a lag the torque itself is a state: ``T' = (W u + turning q - T) / lag + stiffness qdot``, for it
    follows what is asked for late, and changes at once where the rotor turns under the same currents.
    """
    if not lag_s:
        A, per_torque = _rotor_matrices(known, q, coils.stiffness_of_commands)
        return A, np.vstack([np.zeros((3, 3)), per_torque @ coils.of_commands])
    A, per_torque = _rotor_matrices(known, q, np.zeros((3, 3)))
    follows = np.hstack([coils.stiffness_of_commands / lag_s, coils.stiffness_of_currents])
    commanded = np.vstack([np.zeros((6, 3)), coils.of_commands / lag_s])
    return _behind_lag(A, per_torque, follows, lag_s), commanded


def _driven_by_currents(known: Knowledge, coils: Actuation, q: Array, lag_s: float) -> tuple[Array, Array]:
    """Matrices A and B where currents are asked for; with a lag they are states."""
    A, per_torque = _rotor_matrices(known, q, coils.stiffness_of_currents)
    groups = coils.of_currents.shape[1]
    per_ampere = per_torque @ coils.of_currents
    if not lag_s:
        return A, np.vstack([np.zeros((3, groups)), per_ampere])
    commanded = np.vstack([np.zeros((6, groups)), np.eye(groups) / lag_s])
    return _behind_lag(A, per_ampere, np.zeros((groups, 6)), lag_s), commanded


def _rotor_matrices(known: Knowledge, q: Array, pull: Array) -> tuple[Array, Array]:
    """Matrix A of angles and rates, and the accelerations of one N·m, the inverse of M.

    Rates are 0 at rest, and so is all that Coriolis torques, quadratic in them, have of first order; the
    derivative of M meets accelerations that are 0.
    """
    per_torque = np.linalg.inv(inertia_matrix(q, known.inertia))
    stiffness = gravity_stiffness(q, known.weight_moment) - pull
    A = np.zeros((6, 6))
    A[:3, 3:] = np.eye(3)
    A[3:, :3], A[3:, 3:] = -per_torque @ stiffness, -per_torque * known.viscous_Nm_s
    return A, per_torque


def _behind_lag(A: Array, per_input: Array, follows: Array, lag_s: float) -> Array:
    """Matrix A of a rotor whose inputs are states that decay with a lag and follow the motion."""
    lagging = len(follows)
    pushed = np.vstack([np.zeros((3, lagging)), per_input])
    return np.block([[A, pushed], [follows, -np.eye(lagging) / lag_s]])


def _held(known: Knowledge, pose: Array) -> Actuation:
    """Actuation about a pose where the coils hold what pulls at the rotor."""
    try:
        coils = actuation(known, pose, gravity_torque(pose, known.weight_moment) + known.unknown_torque_Nm)
    except np.linalg.LinAlgError:
        raise InputError(
            "linear model: expected coils that give torque, received some that give none"
        ) from None
    current_A = float(np.abs(coils.holding_current_A).max())
    if current_A > known.current_limit_A:
        most, received = told_apart(known.current_limit_A, current_A)
        raise InputError(
            f"linear model: expected a pose that the coils hold within {most} A,"
            f" received one that takes {received} A"
        )
    return coils


def _check_choice(name: str, received: str, valid: tuple[str, ...]) -> None:
    if received not in valid:
        raise InputError(
            f"linear model: expected {name} as one of {', '.join(valid)}, received {shown(received)}"
        )


def _python_control() -> Any:
    try:
        library: Any = importlib.import_module("control")
    except ImportError:
        library = None
    if not hasattr(library, "StateSpace"):  # also a folder of that name, where Python was started
        raise InputError(
            "linear model: expected python-control to be there for kind control, received none;"
            " pip install control"
        )
    return library


def _pose(given: Any, actuator: Actuator) -> Array:
    try:
        pose = np.array(given, dtype=np.float64)
    except (TypeError, ValueError):
        pose = np.empty(0)
    if pose.shape != (3,) or not np.all(np.isfinite(pose)):
        raise InputError(f"linear model: expected a pose of three finite angles, received {shown(given)}")
    # A model whose beta reaches +-90 degrees, where the joint locks, is none of an actuator.
    for hinge, angle, (low, high) in zip(HINGES, pose, actuator.hinge_range_rad, strict=True):
        if not low <= angle <= high:
            least, most, received = told_apart(low, high, angle)
            raise InputError(
                f"linear model: expected a pose with {hinge} from {least} to {most} rad, received {received}"
            )
    return pose
