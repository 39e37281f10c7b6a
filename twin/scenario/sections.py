"""Sections of a scenario: all inputs of a run, each value with its range and meaning."""

from __future__ import annotations

from functools import lru_cache
from typing import TYPE_CHECKING, Annotated, Any, Literal, get_args

from pydantic import BaseModel, ConfigDict, Field, JsonValue, SerializeAsAny, field_validator, model_validator

from spheretwin.control.allocation import ALLOCATIONS
from spheretwin.control.estimators import AnyEstimator
from spheretwin.control.estimators.estimator import Ideal
from spheretwin.control.law import LARGEST, NonNegative, Positive
from spheretwin.control.law_components.parameters import ControllerSection, LawParameters
from spheretwin.control.laws import AnyLaw
from spheretwin.control.laws.afsm import AFSM
from spheretwin.control.manual_currents import ManualSection
from spheretwin.control.supervision.fault_detector import DetectorSection
from spheretwin.control.supervision.watchdog import WatchdogSection
from spheretwin.control.user_law import parameters_of
from spheretwin.disturbances import Disturbance
from spheretwin.electronics.delay import delay
from spheretwin.electronics.drive_section import DriveSection, ResolvedDrive, drive_sheet
from spheretwin.electronics.prototype import PROTOTYPE_DRIVE, PROTOTYPE_SENSORS
from spheretwin.electronics.sensor_chain import SensorsSection, sensor_sheet
from spheretwin.faults.fault import Fault, check_gains
from spheretwin.models.base.user_code import is_reference
from spheretwin.plant.step import ENGINES
from spheretwin.scenario.fields import SHIPPED
from spheretwin.trajectories import Trajectory
from spheretwin.trajectories.rounding import Bounded, Triple

NOMINAL = "nominal"

# Joint bearings: assumed, as no data sheet is available (2 mN·m is the lower of two estimates, 5 the higher).
PROTOTYPE_BEARINGS: dict[str, Any] = {
    "plant.coulomb_Nm": (2e-3, 2e-3, 2e-3),
    "plant.viscous_Nm_s": (1e-4, 1e-4, 1e-4),
}

# The prototype's software is not documented: the estimator is the one with the least noise for its lag.
PROTOTYPE_ESTIMATOR: dict[str, Any] = {"estimator.kind": "kalman"}

# Assumed: a laboratory does not run such a machine without a watchdog.
PROTOTYPE_WATCHDOG: dict[str, Any] = {"watchdog.on": True}


def _section(fields: dict[str, Any]) -> dict[str, Any]:
    """Return the fields of one section and of its sections, from fields by dotted name."""
    section: dict[str, Any] = {}
    for dotted, value in fields.items():
        _, *above, name = dotted.split(".")
        inside = section
        for part in above:
            inside = inside.setdefault(part, {})
        inside[name] = value
    return section


# The controller is designed with the data sheets of its own machine.
PROTOTYPE_NOMINAL: dict[str, Any] = {
    f"{NOMINAL}.{name}": value
    for name, value in {
        **_section(PROTOTYPE_BEARINGS),
        **drive_sheet(ResolvedDrive.model_validate(_section(PROTOTYPE_DRIVE))),
        **sensor_sheet(SensorsSection.model_validate(_section(PROTOTYPE_SENSORS))),
    }.items()
}

HARDWARE: dict[str, dict[str, Any]] = {
    "ideal": {},
    "prototype": {
        **PROTOTYPE_SENSORS,
        **PROTOTYPE_DRIVE,
        **PROTOTYPE_BEARINGS,
        **PROTOTYPE_ESTIMATOR,
        **PROTOTYPE_WATCHDOG,
        **PROTOTYPE_NOMINAL,
    },
}
"""Hardware sets: fields by dotted name and their values; each field can also be set separately."""


def hardware_defaults(fields: dict[str, Any], name: Any) -> dict[str, Any]:
    """Return the fields of a hardware set that given fields by section do not contain."""
    nominal = fields.get(NOMINAL)
    equals_truth = isinstance(nominal, dict) and nominal.get("equals_truth") is True
    return {
        dotted: value
        for dotted, value in hardware_fields(name, equals_truth).items()
        if not _is_given(fields, dotted)
    }


