"""One control tick: from the measurement to the commanded currents, by the nominal model alone."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np
from numba import types

from spheretwin.control import allocation as allocations
from spheretwin.control import law as laws
from spheretwin.control.allocation.bounded import SCRATCH_ROWS
from spheretwin.control.applied_torque import AppliedTorque, estimate_applied_torque
from spheretwin.control.compensators import Compensators, apply_compensators
from spheretwin.control.compensators.prediction import MEASURED
from spheretwin.control.estimators.estimator import Estimator, call_estimator
from spheretwin.control.manual_currents import Manual, command_manual_currents
from spheretwin.control.supervision.enabled_groups import EnabledGroups, mask_disabled_groups
from spheretwin.control.supervision.fault_detector import Detector, detect_faults
from spheretwin.control.supervision.watchdog import GO, Reason, Watchdog, trip, watch
from spheretwin.models.base.addresses import caller_of
from spheretwin.models.base.arrays import Array
from spheretwin.models.base.columns import MixedRowsError, column_of
from spheretwin.models.base.compiled import allocation_free, part_of_its_caller
from spheretwin.models.base.record import Record, Rows, field, put
from spheretwin.models.kinematics import cartesian_torque, generalised_torque
from spheretwin.models.magnetics import Arrangement, CachedMatrix, Tables, TorqueModel, update_cached_matrix
from spheretwin.models.telemetry.signals import width

# A diverging law may command any torque; beyond this the products of the allocation would overflow.
LARGEST_TORQUE_Nm = 1e100

NO_TORQUE = -1.0
"""Share that is returned if the law gave no torque."""

_COMMAND = int(Reason.COMMAND)

call_law = caller_of(laws.SIGNATURE)
call_python_law = caller_of(types.void(types.float64))
call_allocation = caller_of(allocations.SIGNATURE)


class Supervision(Record):
    """Fault detection and watchdog."""

    groups: EnabledGroups = field("groups that the allocation may use")
    detector: Detector = field("detector of open and shorted groups")
    watchdog: Watchdog = field("check of measurements and commands")


class ControllerData(Record):
    """Data of a controller, except those of its law and its estimator; it has no access to the plant."""

    arrangement: Arrangement = field("nominal poles and coil groups")
    reference: Array = field("desired angle, rate, acceleration as rows; the law may write", "", (3, 3))
    measurement: Array = field("angle, rate, torque as rows; those of `predict`", "", (2 * MEASURED, 3))
    estimator_on: bool = field("whether rates are estimated; otherwise the law receives the measured rates")
    pose: Array = field("pose that the law receives", "rad", 3)
    rates: Array = field("rates that the law receives", "rad/s", 3)
    fresh: Array = field("1 for a new measurement of an angle, 0 for a repeated one", "", 3)
    matrix: CachedMatrix = field("nominal torque matrix at that pose")
    applied_torque: AppliedTorque = field("estimate of the torque of the law's commands")
    compensators: Compensators = field("governor, prediction and feed-forward")
    supervision: Supervision = field("detector and watchdog")
    manual: Manual = field("currents instead of those of the law")
    python_law: int = field("address of a function of the time that calls a law in plain Python; 0: none")
    cartesian: bool = field("whether the law writes the torque of the stator frame")
    logged: int = field("leading numbers of the law's memory that are logged")
    torque_q: Array = field("torque commanded by the law in this tick", "N·m", 3)
    torque_S: Array = field("the same in the stator frame", "N·m", 3)
    current_limit_A: float = field("largest current that is commanded", "A")
    scratch: Array = field("working space of the allocation", "", (SCRATCH_ROWS, "groups"))
    authority: float = field("share of the commands that is sent: 1, or less in a soft start")


class Controller(NamedTuple):
    """Controller of a run: data, law and estimator with their own sizes, and the nominal torque.

    That of many runs has arrays with a further first index, of the run.
    """

    data: Any  # `ControllerData`
    parameters: Array  # of the law
    memory: Array  # state of the law
    estimator_parameters: Array
    estimator_memory: Array
    tables: Tables


@part_of_its_caller
def controller_of(controllers: Controller, run: int) -> Controller:
    """Return the controller of one of many runs, which shares its numbers."""
    return Controller(
        controllers.data[run],
        controllers.parameters[run],
        controllers.memory[run],
        controllers.estimator_parameters[run],
        controllers.estimator_memory[run],
        controllers.tables,
    )


def controller(
    rows: Rows,
    law: laws.Law | list[laws.Law],
    estimator: Estimator | Sequence[Estimator | None] | None,
    magnetics: TorqueModel,
    current_limit_A: Any,
) -> Controller:
    """Return controllers without compensators and supervision.

    Parameters
    ----------
    rows : array of ControllerData
        In which all numbers are 0; filled.
    law : Law, or list with one for each row
        Parameters and state are copied: a law may change both.
    estimator : Estimator, or list with one for each row, or None
        Estimator of the rates; None if the law receives the measured rates.
    magnetics : TorqueModel
        Nominal.
    current_limit_A : float, or one for each row, A
        Largest group current that the controller commands, unless that of the law is less.

    Raises
    ------
    MixedRowsError
        The laws, or the estimators, have other functions or sizes in some rows than in others.
    """
    members = law if isinstance(law, list) else [law] * len(rows)
    estimators = estimator if isinstance(estimator, list) else [estimator] * len(rows)
    limit_A = np.minimum(current_limit_A, column_of([member.current_limit_A for member in members]))
    rows["logged"], rows["estimator_on"] = width(members[0].signals), estimators[0] is not None
    rows["arrangement"], rows["matrix"]["q"], rows["authority"] = magnetics.arrangement, np.nan, 1.0
    put(rows, current_limit_A=limit_A, cartesian=column_of([member.cartesian for member in members]))
    numbers = *_numbers("law", members), *_numbers("estimator", estimators)
    return Controller(rows, *numbers, magnetics.tables)


def _numbers(part: str, members: list[Any]) -> tuple[Array, Array]:
    """Return parameters and state of the laws, or of the estimators, of all rows; none of None."""
    if not any(members):
        return np.zeros((len(members), 0)), np.zeros((len(members), 0))
    kinds = [member and (member.step, len(member.parameters), len(member.state)) for member in members]
    if any(kind != kinds[0] for kind in kinds):
        raise MixedRowsError(f"expected one kind of {part} in all rows, received others")
    return np.array([member.parameters for member in members]), np.array([member.state for member in members])


@allocation_free
def control_tick(
    controller: Controller,
    law: Any,
    allocate: Any,
    estimate: Any,
    t: float,
    reference: Array,
    measurement: Array,
    command: Array,
) -> float:
    """Run the law, map its generalised torque to a Cartesian one unless it gives that, and allocate currents.

    The map is taken at the pose that the law receives, the allocation uses the nominal torque matrix.

    Parameters
    ----------
    controller : Controller
        Changed in place.
    law, allocate : address or callable
        Of `control.law.SIGNATURE` and `control.allocation.SIGNATURE`: addresses in compiled code.
    estimate : address or callable
        Of `control.estimators.estimator.SIGNATURE`; any value if nothing is estimated.
    t : float, s
        Time of the tick.
    reference : (3, 3) array
        Desired angle, rate and acceleration as rows; the law may write into it.
    measurement : (3, 3) or (6, 3) array
        Measured angle (rad) and rate (rad/s); the other rows are filled in. It has six rows if the
        prediction is on. The law may write into it.
    command : (n,) array, A
        Result: commanded group currents.

    Returns
    -------
    float
        Share of the law's torque that `command` gives, or the least share of a manual current. `NO_TORQUE` if
        the law gave no torque, or one beyond `LARGEST_TORQUE_Nm`, or logs a value that is not finite, and the
        watchdog is off. If the watchdog is on, it trips instead: the currents are 0 and the share is 1.
    """
    data = controller.data
    watchdog, pose = data.supervision.watchdog, data.pose
    if data.estimator_on:
        call_estimator(
            estimate,
            measurement[0],
            controller.estimator_parameters,
            controller.estimator_memory,
            measurement[1],
        )
    for i in range(3):
        pose[i], data.rates[i] = measurement[0, i], measurement[1, i]
    if watchdog.on:
        watch(watchdog, data.fresh, pose, data.rates)
    update_cached_matrix(pose, data.arrangement, controller.tables, data.matrix)
    if data.supervision.detector.on and watchdog.halt == GO:
        current, detector = data.applied_torque.current, data.supervision.detector
        detect_faults(detector, data.supervision.groups, current, data.matrix.G, pose, data.rates, t)
    law_active = watchdog.halt == GO and not data.manual.on
    if law_active and not _call_law(controller, law, t, reference, measurement):
        if not watchdog.on:
            return NO_TORQUE
        trip(watchdog, _COMMAND)
    share = 1.0
    if law_active and watchdog.halt == GO:
        share = _allocate(data, allocate, command)
    else:
        _command_zero(data, controller.memory, command)
        if watchdog.halt == GO:
            share = command_manual_currents(data.manual, data.current_limit_A, command)
    if data.authority != 1.0:
        for j in range(command.shape[0]):
            command[j] *= data.authority
    if data.applied_torque.on:
        estimate_applied_torque(data.applied_torque, pose, data.matrix.G, command)
    return share


@allocation_free
def _call_law(
    controller: Controller,
    law: Any,
    t: float,
    reference: Array,
    measurement: Array,
) -> bool:
    """Call the law; return True if its inputs, its torque and its logged values are finite."""
    data = controller.data
    torque_q, compensators = data.torque_q, data.compensators
    for i in range(3):
        torque_q[i] = np.nan  # detects a law that writes no torque, or raises
        measurement[2, i] = data.applied_torque.torque_q[i]
    if compensators.on and not apply_compensators(
        compensators, data.applied_torque, data.arrangement, controller.tables, measurement, reference
    ):
        return False
    if data.python_law != 0:
        call_python_law(data.python_law, t)
    else:
        call_law(law, t, reference, measurement, controller.parameters, controller.memory, torque_q[:])
    if data.cartesian:
        for i in range(3):
            data.torque_S[i] = torque_q[i]
        pose = compensators.prediction.pose if compensators.prediction.on else data.pose
        generalised_torque(pose, data.torque_S, torque_q)
    if compensators.feed_forward.on:
        for i in range(3):
            torque_q[i] += compensators.feed_forward.torque_q[i]
    for i in range(3):
        if not abs(torque_q[i]) < LARGEST_TORQUE_Nm:  # also where it is not a number
            return False
    finite = True
    for i in range(data.logged):
        finite = finite and abs(controller.memory[i]) < np.inf
    return finite


@allocation_free
def _allocate(data: ControllerData, allocate: Any, command: Array) -> float:
    """Compute currents for the law's torque from the enabled groups.

    The allocation receives a copy of the torque matrix, so that its writes have no other effect.
    """
    groups, prediction, pose, G = (
        data.supervision.groups,
        data.compensators.prediction,
        data.pose,
        data.matrix.G,
    )
    if prediction.on:
        pose, G = prediction.pose, prediction.matrix.G
    if not data.cartesian or data.compensators.feed_forward.on:  # the feed-forward acts on the hinges
        cartesian_torque(pose, data.torque_q, data.torque_S)
    mask_disabled_groups(groups, G)
    # Slices: the addressed function takes arrays, not fields of a record.
    return call_allocation(
        allocate, groups.G[:], data.torque_S[:], data.current_limit_A, command, data.scratch[:]
    )


@allocation_free
def _command_zero(data: ControllerData, memory: Array, command: Array) -> None:
    """Command no torque and no currents; logged values of the law stay unless they are not finite."""
    for i in range(3):
        data.torque_q[i] = data.torque_S[i] = data.compensators.feed_forward.torque_q[i] = 0.0
    for j in range(command.shape[0]):
        command[j] = 0.0
    for i in range(data.logged):
        if not abs(memory[i]) < np.inf:
            memory[i] = 0.0
