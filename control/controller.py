"""One control tick: from what was measured to the currents asked for, by the nominal model alone."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
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
from spheretwin.models.base.numba_internals import function_at
from spheretwin.models.kinematics import cartesian_torque
from spheretwin.models.magnetics import CachedMatrix, TorqueModel, cached_matrix, update_cached_matrix

# Whatever a law may ask for while it loses the rotor; beyond it the allocation's products would overflow.
LARGEST_TORQUE_Nm = 1e100

NO_TORQUE = -1.0
"""Share of the torque that is returned where the law gave none."""

_COMMAND = int(Reason.COMMAND)

law_at = function_at(laws.SIGNATURE)
allocation_at = function_at(allocations.SIGNATURE)


class EstimatorState(NamedTuple):
    """What rates are estimated with, and what the estimator remembers."""

    on: bool
    """Whether there is an estimator; if not, the rates are handed over as they come."""
    parameters: NDArray[np.float64]
    memory: NDArray[np.float64]


class Supervision(NamedTuple):
    """What looks after the actuator beside the law."""

    groups: EnabledGroups
    detector: Detector
    watchdog: Watchdog


class Controller(NamedTuple):
    """What the near side of the wires knows and remembers: nothing of the plant itself."""

    parameters: NDArray[np.float64]  # of the law
    memory: NDArray[np.float64]  # state of the law
    magnetics: TorqueModel  # nominal
    cached_matrix: CachedMatrix
    current_limit_A: float
    logged: int  # leading entries of the memory that are logged
    torque_q: NDArray[np.float64]  # (3,) N·m, what the law asked for in this tick
    torque_S: NDArray[np.float64]  # (3,) N·m, the same in the stator frame
    estimator_state: EstimatorState
    pose: NDArray[np.float64]  # (3,) rad, as the law is handed it
    rates: NDArray[np.float64]  # (3,) rad/s, likewise
    scratch: NDArray[np.float64]  # of the allocation
    applied_torque: AppliedTorque
    compensators: Compensators
    supervision: Supervision
    manual: Manual


def controller(
    law: laws.Law,
    magnetics: TorqueModel,
    current_limit_A: float,
    logged: int,
    applied_torque: AppliedTorque,
    compensators: Compensators,
    supervision: Supervision,
    manual: Manual,
    estimator: Estimator | None = None,
) -> Controller:
    """Controller at the start of a run.

    Parameters
    ----------
    law : Law
        Its parameters and state are copied: a law may change both.
    magnetics : TorqueModel
        Nominal.
    current_limit_A : float, A
        Largest group current the controller asks for.
    logged : int
        Numbers of the law's state that the telemetry logs.
    belief : Belief
        Of the torque that the law's commands led to.
    around : Around
        What stands around the law.
    supervision : Supervision
    manual : Manual
        Currents that are asked for instead of the law's, if there are any.
    estimator : Estimator, optional
        Of the rates; the law is handed those that are measured unless given.
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
    command: NDArray[np.float64],
) -> float:
    """Law, generalised torque to Cartesian (at the pose handed to it), allocation (by the nominal matrix).

    Parameters
    ----------
    controller : Controller
        Changed in place.
    law, allocate : address or callable
        Of `control.law.SIGNATURE` and `control.allocations.SIGNATURE`: addresses in compiled code.
    estimate : address or callable
        Of `control.estimation.estimator.SIGNATURE`; anything where nothing is estimated.
    t : float, s
        Time of the tick.
    reference : (3, 3) array
        Desired angle, rate and acceleration as rows; the law may write into it.
    measurement : (3, 3) or (6, 3) array
        Measured angle (rad) and rate (rad/s); the other rows are filled in, six of them where the delay is
        predicted over. The law may write into it.
    command : (n,) array, A
        Result: group currents asked of the amplifiers.

    Returns
    -------
    float
        Share of the law's torque that `command` gives, or the least share of a current by hand; `LOST` where
        the law gave no torque, or one beyond `LARGEST_TORQUE_Nm`, or logs what is no number, and no
        watchdog is there to take the currents away. Where it does, nothing is asked for, and all of it is
        given.
    """
    pose, estimator_state = controller.pose, controller.estimator_state
    if estimator_state.on:
        estimator_at(estimate)(
            measurement[0], estimator_state.parameters, estimator_state.memory, measurement[1]
        )
    for i in range(3):
        pose[i], controller.rates[i] = measurement[0, i], measurement[1, i]
    watchdog = controller.supervision.watchdog
    if watchdog.on:
        watch(watchdog, pose, controller.rates)
    update_cached_matrix(pose, controller.magnetics, controller.cached_matrix)
    _supervise(controller, t)
    law_active = watchdog.halt[0] == GO and not controller.manual.on
    if law_active and not _call_law(controller, law, t, reference, measurement):
        if not watchdog.on:
            return NO_TORQUE
        trip(watchdog, _COMMAND)
    share = 1.0
    if law_active and watchdog.halt[0] == GO:
        share = _allocate(controller, allocate, command)
    else:
        _command_zero(controller, command)
        if watchdog.halt[0] == GO:
            share = command_manual_currents(controller.manual, controller.current_limit_A, command)
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
    """Let the law write its torque; whether that, and all that it logs and is handed, are numbers."""
    torque_q, compensators = controller.torque_q, controller.compensators
    for i in range(3):
        torque_q[i] = np.nan  # a law that writes no torque, or raises, must not go unnoticed
        measurement[2, i] = controller.applied_torque.torque_q[i]
    if compensators.on and not apply_compensators(
        compensators, controller.applied_torque, controller.magnetics, measurement, reference
    ):
        return False
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
    """Look for groups that do not follow, where that is wanted, and while they are driven."""
    groups, detector, watchdog = controller.supervision
    if detector.on and watchdog.halt[0] == GO:
        G, current = controller.cached_matrix.G, controller.applied_torque.current
        detect_faults(detector, groups, current, G, controller.pose, controller.rates, t)


@compilable
def _allocate(controller: Controller, allocate: Any, command: NDArray[np.float64]) -> float:
    """Currents for the law's torque, from the groups that may be used.

    The allocation is handed a copy of the torque matrix: what it writes reaches nothing else.
    """
    groups, pose, G = controller.supervision.groups, controller.pose, controller.cached_matrix.G
    if controller.compensators.prediction.on:
        pose, G = controller.compensators.prediction.pose, controller.compensators.prediction.cached_matrix.G
    cartesian_torque(pose, controller.torque_q, controller.torque_S)
    mask_disabled_groups(groups, G)
    return allocation_at(allocate)(
        groups.G, controller.torque_S, controller.current_limit_A, command, controller.scratch
    )


@compilable
def _command_zero(controller: Controller, command: NDArray[np.float64]) -> None:
    """No torque and no currents; what a law logs stays what it was, unless that is no number."""
    for i in range(3):
        controller.torque_q[i] = controller.torque_S[i] = controller.compensators.feed_forward.torque_q[i] = (
            0.0
        )
    for j in range(command.shape[0]):
        command[j] = 0.0
    for i in range(controller.logged):
        if not abs(controller.memory[i]) < np.inf:
            controller.memory[i] = 0.0
