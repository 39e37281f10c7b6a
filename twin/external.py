"""Controller or plant outside of the process of a session: another program, or a machine."""

from __future__ import annotations

import ctypes
from collections.abc import Callable
from typing import Any, NamedTuple, Protocol

import numpy as np
from numpy.typing import NDArray

from spheretwin.control.supervision.watchdog import Reason, trip
from spheretwin.loop import INTERRUPTED, NO_EXTERNAL, External
from spheretwin.models.base.compiled import COMPILES, uncompiled
from spheretwin.models.base.record import Rows
from spheretwin.plant.plant_tick import GOING

Array = NDArray[np.float64]

_CALLBACK = ctypes.CFUNCTYPE(ctypes.c_int64, ctypes.c_double)


class Measurement(NamedTuple):
    """Values that the sensors of a machine report at one time."""

    angle_rad: Array
    """(3,)"""
    rate_rad_s: Array | None = None
    """(3,); None if the machine does not measure rates."""
    current_A: Array | None = None
    """(n,); None if the machine does not measure currents."""
    temperature_degC: float | None = None
    """Of the hottest coil; None if the machine does not report it."""


class ExternalController(Protocol):
    """Controller that replaces that of the scenario.

    Attributes
    ----------
    name : str
        Entry of the journal.
    """

    name: str

    def command(self, t_s: float, measurement: Measurement) -> Array | None:
        """Return the group currents (n,), A, for the measurement of a tick; None ends the run."""


class ExternalPlant(Protocol):
    """Machine that replaces the plant of the scenario.

    Attributes
    ----------
    name : str
        Entry of the journal.
    authority : float
        Share of the commands that is sent at the next tick, from 0 to 1: soft start.
    """

    name: str
    authority: float

    def advance(self, t_s: float, current_A: Array) -> tuple[Measurement, Reason] | None:
        """Send the currents (n,) of a tick; return the next measurement, and a reason to remove the currents.

        `Reason.NONE` goes on; None ends the run.
        """


class Connection:
    """Connection of the loop to an external part.

    Parameters
    ----------
    part : ExternalController or ExternalPlant, optional
    run : array of one RunData

    Attributes
    ----------
    external : External
        Argument of the loop. It has only addresses: this object keeps the functions alive.
    """

    def __init__(self, part: Any, run: Rows) -> None:
        self._part, self._run = part, run
        self._error: BaseException | None = None
        self.external = NO_EXTERNAL
        if part is None:
            return
        is_plant = hasattr(part, "advance")
        function = self._guarded(self._advance if is_plant else self._command)
        self._callback = _CALLBACK(function)
        entry = ctypes.cast(self._callback, ctypes.c_void_p).value if COMPILES else function
        groups = len(run[0].plant.current)
        self.external = External(
            0 if is_plant else entry, entry if is_plant else 0, np.zeros(groups), np.zeros(3)
        )
        if is_plant:
            run["controller"]["authority"] = part.authority

    def raise_error(self) -> None:
        """Raise the exception of the part, if there was one: it cannot pass the compiled loop."""
        error, self._error = self._error, None
        if error is not None:
            raise error

    def _guarded(self, function: Callable[[float], int]) -> Callable[[float], int]:
        def call(t_s: float) -> int:
            try:
                return function(t_s)
            except BaseException as error:
                self._error = error
                return INTERRUPTED

        return call

    def _command(self, t_s: float) -> int:
        plant, data = self._run[0].plant, self._run[0].controller
        sensors, drive = plant.current_sensors, plant.drive
        measurement = Measurement(
            data.measurement[0],
            None if data.estimator_on else data.measurement[1],
            sensors.measured_A if sensors.on else plant.current,
            drive.coil.temperature_degC.max() if drive.supplied else None,
        )
        command = self._part.command(t_s, measurement)
        if command is None:
            return INTERRUPTED
        data.manual.current_A[:] = command
        return GOING

    def _advance(self, t_s: float) -> int:
        data, plant, external = self._run[0].controller, self._run[0].plant, self.external
        # Nominal torque of the currents: the true one is not known.
        np.dot(data.matrix.G, external.command, out=external.torque_S)
        result = self._part.advance(t_s, external.command)
        if result is None:
            return INTERRUPTED
        measurement, reason = result
        plant.rotor.q[:] = plant.joint_q[:] = measurement.angle_rad
        if measurement.rate_rad_s is not None:
            plant.rotor.qdot[:] = measurement.rate_rad_s
        plant.current[:] = external.command if measurement.current_A is None else measurement.current_A
        if reason:
            _trip(data.supervision.watchdog, int(reason))
        data.authority = self._part.authority
        return GOING


_trip = uncompiled(trip)
