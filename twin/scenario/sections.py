"""Everything one run depends on: the sections of a scenario, each value with its range and meaning."""

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
from spheretwin.electronics.data_sheet import drive_sheet, sensor_sheet
from spheretwin.electronics.delay import delay
from spheretwin.electronics.drive_chain import DriveSection, ResolvedDrive
from spheretwin.electronics.prototype import PROTOTYPE_DRIVE, PROTOTYPE_SENSORS
from spheretwin.electronics.sensor_chain import SensorsSection
from spheretwin.faults.fault import Fault, check_gains
from spheretwin.models.base.user_code import is_reference
from spheretwin.plant.step import ENGINES
from spheretwin.scenario.fields import SHIPPED
from spheretwin.trajectories import Trajectory
from spheretwin.trajectories.rounding import Bounded, Triple

NOMINAL = "nominal"

# Joint bearings: assumed, as no sheet is at hand (2 mN·m is the lighter of two guesses, 5 the heavier).
PROTOTYPE_BEARINGS: dict[str, Any] = {
    "plant.coulomb_Nm": (2e-3, 2e-3, 2e-3),
    "plant.viscous_Nm_s": (1e-4, 1e-4, 1e-4),
}

# The prototype's software is not described: rates are estimated by the filter of least noise for its lag.
PROTOTYPE_ESTIMATOR: dict[str, Any] = {"estimator.kind": "kalman"}

# Assumed: a laboratory does not run such a machine without one.
PROTOTYPE_WATCHDOG: dict[str, Any] = {"watchdog.on": True}


def _section(fields: dict[str, Any]) -> dict[str, Any]:
    """Fields of one section by name, those of the sections in it as well, from fields by dotted name."""
    section: dict[str, Any] = {}
    for dotted, value in fields.items():
        _, *above, name = dotted.split(".")
        inside = section
        for part in above:
            inside = inside.setdefault(part, {})
        inside[name] = value
    return section


# The controller is built by the sheets of its own machine.
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
"""Fields by dotted name that a set gives a value to; each of them can be set alone as well."""


def hardware_defaults(fields: dict[str, Any], name: Any) -> dict[str, Any]:
    """Return the fields of a set that given fields by section do not state."""
    nominal = fields.get(NOMINAL)
    knows_truth = isinstance(nominal, dict) and nominal.get("equals_truth") is True
    return {
        dotted: value
        for dotted, value in hardware_fields(name, knows_truth).items()
        if not _said(fields, dotted)
    }


def hardware_fields(name: str, knows_truth: bool) -> dict[str, Any]:
    """Return the fields of a set; a nominal model that equals the truth takes none of its own from it."""
    return {
        dotted: value
        for dotted, value in HARDWARE.get(name, {}).items()
        if not (knows_truth and dotted.startswith(f"{NOMINAL}."))
    }


def _said(fields: Any, dotted: str) -> bool:
    for part in dotted.split("."):
        if not isinstance(fields, dict) or part not in fields:
            return False
        fields = fields[part]
    return True


NonNegativeTriple = tuple[NonNegative, NonNegative, NonNegative]

# A torque matrix of nothing asks for endless currents.
LEAST_SCALE = 1e-3

# A tick must end before its user does: 10,000 physics steps take some 50 ms.
MOST_SUBSTEPS = 10_000

# A slip of the pen must not take for ever: which of them act is asked of each.
MOST_FAULTS = 1000

# Commands on their way are kept, and moved on at every tick.
MOST_DELAY = 1000

# Clock times are built from decimal fractions; a period and a step that fit do so to rounding only.
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
    """What a run under a law that its user made in Python says of it, in the place of a law's parameters."""

    parameters: tuple[float, ...] = Field(description="numbers handed to the law")


class UserPath(_Section):
    """What a run along a trajectory that its user made in Python says of it, in a shape's place."""

    shape: str = Field(description="class of the object that is followed")

    def notes(self) -> list[str]:
        """Nothing is known of it."""
        return []


