"""Scenario: all inputs of a run, each value with its range and meaning."""

from __future__ import annotations

from functools import lru_cache
from typing import TYPE_CHECKING, Annotated, Any, Literal, get_args

from pydantic import Field, JsonValue, SerializeAsAny, model_validator

from spheretwin.control.allocation import ALLOCATIONS
from spheretwin.control.estimators import AnyEstimator
from spheretwin.control.estimators.estimator import Ideal
from spheretwin.control.law import LARGEST, Positive
from spheretwin.control.law_components.parameters import ControllerSection, LawParameters
from spheretwin.control.laws import AnyLaw
from spheretwin.control.laws.afsm import AFSM
from spheretwin.control.manual_currents import ManualSection
from spheretwin.control.supervision.fault_detector import DetectorSection
from spheretwin.control.supervision.watchdog import WatchdogSection
from spheretwin.control.user_law import parameters_of
from spheretwin.electronics.delay import steps_of
from spheretwin.electronics.drive_section import DriveSection, ResolvedDrive
from spheretwin.electronics.sensor_chain import SensorsSection
from spheretwin.faults.fault import Fault, check_gains
from spheretwin.models.base.user_code import is_reference
from spheretwin.scenario.hardware import HARDWARE
from spheretwin.scenario.plant_sections import (
    NominalSection,
    PlantSection,
    ResolvedNominal,
    ResolvedPlant,
    Section,
)
from spheretwin.trajectories import Trajectory
from spheretwin.trajectories.disturbances import Disturbance

# A tick must end in reasonable time: 10,000 physics steps take some 50 ms.
MOST_SUBSTEPS = 10_000

# Bounds the time of a mistyped list: each tick asks every fault whether it acts.
MOST_FAULTS = 1000

# Bounds memory and time: delayed commands are stored and shifted at every tick.
MOST_DELAY = 1000

# Clock times are decimal fractions: a period is a multiple of a step only up to rounding.
WHOLE = 1e-9


if TYPE_CHECKING:
    AllocationName = str
    HardwareName = str
else:
    AllocationName = Literal[tuple(ALLOCATIONS)]
    HardwareName = Literal[tuple(HARDWARE)]


class UserController(ControllerSection):
    """Record of a user law that was passed as a Python object, in place of the parameters of a law."""

    parameters: tuple[float, ...] = Field(description="numbers passed to the law")


class UserPath(Section):
    """Record of a user trajectory that was passed as a Python object, in place of a shape."""

    shape: str = Field(description="class of the object that is followed")

    def notes(self) -> list[str]:
        """Return no notes: the parameters of the object are unknown."""
        return []


class Event(Section):
    """Event: a change at a stated time of the run."""

    t_s: Annotated[float, Field(ge=0, le=LARGEST)] = Field(
        description="time of the change, s; effective at the first control tick from then on"
    )
    set: Annotated[str, Field(min_length=1)] = Field(description="field, such as disturbance.load")
    value: JsonValue = Field(description="its new value")


