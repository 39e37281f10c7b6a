"""One control tick: from the measurement to the commanded currents, by the nominal model alone."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numba import types
from numpy.typing import NDArray

from spheretwin.control import allocation as allocations
from spheretwin.control import law as laws
from spheretwin.control.allocation.bounded import SCRATCH_ROWS
from spheretwin.control.applied_torque import AppliedTorque, estimate_applied_torque
from spheretwin.control.compensators import Compensators, apply_compensators
from spheretwin.control.estimators.estimator import Estimator, estimator_at
from spheretwin.control.manual_currents import Manual, command_manual_currents
from spheretwin.control.supervision.enabled_groups import EnabledGroups, mask_disabled_groups
from spheretwin.control.supervision.fault_detector import Detector, detect_faults
from spheretwin.control.supervision.watchdog import GO, Reason, Watchdog, trip, watch
from spheretwin.models.base.compiled import compilable
from spheretwin.models.base.numba_internals.addresses import function_at
from spheretwin.models.base.record import Record, Rows, field
from spheretwin.models.kinematics import cartesian_torque
from spheretwin.models.magnetics import CachedMatrix, TorqueModel, cached_matrix, update_cached_matrix

# A diverging law may command any torque; beyond this the products of the allocation would overflow.
LARGEST_TORQUE_Nm = 1e100

NO_TORQUE = -1.0
"""Share that is returned if the law gave no torque."""

_COMMAND = int(Reason.COMMAND)

law_at = function_at(laws.SIGNATURE)
python_law_at = function_at(types.void(types.float64))
allocation_at = function_at(allocations.SIGNATURE)


class EstimatorState(NamedTuple):
    """Parameters and memory of the estimator of rates."""

    on: bool
    """True if there is an estimator; otherwise the law receives the measured rates."""
    parameters: NDArray[np.float64]
    memory: NDArray[np.float64]


class Supervision(Record):
    """Fault detection and watchdog."""

    groups: EnabledGroups = field("groups that the allocation may use")
    detector: Detector = field("detector of open and shorted groups")
    watchdog: Watchdog = field("check of measurements and commands")


class Controller(NamedTuple):
    """State and parameters of the controller; it has no access to the plant."""

    parameters: NDArray[np.float64]  # of the law
    memory: NDArray[np.float64]  # state of the law
    magnetics: TorqueModel  # nominal
    cached_matrix: CachedMatrix
    current_limit_A: float
    logged: int  # leading entries of the memory that are logged
    torque_q: NDArray[np.float64]  # (3,) N·m, commanded by the law in this tick
    torque_S: NDArray[np.float64]  # (3,) N·m, the same in the stator frame
    estimator_state: EstimatorState
    pose: NDArray[np.float64]  # (3,) rad, that the law receives
    rates: NDArray[np.float64]  # (3,) rad/s, that the law receives
    scratch: NDArray[np.float64]  # of the allocation
    applied_torque: AppliedTorque
    compensators: Compensators
    supervision: Rows  # of one `Supervision`
    manual: Manual
    authority: NDArray[np.float64]  # (1,) share of the commands that is sent: 1, or less in a soft start
    python_law: int = 0  # address of a function of the time that calls a law in plain Python; 0: none


def controller(
    law: laws.Law,
    magnetics: TorqueModel,
    current_limit_A: float,
    logged: int,
    applied_torque: AppliedTorque,
    compensators: Compensators,
    supervision: Rows,
    manual: Manual,
    estimator: Estimator | None = None,
) -> Controller:
    """Return the controller at the start of a run.

    Parameters
    ----------
    law : Law
        Its parameters and state are copied: a law may change both.
    magnetics : TorqueModel
        Nominal.
    current_limit_A : float, A
        Largest group current that the controller commands.
    logged : int
        Numbers of the law's state that the telemetry logs.
    applied_torque : AppliedTorque
        Estimate of the torque of the law's commands.
    compensators : Compensators
        Governor, prediction and feed-forward.
    supervision : rows of `Supervision`
    manual : Manual
        Manual currents that replace those of the law, if there are any.
    estimator : Estimator, optional
        Estimator of the rates; the law receives the measured rates unless it is given.
    """
    groups = magnetics.group_axes.shape[1]
    return Controller(
        parameters=law.parameters.copy(),
        memory=law.state.copy(),
        magnetics=magnetics,
        cached_matrix=cached_matrix(magnetics),
        current_limit_A=current_limit_A,
        logged=logged,
        torque_q=np.zeros(3),
        torque_S=np.zeros(3),
        estimator_state=EstimatorState(
            estimator is not None,
            estimator.parameters.copy() if estimator else np.zeros(0),
            estimator.state.copy() if estimator else np.zeros(0),
        ),
        pose=np.zeros(3),
        rates=np.zeros(3),
        scratch=np.empty((SCRATCH_ROWS, groups)),
        applied_torque=applied_torque,
        compensators=compensators,
        supervision=supervision,
        manual=manual,
        authority=np.ones(1),
    )


@compilable
def control_tick(
    controller: Controller,
    law: Any,
    allocate: Any,
    estimate: Any,
    t: float,
    reference: NDArray[np.float64],
    measurement: NDArray[np.float64],
    fresh: NDArray[np.float64],
    command: NDArray[np.float64],
) -> float:
    """Run the law, map its generalised torque to a Cartesian one, and allocate currents.

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
    fresh : (3,) array
        1 if the measurement of an angle is new, 0 if it repeats the last one.
    command : (n,) array, A
        Result: commanded group currents.

    Returns
    -------
    float
        Share of the law's torque that `command` gives, or the least share of a manual current. `NO_TORQUE` if
        the law gave no torque, or one beyond `LARGEST_TORQUE_Nm`, or logs a value that is not finite, and the
        watchdog is off. If the watchdog is on, it trips instead: the currents are 0 and the share is 1.
    """
    pose, estimator_state = controller.pose, controller.estimator_state
    if estimator_state.on:
        estimator_at(estimate)(
            measurement[0], estimator_state.parameters, estimator_state.memory, measurement[1]
        )
    for i in range(3):
        pose[i], controller.rates[i] = measurement[0, i], measurement[1, i]
    watchdog = controller.supervision[0].watchdog
    if watchdog.on:
        watch(watchdog, fresh, pose, controller.rates)
    update_cached_matrix(pose, controller.magnetics, controller.cached_matrix)
    _supervise(controller, t)
    law_active = watchdog.halt == GO and not controller.manual.on
    if law_active and not _call_law(controller, law, t, reference, measurement):
        if not watchdog.on:
            return NO_TORQUE
        trip(watchdog, _COMMAND)
    share = 1.0
    if law_active and watchdog.halt == GO:
        share = _allocate(controller, allocate, command)
    else:
        _command_zero(controller, command)
        if watchdog.halt == GO:
            share = command_manual_currents(controller.manual, t, controller.current_limit_A, command)
    if controller.authority[0] != 1.0:
        for j in range(command.shape[0]):
            command[j] *= controller.authority[0]
    if controller.applied_torque.on:
        estimate_applied_torque(controller.applied_torque, pose, controller.cached_matrix.G, command)
    return share


@compilable
def _call_law(
    controller: Controller,
    law: Any,
    t: float,
    reference: NDArray[np.float64],
    measurement: NDArray[np.float64],
) -> bool:
    """Call the law; return True if its inputs, its torque and its logged values are finite."""
    torque_q, compensators = controller.torque_q, controller.compensators
    for i in range(3):
        torque_q[i] = np.nan  # detects a law that writes no torque, or raises
        measurement[2, i] = controller.applied_torque.torque_q[i]
    if compensators.on and not apply_compensators(
        compensators, controller.applied_torque, controller.magnetics, measurement, reference
    ):
        return False
    if controller.python_law != 0:
        python_law_at(controller.python_law)(t)
    else:
        law_at(law)(t, reference, measurement, controller.parameters, controller.memory, torque_q)
    if compensators.feed_forward.on:
        for i in range(3):
            torque_q[i] += compensators.feed_forward.torque_q[i]
    for i in range(3):
        if not abs(torque_q[i]) < LARGEST_TORQUE_Nm:  # also where it is not a number
            return False
    finite = True
    for i in range(controller.logged):
        finite = finite and abs(controller.memory[i]) < np.inf
    return finite


@compilable
def _supervise(controller: Controller, t: float) -> None:
    """Run the fault detector if it is on and the groups are driven."""
    groups, detector = controller.supervision[0].groups, controller.supervision[0].detector
    if detector.on and controller.supervision[0].watchdog.halt == GO:
        G, current = controller.cached_matrix.G, controller.applied_torque.current
        detect_faults(detector, groups, current, G, controller.pose, controller.rates, t)


@compilable
def _allocate(controller: Controller, allocate: Any, command: NDArray[np.float64]) -> float:
    """Compute currents for the law's torque from the enabled groups.

    The allocation receives a copy of the torque matrix, so that its writes have no other effect.
    """
    groups, pose, G = controller.supervision[0].groups, controller.pose, controller.cached_matrix.G
    if controller.compensators.prediction.on:
        pose, G = controller.compensators.prediction.pose, controller.compensators.prediction.cached_matrix.G
    cartesian_torque(pose, controller.torque_q, controller.torque_S)
    mask_disabled_groups(groups, G)
    return allocation_at(allocate)(
        groups.G[:], controller.torque_S, controller.current_limit_A, command, controller.scratch
    )


@compilable
def _command_zero(controller: Controller, command: NDArray[np.float64]) -> None:
    """Command no torque and no currents; logged values of the law stay unless they are not finite."""
    for i in range(3):
        controller.torque_q[i] = controller.torque_S[i] = controller.compensators.feed_forward.torque_q[i] = (
            0.0
        )
    for j in range(command.shape[0]):
        command[j] = 0.0
    for i in range(controller.logged):
        if not abs(controller.memory[i]) < np.inf:
            controller.memory[i] = 0.0
