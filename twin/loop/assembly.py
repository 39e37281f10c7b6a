"""Assembly of the loop from a resolved scenario: law, controller, plant, telemetry columns."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any, NamedTuple, TypeVar

import numpy as np

from spheretwin.control.allocation import ALLOCATIONS
from spheretwin.control.applied_torque import fill_applied_torque
from spheretwin.control.compensators.feed_forward import NominalRotor, fill_feed_forward
from spheretwin.control.compensators.prediction import DelayModel, fill_prediction
from spheretwin.control.compensators.reference_governor import fill_governor
from spheretwin.control.controller import Controller, ControllerData, controller
from spheretwin.control.estimators.estimator import Estimator, Sampling
from spheretwin.control.law import Law, NominalModel
from spheretwin.control.laws import LAWS
from spheretwin.electronics.hall_array import HallArray, fill_hall
from spheretwin.electronics.hall_array import sizes_of as hall_sizes
from spheretwin.electronics.sensor_chain import SensorChain, fill_sensors
from spheretwin.faults.schedule import part_names
from spheretwin.loop.channels import CHANNELS
from spheretwin.loop.closed_loop import Functions, dispatch
from spheretwin.loop.hardware_assembly import delays_of, fill_drive_of, fill_supervision
from spheretwin.loop.stages import Stages, compiled_stages, plant_stage
from spheretwin.models.actuator import Actuator
from spheretwin.models.base.columns import Columns
from spheretwin.models.base.errors import InputError, SpheretwinError, exception_text, shown
from spheretwin.models.base.record import Record, Rows, field, put
from spheretwin.models.base.reuse import reused
from spheretwin.models.magnetics import Tables, TorqueModel, scaled, torque_model
from spheretwin.models.scatter import scattered_model
from spheretwin.models.telemetry.signals import Signal, common_signals, width
from spheretwin.plant.mass_properties import mass_errors
from spheretwin.plant.part_scatter import scatter_of
from spheretwin.plant.parts import PARTS
from spheretwin.plant.plant_part import PlantSetup
from spheretwin.plant.plant_tick import ENGINES, Plant
from spheretwin.plant.rotor import Rotor, RotorSettings
from spheretwin.scenario.files import Files
from spheretwin.scenario.plant_sections import ResolvedNominal, ResolvedPlant
from spheretwin.scenario.sections import ResolvedScenario

T = TypeVar("T")


def law_of(scenario: ResolvedScenario) -> Law:
    """Return the law of a resolved scenario, for its nominal model.

    Raises
    ------
    InputError
        A user law that returns no `Law`, or one for another control period.
    """
    section, nominal = scenario.controller, scenario.nominal
    return (_shipped_law if section.law in LAWS else _built_law)(section, nominal)


def _built_law(section: Any, nominal: ResolvedNominal) -> Law:
    try:
        law = section.build(_known_to(section, nominal))
    except (SpheretwinError, KeyboardInterrupt):
        raise
    except BaseException as error:  # the user's code may raise anything
        raise InputError(
            f"law {section.law}: expected build(known) to make a Law, received {exception_text(error)}"
        ) from error
    if not isinstance(law, Law):
        raise InputError(f"law {section.law}: expected build(known) to make a Law, received {shown(law)}")
    law.check_period(section.period_s)
    return law


_shipped_law = reused(_built_law)
"""A law of this package holds no state: runs copy its memory."""


def same_nominal_model(scenario: ResolvedScenario, other: ResolvedScenario) -> bool:
    """True if the laws of both scenarios receive the same nominal model."""
    first, second = _known(scenario), _known(other)
    same = np.array_equal(first.inertia, second.inertia)
    return same and first._replace(inertia=second.inertia) == second


def _known(scenario: ResolvedScenario) -> NominalModel:
    return _known_to(scenario.controller, scenario.nominal)


@reused
def _known_to(section: Any, nominal: ResolvedNominal) -> NominalModel:
    ahead_s, inertia = nominal.delay_s * section.prediction.on, np.array(nominal.inertia_kg_m2)
    return NominalModel(section.period_s, nominal.delay_s - ahead_s, inertia, ahead_s)


def signals_of(scenario: ResolvedScenario, actuator: Actuator, law: Law) -> tuple[Signal, ...]:
    """Return the telemetry columns of a run: common columns, channels of its stages, signals of the law.

    Raises
    ------
    InputError
        A signal of the law has the name of a signal of a stage.
    """
    groups = len(actuator.groups)
    taken = {signal.name for channel in CHANNELS for signal in channel.signals(groups)}
    if duplicates := sorted(taken & {signal.name for signal in law.signals}):
        raise InputError(f"law {law.name}: expected new names of signals, received {', '.join(duplicates)}")
    signals = common_signals(groups)
    for channel in CHANNELS:
        if channel.logged(scenario):
            signals += channel.signals(scenario.sensors.hall.readings if channel.of_readings else groups)
    return signals + law.signals


def nominal_magnetics(scenario: ResolvedScenario, files: Files) -> TorqueModel:
    """Return the magnetics of the data sheet of the controller."""
    return scaled(torque_model(files.nominal), scenario.nominal.torque_scale)


def estimator_of(scenario: ResolvedScenario) -> Estimator | None:
    """Return the rate estimator, tuned to the nominal sensors; None if the rates are exact.

    Raises
    ------
    InputError
        The parameters do not fit the control period or the sensors.
    """
    return _estimator_of(scenario.estimator, scenario.nominal, scenario.controller)


@reused
def _estimator_of(section: Any, nominal: ResolvedNominal, controller: Any) -> Estimator | None:
    noise_rad, quantum_rad = np.array(nominal.angle_noise_rad), np.array(nominal.angle_resolution_rad)
    estimator: Estimator | None = section.build(Sampling(controller.period_s, noise_rad, quantum_rad))
    return estimator


class RunData(Record):
    """Data of a run, except those that laws and estimators declare themselves."""

    plant: Plant = field("true plant", delays="drive_delays")
    sensors: SensorChain = field("sensors of the angles", delays="sensor_delays")
    controller: ControllerData = field(
        "controller",
        lines="nominal_lines",
        pairs="nominal_pairs",
        coils="nominal_coils",
        delays="command_delays",
    )


class HallRunData(Record):
    """Data of a run with a Hall array."""

    plant: Plant = RunData.plant
    sensors: SensorChain = RunData.sensors
    controller: ControllerData = RunData.controller
    hall: HallArray = field("Hall array")


def empty_run(
    scenario: ResolvedScenario,
    true: TorqueModel,
    nominal: TorqueModel,
    runs: int = 1,
    hall: Mapping[str, int] | None = None,
) -> Rows:
    """Return an array of RunData of the sizes of a scenario, in which all numbers are 0.

    With the sizes of a Hall array it is an array of HallRunData.
    """
    sizes = true.sizes | {f"nominal_{name}": size for name, size in nominal.sizes.items()}
    parts = len(part_names(sizes["groups"]))
    sizes |= {"parts": parts, **delays_of(scenario)}
    return HallRunData.zeros(runs, **sizes, **hall) if hall else RunData.zeros(runs, **sizes)


class Assembly(NamedTuple):
    """Parts of the runs of some scenarios at their start."""

    scenario: ResolvedScenario
    """Of one run, or the columns of those of many."""
    rows: Rows
    """Array of RunData."""
    rotor: Rotor
    law: Law
    """Of the first run; others differ from it in numbers alone."""
    signals: tuple[Signal, ...]
    controllers: Controller
    tables: Tables
    """Of the true magnetics of all runs."""
    functions: Functions

    @property
    def law_signals(self) -> int:
        """First column of the signals of the law."""
        return width(self.signals) - width(self.law.signals)

    def stages(self) -> Stages:
        """Compile the stages of the runs."""
        parts = {name: self.rows[name] for name in self.rows.dtype.names or ()}
        stage = plant_stage(parts["plant"], self.tables, self.scenario.plant.engine)
        return compiled_stages(parts, stage, self.signals)


def assembled(
    scenario: ResolvedScenario,
    files: Files,
    law: Law | None = None,
    rotor: Rotor | None = None,
) -> Assembly:
    """Return the parts of some runs at their start.

    Parameters
    ----------
    scenario : ResolvedScenario, or Columns of them
    files : Files
        Model and torque curves of all runs.
    law : Law, optional
        Of all runs; default: those of the scenarios.
    rotor : Rotor, optional
        Started; default: one that starts at the initial poses and rates of the scenarios.

    Raises
    ------
    InputError
        The engine does not support the model, or a law cannot be used.
    MixedRowsError
        The scenarios differ in something else than numbers.
    """
    runs = len(_runs(scenario))
    laws = [law] * runs if law else _of_each(law_of, scenario, scenario.controller, scenario.nominal)
    sensing = scenario.estimator, scenario.nominal, scenario.controller
    estimators = _of_each(estimator_of, scenario, *sensing)
    nominal, true = (
        nominal_magnetics(scenario, files),
        true_magnetics(scenario.plant, scenario.seed, files.actuator),
    )
    rotor = rotor or started_rotor(scenario, files)
    hall = scenario.sensors.hall.on and hall_sizes(scenario.sensors.hall, files.actuator)
    rows = empty_run(scenario, true, nominal, runs, hall or None)
    controllers = controllers_of(rows["controller"], scenario, laws, nominal, estimators, files.nominal)
    fill_sensors(rows["sensors"], scenario.sensors, scenario.seed, bool(scenario.fault))
    fill_plant(rows["plant"], scenario, files.actuator, true, rotor.rows)
    if hall:
        for row, run in enumerate(_runs(scenario)):
            machine = files.actuator, scatter_of(run.plant, run.seed, files.actuator)
            section, period_s = run.sensors.hall, run.controller.period_s
            fill_hall(rows["hall"][row : row + 1], section, *machine, period_s, run.seed)
    estimate = estimators[0].step if estimators[0] else None
    return Assembly(
        scenario,
        rows,
        rotor,
        laws[0],
        signals_of(_runs(scenario)[0], files.actuator, laws[0]),
        controllers,
        true.tables,
        dispatch(
            laws[0],
            ALLOCATIONS[scenario.allocation],
            estimate,
            check_bounds=scenario.controller.check_bounds,
        ),
    )


def _of_each(build: Callable[[ResolvedScenario], T], scenario: ResolvedScenario, *sections: Any) -> list[T]:
    """Return what is built from some sections of each run; once if all runs share them."""
    runs = _runs(scenario)
    if not any(isinstance(section, Columns) for section in sections):
        return [build(runs[0])] * len(runs)
    return [build(run) for run in runs]


def _runs(scenario: Any) -> list[ResolvedScenario]:
    return list(scenario) if isinstance(scenario, Columns) else [scenario]


def controllers_of(
    rows: Rows,
    scenario: ResolvedScenario,
    laws: list[Law],
    magnetics: TorqueModel,
    estimators: list[Estimator | None],
    actuator: Actuator,
) -> Controller:
    """Return the controllers of some runs at their start.

    Parameters
    ----------
    rows : array of ControllerData
        Filled.
    scenario : ResolvedScenario, or Columns of them
    laws : list of Law
        One for each run.
    magnetics : TorqueModel
        Nominal.
    estimators : list of Estimator or None
    actuator : Actuator
        Nominal.
    """
    nominal, period_s = scenario.nominal, scenario.controller.period_s
    made = controller(rows, laws, estimators, magnetics, nominal.current_limit_A)
    on = laws[0].asks_torque | scenario.detects | scenario.controller.prediction.on
    fill_applied_torque(rows["applied_torque"], on, period_s, nominal.delay_s, nominal.time_constant_s)
    _fill_compensators(rows["compensators"], scenario)
    fill_supervision(rows["supervision"], scenario, actuator)
    put(rows["manual"], on=scenario.manual.on)
    return made


def _fill_compensators(rows: Rows, scenario: ResolvedScenario) -> None:
    section, nominal, known = scenario.controller, scenario.nominal, _known(scenario)
    delay = DelayModel(known.period_s, known.ahead_s, nominal.time_constant_s, known.inertia)
    rotor = NominalRotor(known.inertia, nominal.coulomb_Nm, nominal.viscous_Nm_s)
    put(rows, on=section.governor.on | section.prediction.on | section.feed_forward.on)
    fill_governor(rows["governor"], section.governor, known.period_s)
    fill_prediction(rows["prediction"], section.prediction, delay)
    fill_feed_forward(rows["feed_forward"], section.feed_forward, rotor, known.period_s, known.delay_s)


def true_magnetics(section: ResolvedPlant, seed: int, actuator: Actuator) -> TorqueModel:
    """Return the magnetics of the true plant, with the scatter of its poles and coils."""
    scatter = scatter_of(section, seed, actuator)
    return scattered_model(actuator, scatter) if scatter else torque_model(actuator)


def fill_plant(
    rows: Rows, scenario: ResolvedScenario, actuator: Actuator, magnetics: TorqueModel, rotor: Rows
) -> None:
    """Fill the plant of a resolved scenario, at rest.

    Parameters
    ----------
    rows : array of Plant
        In which all numbers are 0.
    scenario : ResolvedScenario
    actuator : Actuator
    magnetics : TorqueModel
        Of `true_magnetics`.
    rotor : array of RotorData
        Started.
    """
    section = scenario.plant
    rows["rotor"], rows["arrangement"], rows["last_qdot"] = rotor, magnetics.arrangement, rotor["qdot"]
    rows["joint_q"] = rotor["q"]
    fill_drive_of(rows["drive"], scenario, actuator)
    put(rows["current_sensors"], on=scenario.senses_currents, noise_A=scenario.sensors.current.noise_A)
    setup = PlantSetup(scenario, actuator, rotor, rows["drive"])
    for name, part in PARTS.items():
        part.fill(rows["parts"][name], setup)
    put(rows, group_gain=section.group_gain, unmodelled_torque=section.modelling_torque_Nm)
    put(rows, substeps=scenario.substeps, step_s=section.step_s)
    rows["hinge_range"], rows["fault_start_s"] = actuator.hinge_range_rad, -1.0


def started_rotor(scenario: ResolvedScenario, files: Files) -> Rotor:
    """Return the rotor of a resolved scenario at its initial pose and rates; errors as `rotor_of`."""
    rotor, section = rotor_of(scenario, files), scenario.plant
    rotor.start(np.array(section.initial_rad), np.array(section.initial_rad_s))
    return rotor


def rotor_of(scenario: ResolvedScenario, files: Files) -> Rotor:
    """Return the rotor of a resolved scenario, in its engine.

    Raises
    ------
    InputError
        The engine does not support the model.
    """
    return ENGINES[scenario.plant.engine].set_up(_rotor_settings(scenario, files))


def _rotor_settings(scenario: ResolvedScenario, files: Files) -> RotorSettings:
    section = scenario.plant
    return RotorSettings(
        model=files.model,
        actuator=files.actuator,
        step_s=section.step_s,
        integrator=section.integrator,
        modelling_error=section.modelling_error,
        payload_kg=section.payload_kg,
        gravity_m_s2=section.gravity_m_s2,
        mass=mass_errors(section.mass, scenario.seed),
        rows=len(_runs(scenario)),
    )
