"""Controller or plant outside of the process of a session: another program, or a machine."""

from __future__ import annotations

import ctypes
from abc import ABC, abstractmethod
from collections.abc import Callable
from functools import partial
from typing import Any, NamedTuple

import numpy as np

from spheretwin.control.supervision.watchdog import Reason, trip
from spheretwin.loop.closed_loop import INTERRUPTED, NO_EXTERNAL, External
from spheretwin.models.base.arrays import Array
from spheretwin.models.base.compiled import COMPILES, uncompiled
from spheretwin.models.base.errors import InputError, shown
from spheretwin.models.base.record import Rows
from spheretwin.plant.plant_tick import GOING

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


class ExternalController(ABC):
    """Controller that replaces that of the scenario.

    Attributes
    ----------
    name : str
        Entry of the journal.
    """

    name: str

    @abstractmethod
    def command(self, t_s: float, measurement: Measurement) -> Array | None:
        """Return the group currents (n,), A, for the measurement of a tick; None ends the run."""


class ExternalPlant(ABC):
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

    @abstractmethod
    def advance(self, t_s: float, current_A: Array) -> tuple[Measurement, Reason] | None:
        """Send the currents (n,) of a tick; return the next measurement, and a reason to remove the currents.

        `Reason.NONE` goes on; None ends the run.
        """


def name_of(part: ExternalController | ExternalPlant) -> str:
    """Return the name of an external part.

    Raises
    ------
    InputError
        It is neither a controller nor a plant.
    """
    if not isinstance(part, ExternalController | ExternalPlant):
        raise InputError(
            f"session: expected an ExternalController or an ExternalPlant, received {shown(part)}"
        )
    return part.name


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

    def __init__(self, part: ExternalController | ExternalPlant | None, run: Rows) -> None:
        self._run = run
        self._error: BaseException | None = None
        self.external = NO_EXTERNAL
        of_part = np.zeros(len(run[0].plant.current)), np.zeros(3)
        if isinstance(part, ExternalController):
            run["controller"]["manual"]["on"] = True
            self.external = External(self._entry(partial(self._command, part)), 0, *of_part)
        elif isinstance(part, ExternalPlant):
            run["controller"]["authority"] = part.authority
            self.external = External(0, self._entry(partial(self._advance, part)), *of_part)

    def raise_error(self) -> None:
        """Raise the exception of the part, if there was one: it cannot pass the compiled loop."""
        error, self._error = self._error, None
        if error is not None:
            raise error

    def _entry(self, function: Callable[[float], int]) -> Any:
        """Return what the loop calls: a function whose exceptions end the run."""

        def call(t_s: float) -> int:
            try:
                return function(t_s)
            except BaseException as error:
                self._error = error
                return INTERRUPTED

        self._callback = _CALLBACK(call)
        return ctypes.cast(self._callback, ctypes.c_void_p).value if COMPILES else call

    def _command(self, part: ExternalController, t_s: float) -> int:
        plant, data = self._run[0].plant, self._run[0].controller
        sensors, drive = plant.current_sensors, plant.drive
        measurement = Measurement(
            data.measurement[0],
            None if data.estimator_on else data.measurement[1],
            sensors.measured_A if sensors.on else plant.current,
            drive.coil.temperature_degC.max() if drive.supplied else None,
        )
        command = part.command(t_s, measurement)
        if command is None:
            return INTERRUPTED
        data.manual.current_A[:] = command
        return GOING

    def _advance(self, part: ExternalPlant, t_s: float) -> int:
        data, plant, external = self._run[0].controller, self._run[0].plant, self.external
        # Nominal torque of the currents: the true one is not known.
        np.dot(data.matrix.G, external.command, out=external.torque_S)
        result = part.advance(t_s, external.command)
        if result is None:
            return INTERRUPTED
        measurement, reason = result
        plant.rotor.q[:] = plant.joint_q[:] = measurement.angle_rad
        if measurement.rate_rad_s is not None:
            plant.rotor.qdot[:] = measurement.rate_rad_s
        plant.current[:] = external.command if measurement.current_A is None else measurement.current_A
        if reason:
            _trip(data.supervision.watchdog, int(reason))
        data.authority = part.authority
        return GOING


_trip = uncompiled(trip)
