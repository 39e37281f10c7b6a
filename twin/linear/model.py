"""A scenario's actuator about a pose at rest as a linear system, for the design of a controller."""

from __future__ import annotations

import importlib
from dataclasses import dataclass
from typing import Any, Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray

from spheretwin.models.actuator import Actuator
from spheretwin.models.base.errors import InputError
from spheretwin.models.base.wording import shown, told_apart
from spheretwin.models.lagrangian import gravity_stiffness, gravity_torque, inertia_matrix
from spheretwin.models.model_file.joint import HINGES
from spheretwin.twin.in_force import at_start
from spheretwin.twin.linear.actuation import Actuation, actuation
from spheretwin.twin.linear.knowledge import Knowledge, knowledge
from spheretwin.twin.scenario.sections import Scenario

Array = NDArray[np.float64]
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
    in_force = at_start(scenario, None, None)
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
        A, per_torque = _rotor(known, q, coils.stiffness_of_commands)
        return A, np.vstack([np.zeros((3, 3)), per_torque @ coils.of_commands])
    A, per_torque = _rotor(known, q, np.zeros((3, 3)))
    follows = np.hstack([coils.stiffness_of_commands / lag_s, coils.stiffness_of_currents])
    commanded = np.vstack([np.zeros((6, 3)), coils.of_commands / lag_s])
    return _behind_lag(A, per_torque, follows, lag_s), commanded


def _driven_by_currents(known: Knowledge, coils: Actuation, q: Array, lag_s: float) -> tuple[Array, Array]:
    """Matrices A and B where currents are asked for; with a lag they are states."""
    A, per_torque = _rotor(known, q, coils.stiffness_of_currents)
    groups = coils.of_currents.shape[1]
    per_ampere = per_torque @ coils.of_currents
    if not lag_s:
        return A, np.vstack([np.zeros((3, groups)), per_ampere])
    commanded = np.vstack([np.zeros((6, groups)), np.eye(groups) / lag_s])
    return _behind_lag(A, per_ampere, np.zeros((groups, 6)), lag_s), commanded


def _rotor(known: Knowledge, q: Array, pull: Array) -> tuple[Array, Array]:
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
