"""End stops by the plant and by an adaptive integration of the same model.

The reference knows neither the step nor the implicit method of `plant.end_stops`: DOP853 integrates the
Lagrangian with the torque of the buffers as it is written down.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from spheretwin.crosscheck.coil_driven import drive_plant
from spheretwin.crosscheck.equations import equations_of
from spheretwin.crosscheck.scale import Scale, scale_of
from spheretwin.crosscheck.trajectories import solve
from spheretwin.models.actuator import MJCF_PATH, Actuator
from spheretwin.models.base.arrays import Array
from spheretwin.plant.end_stops import EndStopsSection

STEP_s = 1e-4
DURATION_s, SAMPLE_s = 0.2, 1e-3
BEFORE_rad = 0.2962634015954635  # distance of the start from the upper end of α: 1.1 rad of 80°
START_rad_s = (6.0, -3.0, 2.0)
STOPS = EndStopsSection(on=True)

# A contact lasts 4 ms: it is not stepped over.
TIGHT: dict[str, Any] = {"rtol": 1e-11, "atol": 1e-13, "max_step": 2e-4}


def bound_rad_s(actuator: Actuator, expected: Array, contacts: int) -> float:
    """Return the bound of the rates: a contact turns a rate v with (natural h)²/12 of it, as a trapezoid."""
    natural_s = stops(scale_of(actuator)).stiffness_Nm_rad / float(min(actuator.inertia))
    return contacts * float(np.abs(expected[:, 3:]).max()) * natural_s * STEP_s**2


class Reference:
    """Integration of the Lagrangian with end stops; its steps shrink where a contact begins or ends.

    Parameters
    ----------
    actuator : Actuator
    section : EndStopsSection
    mjcf : Path
        Model file of the actuator.
    """

    def __init__(self, actuator: Actuator, section: EndStopsSection, mjcf: Path = MJCF_PATH) -> None:
        self._actuator, self._equations = actuator, equations_of(mjcf, actuator)
        self._stiffness = section.stiffness_Nm_rad
        self._damping = 2 * section.damping_ratio * np.sqrt(section.stiffness_Nm_rad * actuator.inertia)
        self._low, self._high = (actuator.hinge_range_rad + section.travel_rad * np.array([1.0, -1.0])).T

    def integrate(self) -> tuple[Array, int]:
        """Return the states (n + 1, 6) at the samples, and the number of contacts.

        Raises
        ------
        EngineError
            The integrator could not hold its tolerance.
        """
        t_s = SAMPLE_s * np.arange(round(DURATION_s / SAMPLE_s) + 1)
        rates = scale_of(self._actuator).rates_rad_s(START_rad_s)
        start = np.array([*start_rad(self._actuator), *rates])
        states = solve("end stop reference", self._flow, (0.0, t_s[-1]), start, t_eval=t_s, **TIGHT).y.T
        touches = (states[:, :3] > self._high) | (states[:, :3] < self._low)
        return states, int(np.count_nonzero(np.diff(touches.astype(int), axis=0) > 0))

    def _flow(self, t: float, state: Array) -> Array:
        q, qdot = state[:3].copy(), state[3:].copy()
        above, below = q - self._high, self._low - q
        upper = np.where(above > 0, np.maximum(self._stiffness * above + self._damping * qdot, 0), 0.0)
        lower = np.where(below > 0, np.maximum(self._stiffness * below - self._damping * qdot, 0), 0.0)
        return self._equations.flow(state, lower - upper)


def stops(scale: Scale) -> EndStopsSection:
    """Return the end stops of a machine: a contact lasts as long as in the shipped one."""
    return EndStopsSection(
        on=True,
        travel_rad=max(scale.angle * STOPS.travel_rad, 1e-6),
        stiffness_Nm_rad=min(max(scale.inertia * STOPS.stiffness_Nm_rad, 1e-3), 1e6),
    )


def start_rad(actuator: Actuator) -> tuple[float, float, float]:
    """Return the first pose: α before its upper buffer, β and γ on either side of the middle."""
    scale, end = scale_of(actuator), float(actuator.hinge_range_rad[0, 1])
    _, beta, gamma = scale.pose_rad((0.0, -0.5, 0.3))
    return end - scale.angle * BEFORE_rad, beta, gamma


def by_plant(mjcf: Path, actuator: Actuator, engine: str) -> Array:
    """Return the states (n + 1, 6) at the samples by the plant without currents."""
    count, scale = round(DURATION_s / STEP_s), scale_of(actuator)
    fields: dict[str, Any] = {
        "plant.engine": engine,
        "plant.step_s": STEP_s,
        "plant.initial_rad": start_rad(actuator),
        "plant.initial_rad_s": scale.rates_rad_s(START_rad_s),
        "controller.period_s": STEP_s,
        **{f"plant.end_stops.{name}": value for name, value in stops(scale).model_dump().items()},
    }
    every = round(SAMPLE_s / STEP_s)
    return drive_plant(mjcf, fields, lambda groups: np.zeros((count, groups)), np.zeros((count, 3)), every)