class Scenario(Section):
    """Scenario: all inputs of a run."""

    name: str = Field("unnamed", description="name of the scenario")
    description: str = Field("", description="purpose of the scenario")
    duration: Positive = Field(5.0, description="length of the run, s")
    seed: Annotated[int, Field(ge=0)] = Field(
        0, description="seed of all random numbers: random torque, errors and noise"
    )
    allocation: AllocationName = Field(
        "least_norm",
        description="currents for a torque: least-norm and scaled at the limit (16), or the largest torque"
        " within the limit",
    )
    hardware: HardwareName = Field(
        "ideal", description="named set of field values; it applies to fields that are not set"
    )
    trajectory: SerializeAsAny[Trajectory]
    controller: SerializeAsAny[AnyLaw] = AFSM()
    manual: ManualSection = ManualSection()
    nominal: NominalSection = NominalSection()
    sensors: SensorsSection = SensorsSection()
    estimator: SerializeAsAny[AnyEstimator] = Ideal()
    plant: PlantSection = PlantSection()
    drive: DriveSection = DriveSection()
    disturbance: Disturbance = Disturbance()
    fault: Annotated[tuple[Fault, ...], Field(max_length=MOST_FAULTS)] = Field(
        (), description="faults, one table [[fault]] each"
    )
    detector: DetectorSection = DetectorSection()
    watchdog: WatchdogSection = WatchdogSection()
    event: tuple[Event, ...] = Field((), description="changes during the run, one table [[event]] each")

    @model_validator(mode="after")
    def _clocks_fit(self) -> Scenario:
        ratio = self.controller.period_s / self.plant.step_s
        if round(ratio) < 1 or round(ratio) > MOST_SUBSTEPS or abs(ratio - round(ratio)) > WHOLE * ratio:
            raise ValueError(
                f"expected controller.period_s a whole multiple of plant.step_s, 1 to {MOST_SUBSTEPS} times,"
                f" received {self.controller.period_s!r} and {self.plant.step_s!r} s"
            )
        delay_s = self.nominal.delay_s
        if delay_s is not None and delay_s > MOST_DELAY * self.controller.period_s:
            raise ValueError(
                f"expected nominal.delay_s of at most {MOST_DELAY} control periods, received {delay_s!r} s"
            )
        skew_s, period_s = self.sensors.adc.skew_s, self.controller.period_s
        if not skew_s < period_s:
            raise ValueError(
                f"expected sensors.adc.skew_s below controller.period_s of {period_s!r} s,"
                f" received {skew_s!r} s"
            )
        steps_of(self.drive, self.plant.step_s, self.substeps)  # a whole number of physics steps
        if self.ticks < 1:
            raise ValueError(
                f"expected a duration of at least one control period, received {self.duration!r} s"
            )
        return self

    @model_validator(mode="after")
    def _faults_fit(self) -> Scenario:
        for place, fault in enumerate(self.fault):
            if fault.kind.needs_supply and self.drive.supply_V is None:
                raise ValueError(
                    f"fault.{place}: expected drive.supply_V for a fault of {fault.target}, received none"
                )
            step_s = {"adc": self.controller.period_s, "controller": self.plant.step_s}.get(fault.kind.name)
            if fault.mode == "delay" and step_s is not None:
                _check_late(f"fault.{place}.value", fault.effective_value, step_s, self.controller.period_s)
            if fault.kind.measured and self.sensors.hall.on:
                raise ValueError(
                    f"fault.{place}: expected no fault of {fault.target} with sensors.hall, which replaces it"
                )
        check_gains(self.fault)
        return self

    def __repr__(self) -> str:
        faults = f", {len(self.fault)} faults" if self.fault else ""
        return (
            f"{type(self).__name__}({self.name}: {self.trajectory.shape} under {self.controller.law},"
            f" {self.hardware} hardware, {self.duration:g} s{faults})"
        )

    __str__ = __repr__

    @property
    def detects(self) -> bool:
        """True if the fault detector of the controller is on."""
        return self.detector.detect or any(fault.detection for fault in self.fault)

    @property
    def senses_currents(self) -> bool:
        """True if there are current sensors."""
        return self.detects or self.sensors.current.noise_A > 0 or self.sensors.hall.on

    @property
    def measures_truth(self) -> bool:
        """True if the controller receives the true angles and rates, also during faults."""
        faulty = any(fault.kind.measured for fault in self.fault)
        ideal = self.sensors.ideal and not any(self.plant.backlash_rad)
        return ideal and not faulty and self.estimator.kind == "ideal"

    @property
    def supervises_groups(self) -> bool:
        """True if groups may fail or are monitored."""
        return bool(self.fault) or self.detects

    @property
    def ticks(self) -> int:
        """Control ticks of the run."""
        return int(self.duration / self.controller.period_s * (1 + WHOLE))

    @property
    def substeps(self) -> int:
        """Physics steps in a control period."""
        return round(self.controller.period_s / self.plant.step_s)


class ResolvedScenario(Scenario):
    """Scenario of a run: every default that depends on files, trajectory or hardware is filled in."""

    nominal: ResolvedNominal
    plant: ResolvedPlant
    drive: ResolvedDrive


def _check_late(name: str, delay_s: float, step_s: float, period_s: float) -> None:
    steps = delay_s / step_s
    if abs(steps - round(steps)) > WHOLE * max(steps, 1) or delay_s > MOST_DELAY * period_s:
        raise ValueError(
            f"expected {name} a whole multiple of {step_s!r} s, at most {MOST_DELAY} control periods,"
            f" received {delay_s!r} s"
        )


def scenario_with(law: Any) -> type[Scenario]:
    """Return the class of scenarios with a law: the common one, or one with the shipped laws and a user law.

    Raises
    ------
    InputError
        The law is in a file and cannot be loaded.
    """
    return _scenario_class(parameters_of(law)) if is_reference(law) else Scenario


def kind_of_scenario(scenario: Scenario) -> type[Scenario]:
    """Return the class of the scenarios with the law of a scenario, as it was read."""
    controller = scenario.controller
    if is_reference(controller.law) and isinstance(controller, LawParameters):
        return _scenario_class(type(controller))
    return Scenario


@lru_cache(maxsize=32)
def _scenario_class(user_law: type[LawParameters]) -> type[Scenario]:
    laws: Any = Annotated[get_args(AnyLaw)[0] | user_law, Field(discriminator="law")]

    class Extended(Scenario):
        controller: SerializeAsAny[laws] = Scenario.model_fields["controller"].default

        def __reduce__(self) -> tuple[Any, ...]:
            """Pickle by the name of the law: the class is created again when a scenario is unpickled."""
            return _blank, (user_law.model_fields["law"].default,), self.__getstate__()

    Extended.__name__ = Extended.__qualname__ = Scenario.__name__
    return Extended


def _blank(law: str) -> Scenario:
    kind = scenario_with(law)
    return kind.__new__(kind)