def hardware_fields(name: str, equals_truth: bool) -> dict[str, Any]:
    """Return the fields of a hardware set; without nominal values if the nominal model equals the truth."""
    return {
        dotted: value
        for dotted, value in HARDWARE.get(name, {}).items()
        if not (equals_truth and dotted.startswith(f"{NOMINAL}."))
    }


def _is_given(fields: Any, dotted: str) -> bool:
    for part in dotted.split("."):
        if not isinstance(fields, dict) or part not in fields:
            return False
        fields = fields[part]
    return True


NonNegativeTriple = tuple[NonNegative, NonNegative, NonNegative]

# A torque matrix near zero needs infinite currents.
LEAST_SCALE = 1e-3

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
    EngineName = str
else:
    AllocationName = Literal[tuple(ALLOCATIONS)]
    HardwareName = Literal[tuple(HARDWARE)]
    EngineName = Literal[tuple(ENGINES)]


class _Section(BaseModel):
    model_config = ConfigDict(frozen=True, extra="forbid", strict=True, allow_inf_nan=False)


class UserController(ControllerSection):
    """Record of a user law that was passed as a Python object, in place of the parameters of a law."""

    parameters: tuple[float, ...] = Field(description="numbers passed to the law")


class UserPath(_Section):
    """Record of a user trajectory that was passed as a Python object, in place of a shape."""

    shape: str = Field(description="class of the object that is followed")

    def notes(self) -> list[str]:
        """Return no notes: the parameters of the object are unknown."""
        return []


class Event(_Section):
    """Event: a change at a stated time of the run."""

    t_s: Annotated[float, Field(ge=0, le=LARGEST)] = Field(
        description="time of the change, s; effective at the first control tick from then on"
    )
    set: Annotated[str, Field(min_length=1)] = Field(description="field, such as disturbance.load")
    value: JsonValue = Field(description="its new value")


class PlantSection(_Section):
    """True rotor, and the integration of its motion."""

    engine: EngineName = Field(
        "mujoco", description="engine that computes the motion: MuJoCo, or the equations of motion (faster)"
    )
    step_s: Annotated[float, Field(ge=1e-7, le=1)] = Field(5e-4, description="physics step, s")
    integrator: Literal["RK4", "Euler", "implicitfast"] = Field(
        "RK4", description="integrator of MuJoCo; the Lagrangian has only RK4"
    )
    modelling_error: Annotated[float, Field(gt=-1, le=100)] = Field(
        0.0, description="m: the rotor's inertia is (1 + m) times the model file's"
    )
    modelling_torque_Nm: Triple = Field(
        (0.0, 0.0, 0.0), description="constant torque that the controller does not know, N·m (paper: ΔG)"
    )
    gravity_m_s2: Annotated[float, Field(ge=0, le=100)] | None = Field(
        None, description="gravity along -z, m/s²; the model's unless given"
    )
    coulomb_Nm: NonNegativeTriple = Field(
        (0.0, 0.0, 0.0), description="Coulomb friction of each hinge, N·m, in addition to that of the model"
    )
    viscous_Nm_s: NonNegativeTriple = Field(
        (0.0, 0.0, 0.0), description="viscous friction of each hinge, N·m·s, in addition to that of the model"
    )
    friction_smoothing_rad_s: Annotated[float, Field(ge=1e-9, le=1e3)] = Field(
        0.01, description="rate over which Coulomb friction changes sign, rad/s"
    )
    group_gain: tuple[Bounded, ...] | None = Field(
        None, description="torque per ampere of each group over that of the torque curve; 1 unless given"
    )
    payload_kg: NonNegative = Field(0.0, description="point mass on the shaft's payload mount, kg")
    initial_rad: Triple | None = Field(
        None, description="pose at the start, rad; the trajectory's first unless given"
    )
    initial_rad_s: Triple = Field((0.0, 0.0, 0.0), description="rates at the start, rad/s")
    mjcf: Annotated[str, Field(min_length=1)] | None = Field(
        None, description="model file; the shipped one unless given", json_schema_extra={"path": True}
    )
    torque_curve: Annotated[str, Field(min_length=1)] | None = Field(
        None,
        description="torque curve as CSV; the shipped one unless given",
        json_schema_extra={"path": True},
    )