class Event(_Section):
    """A change that the run makes of itself on its way."""

    t_s: Annotated[float, Field(ge=0, le=LARGEST)] = Field(
        description="time from which the change is in force, s; at the first control tick from then on"
    )
    set: Annotated[str, Field(min_length=1)] = Field(description="field, such as disturbance.load")
    value: JsonValue = Field(description="its new value")


class Plant(_Section):
    """The rotor as it really is, and how its motion is integrated."""

    engine: EngineName = Field(
        "mujoco", description="what computes the motion: MuJoCo, or the equations of motion (faster)"
    )
    step_s: Annotated[float, Field(ge=1e-7, le=1)] = Field(5e-4, description="physics step, s")
    integrator: Literal["RK4", "Euler", "implicitfast"] = Field(
        "RK4", description="integrator of MuJoCo; the Lagrangian has RK4 alone"
    )
    modelling_error: Annotated[float, Field(gt=-1, le=100)] = Field(
        0.0, description="m: the rotor's inertia is (1 + m) times the model file's"
    )
    modelling_torque_Nm: Triple = Field(
        (0.0, 0.0, 0.0), description="constant torque the controller does not know, N·m (paper: ΔG)"
    )
    gravity_m_s2: Annotated[float, Field(ge=0, le=100)] | None = Field(
        None, description="gravity along -z, m/s²; the model's unless given"
    )
    coulomb_Nm: NonNegativeTriple = Field(
        (0.0, 0.0, 0.0), description="Coulomb friction of each hinge, N·m, beside what the model has"
    )
    viscous_Nm_s: NonNegativeTriple = Field(
        (0.0, 0.0, 0.0), description="viscous friction of each hinge, N·m·s, beside what the model has"
    )
    friction_smoothing_rad_s: Annotated[float, Field(ge=1e-9, le=1e3)] = Field(
        0.01, description="rate over which Coulomb friction changes sign, rad/s"
    )
    group_gain: tuple[Bounded, ...] | None = Field(
        None, description="torque an ampere of each group over that of the torque curve; 1 unless given"
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


class Nominal(_Section):
    """Data sheet of the controller: its own value of every quantity that it uses.

    `hardware` and the user write it. A change of `plant`, `drive` or `sensors` does not change it. A value
    that is not given is that of the model file, for ideal sensors, amplifiers and bearings.
    """

    equals_truth: bool = Field(
        False,
        description="whether a value that is not given here is the true one (plant, drive, sensors) at the"
        " start, or when this field is set; neither `hardware` nor the model file gives it then",
    )
    torque_curve: Annotated[str, Field(min_length=1)] | None = Field(
        None,
        description="torque curve as CSV, or `shipped`; shipped unless given, and with a plant.mjcf, which is"
        " another machine, plant.torque_curve",
        json_schema_extra={"path": SHIPPED},
    )
    torque_scale: Annotated[float, Field(ge=-1e3, le=1e3)] = Field(
        1.0, description="torque matrix over that of the torque curve; below 0, its sign is wrong"
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
        None, description="of a group, ohm; the model file's unless given"
    )
    inductance_H: Positive | None = Field(None, description="of a group, H; the model file's unless given")
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
    def _not_nothing(cls, scale: float) -> float:
        if abs(scale) < LEAST_SCALE:
            raise ValueError(f"expected a magnitude of at least {LEAST_SCALE:g}, received {scale!r}")
        return scale


class Scenario(_Section):
    """Everything a run depends on."""

    name: str = Field("unnamed", description="name of the scenario")
    description: str = Field("", description="what it shows")
    duration: Positive = Field(5.0, description="length of the run, s")
    seed: Annotated[int, Field(ge=0)] = Field(
        0, description="seed of all that is drawn: random torque, errors and noise"
    )
    allocation: AllocationName = Field(
        "least_norm",
        description="currents for a torque: least-norm and scaled at the limit (16), or all the limit allows",
    )
    hardware: HardwareName = Field(
        "ideal", description="named set of fields; it gives those a value that are not set themselves"
    )
    trajectory: SerializeAsAny[Trajectory]
    controller: SerializeAsAny[AnyLaw] = AFSM()
    manual: ManualSection = ManualSection()
    nominal: Nominal = Nominal()
    sensors: SensorsSection = SensorsSection()
    estimator: SerializeAsAny[AnyEstimator] = Ideal()
    plant: Plant = Plant()
    drive: DriveSection = DriveSection()
    disturbance: Disturbance = Disturbance()
    fault: Annotated[tuple[Fault, ...], Field(max_length=MOST_FAULTS)] = Field(
        (), description="what fails, [[fault]] each"
    )
    detector: DetectorSection = DetectorSection()
    watchdog: WatchdogSection = WatchdogSection()
    event: tuple[Event, ...] = Field((), description="changes on the way, [[event]] each")

    @model_validator(mode="after")
    def _clocks_fit(self) -> Scenario:
        ratio = self.controller.period_s / self.plant.step_s
        if round(ratio) < 1 or round(ratio) > MOST_SUBSTEPS or abs(ratio - round(ratio)) > WHOLE * ratio:
            raise ValueError(
                f"expected controller.period_s a whole multiple of plant.step_s, 1 to {MOST_SUBSTEPS} times,"
                f" received {self.controller.period_s!r} and {self.plant.step_s!r} s"
            )
        known_s = self.nominal.delay_s
        if known_s is not None and known_s > MOST_DELAY * self.controller.period_s:
            raise ValueError(
                f"expected nominal.delay_s of at most {MOST_DELAY} control periods, received {known_s!r} s"
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
        """Whether the controller looks for groups that do not follow."""
        return self.detector.detect or any(fault.detect for fault in self.fault)

    @property
    def senses_currents(self) -> bool:
        """True if there are sensors of the group currents."""
        return self.detects or self.sensors.current.noise_A > 0

    @property
    def measures_truth(self) -> bool:
        """True if the controller is handed the true angles and rates, whatever fails."""
        faulty = any(fault.kind.measured for fault in self.fault)
        return self.sensors.ideal and not faulty and self.estimator.kind == "ideal"

    @property
    def supervises_groups(self) -> bool:
        """Whether groups may fail, or are looked after."""
        return bool(self.fault) or self.detects

    @property
    def ticks(self) -> int:
        """Control ticks of the run."""
        return int(self.duration / self.controller.period_s * (1 + WHOLE))

    @property
    def substeps(self) -> int:
        """Physics steps in a control period."""
        return round(self.controller.period_s / self.plant.step_s)


class ResolvedPlant(Plant):
    """Plant of a run. Without a gravity of its own, that of the model file acts, whatever its direction."""

    group_gain: tuple[Bounded, ...]
    initial_rad: Triple


class ResolvedNominal(Nominal):
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
    """Class of scenarios with a law: the common one, or one whose laws are those shipped and a user's.

    Raises
    ------
    InputError
        The law is one in a file, and cannot be had.
    """
    return _extended(parameters_of(law)) if is_reference(law) else Scenario


def kind_of_scenario(scenario: Scenario) -> type[Scenario]:
    """Class of the scenarios with the law of a scenario, as it was read."""
    controller = scenario.controller
    if is_reference(controller.law) and isinstance(controller, LawParameters):
        return _extended(type(controller))
    return Scenario


@lru_cache(maxsize=32)
def _extended(own: type[LawParameters]) -> type[Scenario]:
    laws: Any = Annotated[get_args(AnyLaw)[0] | own, Field(discriminator="law")]

    class Extended(Scenario):
        controller: SerializeAsAny[laws] = Scenario.model_fields["controller"].default

        def __reduce__(self) -> tuple[Any, ...]:
            """A class made for a file is made anew where it is unpickled; what the scenario holds stays."""
            return _blank, (own.model_fields["law"].default,), self.__getstate__()

    Extended.__name__ = Extended.__qualname__ = Scenario.__name__
    return Extended


def _blank(law: str) -> Scenario:
    kind = scenario_with(law)
    return kind.__new__(kind)
