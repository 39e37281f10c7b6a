"""Sections of the true plant and of the controller's data sheet of it."""

from __future__ import annotations

from typing import TYPE_CHECKING, Annotated, Literal

from pydantic import BaseModel, ConfigDict, Field, field_validator

from spheretwin.control.law import NonNegative, Positive
from spheretwin.electronics.drive_section import TimeConstant
from spheretwin.models.coil_group import PerGroup
from spheretwin.plant.bristle_friction import StictionSection
from spheretwin.plant.cable import CableSection
from spheretwin.plant.end_stops import EndStopsSection
from spheretwin.plant.magnet_heat import ResolvedThermal, ThermalSection
from spheretwin.plant.mass_properties import MassSection
from spheretwin.plant.part_scatter import PartScatter
from spheretwin.plant.parts import PartSections
from spheretwin.plant.plant_tick import ENGINES
from spheretwin.scenario.fields import SHIPPED
from spheretwin.trajectories.rounding import Bounded, Triple

NonNegativeTriple = tuple[NonNegative, NonNegative, NonNegative]
Play = Annotated[float, Field(ge=0, le=0.5)]
Share = Annotated[float, Field(ge=-1, le=1)]

# A torque matrix near zero needs infinite currents.
LEAST_SCALE = 1e-3

if TYPE_CHECKING:
    EngineName = str
else:
    EngineName = Literal[tuple(ENGINES)]


class Section(BaseModel):
    """Section of a scenario: frozen, without unknown fields."""

    model_config = ConfigDict(frozen=True, extra="forbid", strict=True, allow_inf_nan=False)


class PlantSection(PartSections, Section):
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
    coulomb_asymmetry: tuple[Share, Share, Share] = Field(
        (0.0, 0.0, 0.0),
        description="relative excess of the Coulomb friction of each hinge towards positive angles, -1 to 1;"
        " as much is missing towards negative angles",
    )
    viscous_Nm_s: NonNegativeTriple = Field(
        (0.0, 0.0, 0.0), description="viscous friction of each hinge, N·m·s, in addition to that of the model"
    )
    friction_smoothing_rad_s: Annotated[float, Field(ge=1e-9, le=1e3)] = Field(
        0.01,
        description="rate over which Coulomb friction changes sign, rad/s; not used with plant.stiction.on",
    )
    backlash_rad: tuple[Play, Play, Play] = Field(
        (0.0, 0.0, 0.0),
        description="play between the rotor and the shaft of each hinge whose angle is measured, rad",
    )
    stiction: StictionSection = StictionSection()
    cable: CableSection = CableSection()
    end_stops: EndStopsSection = EndStopsSection()
    thermal: ThermalSection = ThermalSection()
    group_gain: tuple[Bounded, ...] | None = Field(
        None, description="torque per ampere of each group over that of the torque curve; 1 unless given"
    )
    mass: MassSection = MassSection()
    poles: PartScatter = PartScatter()
    coils: PartScatter = PartScatter()
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
        description="torque curve or torque field as CSV; that of the model file unless given",
        json_schema_extra={"path": True},
    )


class NominalSection(Section):
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
        description="torque curve or field as CSV, or `shipped`, the model file's; shipped unless given,"
        " and with a plant.mjcf, which is another machine, plant.torque_curve",
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
        None,
        description="Coulomb friction of each hinge, N·m; 0 unless given; unused without feed-forward",
    )
    viscous_Nm_s: NonNegativeTriple | None = Field(
        None,
        description="viscous friction of each hinge, N·m·s; 0 unless given; unused without feed-forward",
    )
    delay_s: Annotated[float, Field(ge=0, le=1)] | None = Field(
        None, description="delay from a command to the amplifiers, s; 0 unless given"
    )
    time_constant_s: TimeConstant | tuple[TimeConstant, ...] | None = Field(
        None,
        description="lag of the currents, one number or one for each group, s; L/R of the model file unless"
        " given",
    )
    resistance_ohm: Positive | tuple[Positive, ...] | None = Field(
        None,
        description="resistance of a group, one number or one for each, ohm; the model file's unless given",
    )
    inductance_H: Positive | tuple[Positive, ...] | None = Field(
        None,
        description="inductance of a group, one number or one for each, H; the model file's unless given",
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


class ResolvedPlant(PlantSection):
    """Plant of a run. Without `gravity_m_s2` the gravity of the model file acts, in any direction."""

    thermal: ResolvedThermal
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
    time_constant_s: PerGroup
    resistance_ohm: PerGroup
    inductance_H: PerGroup
    swing_V: NonNegative
    offset_error_A: NonNegative
    gain_error: NonNegative
    angle_noise_rad: NonNegativeTriple
    angle_resolution_rad: NonNegativeTriple
    current_noise_A: NonNegative