class NominalSection(_Section):
    """Data sheet of the controller: the nominal value of every quantity that the controller uses.

    `hardware` and the user set it. A change of `plant`, `drive` or `sensors` does not change it. The
    default of a value is that of the model file, with ideal sensors, amplifiers and bearings.
    """

    equals_truth: bool = Field(
        False,
        description="whether the default of each value is the true value (plant, drive, sensors) at the"
        " start, or when this field is set; `hardware` and the model file are not used then",
    )
    torque_curve: Annotated[str, Field(min_length=1)] | None = Field(
        None,
        description="torque curve as CSV, or `shipped`; shipped unless given, and with a plant.mjcf, which is"
        " another machine, plant.torque_curve",
        json_schema_extra={"path": SHIPPED},
    )
    torque_scale: Annotated[float, Field(ge=-1e3, le=1e3)] = Field(
        1.0, description="torque matrix over that of the torque curve; its sign is wrong below 0"
    )
    inertia_kg_m2: tuple[Positive, Positive, Positive] | None = Field(
        None, description="principal inertias of the rotor, kg·m²; the model file's unless given"
    )
    current_limit_A: Positive | None = Field(
        None, description="largest group current that is commanded, A; the model file's unless given"
    )
    coulomb_Nm: NonNegativeTriple | None = Field(
        None, description="Coulomb friction of each hinge, N·m; 0 unless given"
    )
    viscous_Nm_s: NonNegativeTriple | None = Field(
        None, description="viscous friction of each hinge, N·m·s; 0 unless given"
    )
    delay_s: Annotated[float, Field(ge=0, le=1)] | None = Field(
        None, description="delay from a command to the amplifiers, s; 0 unless given"
    )
    time_constant_s: Annotated[float, Field(ge=0, le=1e3)] | None = Field(
        None, description="lag of the currents, s; L/R of the model file unless given"
    )
    resistance_ohm: Positive | None = Field(
        None, description="resistance of a group, ohm; the model file's unless given"
    )
    inductance_H: Positive | None = Field(
        None, description="inductance of a group, H; the model file's unless given"
    )
    swing_V: NonNegative | None = Field(
        None, description="largest voltage of the amplifiers, V; 0 for no limit; 0 unless given"
    )
    offset_error_A: NonNegative | None = Field(
        None, description="largest offset of a group current from its command, A; 0 unless given"
    )
    gain_error: NonNegative | None = Field(
        None, description="largest relative error of a group current; 0 unless given"
    )
    angle_noise_rad: NonNegativeTriple | None = Field(
        None, description="standard deviation of the noise of each measured angle, rad; 0 unless given"
    )
    angle_resolution_rad: NonNegativeTriple | None = Field(
        None, description="step between two values of each measured angle, rad; 0 for none; 0 unless given"
    )
    current_noise_A: NonNegative | None = Field(
        None, description="standard deviation of the noise of a measured current, A; 0 unless given"
    )

    @field_validator("torque_scale")
    @classmethod
    def _not_zero(cls, scale: float) -> float:
        if abs(scale) < LEAST_SCALE:
            raise ValueError(f"expected a magnitude of at least {LEAST_SCALE:g}, received {scale!r}")
        return scale


class Scenario(_Section):
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
        delay(self.drive, self.plant.step_s, self.substeps, 1)  # a whole number of physics steps
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
        return self.detects or self.sensors.current.noise_A > 0

    @property
    def measures_truth(self) -> bool:
        """True if the controller receives the true angles and rates, also during faults."""
        faulty = any(fault.kind.measured for fault in self.fault)
        return self.sensors.ideal and not faulty and self.estimator.kind == "ideal"

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


class ResolvedPlant(PlantSection):
    """Plant of a run. Without `gravity_m_s2` the gravity of the model file acts, in any direction."""

    group_gain: tuple[Bounded, ...]
    initial_rad: Triple


class ResolvedNominal(NominalSection):
    """Data sheet of the controller of a run: every value is given."""

    torque_curve: str
    inertia_kg_m2: tuple[Positive, Positive, Positive]
    current_limit_A: Positive
    coulomb_Nm: NonNegativeTriple
    viscous_Nm_s: NonNegativeTriple
    delay_s: float
    time_constant_s: float
    resistance_ohm: Positive
    inductance_H: Positive
    swing_V: NonNegative
    offset_error_A: NonNegative
    gain_error: NonNegative
    angle_noise_rad: NonNegativeTriple
    angle_resolution_rad: NonNegativeTriple
    current_noise_A: NonNegative


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
