"""Set-up of many runs at once: every row has the bytes of the run alone, whatever numbers differ."""

import numpy as np
import pytest

from spheretwin import scenario as scenarios
from spheretwin.config.active_config import fill_defaults
from spheretwin.control.estimators import ESTIMATORS
from spheretwin.control.laws import LAWS
from spheretwin.loop.assembly import assembled
from spheretwin.models.base.columns import Columns, MixedRowsError
from spheretwin.models.base.errors import InputError
from spheretwin.plant.plant_tick import ENGINES
from spheretwin.scenario.files import files_of

pytestmark = pytest.mark.uncompiled

ROWS = 5
PARTS = "plant", "sensors", "drive", "nominal", "controller", "detector", "watchdog", "estimator"
CLOCKS = {"period_s", "step_s"}
"""Numbers that all rows share."""

NUMBERS = {  # of fields that are 0 or derived by default
    "plant.modelling_error": 0.2,
    "plant.payload_kg": 0.05,
    "plant.gravity_m_s2": 9.0,
    "plant.coulomb_Nm": (5e-3, 4e-3, 3e-3),
    "plant.coulomb_asymmetry": (0.3, -0.5, 0.2),
    "plant.viscous_Nm_s": (1e-4, 2e-4, 3e-4),
    "plant.initial_rad": (0.1, -0.2, 0.3),
    "plant.initial_rad_s": (0.1, -0.2, 0.3),
    "plant.group_gain": (1.0,) * 18,
    "nominal.coulomb_Nm": (5e-3, 4e-3, 3e-3),
    "nominal.viscous_Nm_s": (1e-4, 2e-4, 3e-4),
    "nominal.inertia_kg_m2": (2e-3, 2e-3, 3e-3),
    "nominal.delay_s": 2e-3,
    "nominal.torque_scale": 1.1,
    "nominal.time_constant_s": (1e-4,) * 18,
    "sensors.angle_offset_rad": (1e-3, -2e-3, 3e-3),
    "controller.governor.acceleration_rad_s2": (10.0, 20.0, 30.0),
    "controller.feed_forward.friction": (0.5, 0.4, 0.3),
    "controller.feed_forward.inertia": (0.5, 0.4, 0.3),
    "detector.threshold_A": 0.1,
}
SUPPLIED = {
    "sensors.adc.skew_s": 1e-4,
    "sensors.encoder.start_error_rad": 0.1,
    "sensors.encoder.index_rad": 0.5,
    "drive.coil_coupling": 0.5,
    "drive.resistance_ohm": (1.3,) * 18,
    "drive.inductance_H": 9e-4,
    "nominal.resistance_ohm": (1.3,) * 18,
    "nominal.inductance_H": 9e-4,
}
ELEMENTS = {
    "plant.backlash_rad": (0.01, 0.0, 0.02),
    "plant.cable.neutral_rad": (0.1, -0.1, 0.2),
    "plant.cable.torque_Nm": (1e-3, 2e-3, 3e-3),
    "plant.end_stops.on": True,
    "plant.mass.centre_m": (1e-4, 2e-4, 3e-4),
    "plant.mass.axis_tilt_rad": [[1e-3, 2e-3]] * 3,
    "plant.mass.ring_inertia_kg_m2": [[2e-4, 3e-4, 2e-4]] * 2,
    "plant.thermal.rotor_degC": 25.0,
    "plant.thermal.remanence_per_K": -1e-3,
}
HARDWARE = {
    "ideal": NUMBERS | {"drive.time_constant_s": (1e-4,) * 18},
    "electronics": NUMBERS | SUPPLIED,
    "prototype": NUMBERS | SUPPLIED | ELEMENTS,
}
SWITCHES = "controller.prediction.on", "watchdog.on", "detector.detect"
ZERO_AT_TIMES = "offset_V", "gain_error", "inl_lsb", "nonlinearity_rad", "eccentricity_rad", "skew_s"
ELEMENT_SWITCHES = "plant.stiction.on", "plant.end_stops.on", "plant.thermal.on"


def numbers_of(fields, path=""):
    """Return all numbers of nested fields that may differ, by dotted name."""
    numbers = {}
    for name, value in fields.items():
        if isinstance(value, dict):
            numbers |= numbers_of(value, f"{path}{name}.")
        elif name not in CLOCKS and isinstance(value, (float, tuple)) and np.size(value):
            numbers[path + name] = np.array(value)
    return numbers


def varied(scenario, random, delay_s):
    """Return changes of every number of the parts, of the switches and of what is counted."""
    fields = scenario.model_dump(include=set(PARTS))
    numbers = {
        name: (
            value
            * random.uniform(0.8, 1.05, value.shape)
            * (not name.endswith(ZERO_AT_TIMES) or random.integers(2))
        ).tolist()
        for name, value in numbers_of(fields).items()
    }
    for name in ("drive.resistance_ohm", "nominal.resistance_ohm", "nominal.time_constant_s"):
        if name in numbers and np.size(numbers[name]) > 1 and random.integers(2):
            numbers[name] = numbers[name][0]  # one number of all groups
    switches = SWITCHES + ELEMENT_SWITCHES * (scenario.hardware == "prototype")
    changes = numbers | {name: bool(random.integers(2)) for name in switches}
    if scenario.hardware == "prototype" and random.integers(2):
        changes |= {
            name: (0.0 * value).tolist() for name, value in numbers_of(fields).items() if ".mass." in name
        }
    if scenario.hardware != "ideal":
        changes |= {"drive.dac_bits": int(random.integers(17)), "sensors.adc.bits": int(random.integers(17))}
        changes["sensors.encoder.counts"] = int(random.integers(1, 5000))
    return changes | {"seed": int(random.integers(2**40)), "drive.delay_s": delay_s * int(random.integers(4))}


def resolved(scenario, files):
    return fill_defaults(scenario, files, None, None)


def bytes_of(assembly):
    """Return the data of each run, without the addresses of MuJoCo's arrays."""
    rows = assembly.rows.copy()
    rows["plant"]["rotor"]["addresses"] = 0
    own = assembly.controllers
    laws = (own.parameters, own.memory, own.estimator_parameters, own.estimator_memory)
    return [(row.tobytes(), *(array[i].tobytes() for array in laws)) for i, row in enumerate(rows)]


def check_rows(every):
    files = files_of(every[0])
    own = [resolved(scenario, files) for scenario in every]
    assert bytes_of(assembled(Columns(own), files)) == [bytes_of(assembled(one, files))[0] for one in own]
    shared = bytes_of(assembled(Columns(own[:1] * ROWS), files))
    assert shared == bytes_of(assembled(own[0], files)) * ROWS


@pytest.mark.parametrize("engine", ENGINES)
@pytest.mark.parametrize("hardware", HARDWARE)
def test_every_row_is_that_of_the_run_alone(hardware, engine):
    random = np.random.default_rng(11)
    base = {"hardware": hardware, "plant.engine": engine, **HARDWARE[hardware]}
    scenario = scenarios.load("hold", base)
    every = [scenarios.load("hold", base | varied(scenario, random, 5e-4)) for _ in range(ROWS)]
    check_rows(every)


@pytest.mark.parametrize("law", LAWS)
def test_every_row_has_its_law(law):
    inertias = [(1e-3 * row, 2e-3, 3e-3) for row in range(1, 1 + ROWS)]
    check_rows(
        [scenarios.load("hold", {"controller.law": law, "nominal.inertia_kg_m2": own}) for own in inertias]
    )


@pytest.mark.parametrize("kind", ESTIMATORS)
def test_every_row_has_its_estimator(kind):
    changes = {"hardware": "electronics", "estimator.kind": kind}
    noises = [{"nominal.angle_noise_rad": (1e-4 * row,) * 3} for row in range(1, 1 + ROWS)]
    check_rows([scenarios.load("hold", changes | own) for own in noises])


HOT = {"plant.thermal.on": True, "plant.thermal.stator_heat_capacity_J_K": 1e-3}
WRONG = [
    {"plant.mass.products_kg_m2": [5e-3, 0.0, 0.0]},
    HOT,
]


@pytest.mark.parametrize("wrong", WRONG, ids=str)
def test_the_message_is_that_of_the_first_wrong_row(wrong):
    base = {"hardware": "prototype", "plant.engine": "lagrangian"}
    scenario, files = scenarios.load("hold", base), files_of(scenarios.load("hold", base))
    own = [resolved(scenario, files), resolved(scenarios.load("hold", base | wrong), files)]
    with pytest.raises(InputError) as alone:
        assembled(own[1], files)
    with pytest.raises(InputError) as of_many:
        assembled(Columns([*own, own[1]]), files)
    assert str(of_many.value) == str(alone.value)


SILENT = {"sensors.adc.noise_V": 0.0, "sensors.potentiometer.noise_rad": 0.0}


@pytest.mark.parametrize("other", [{"estimator.kind": "ideal"}, {"controller.law": "pid"}, SILENT], ids=str)
def test_rows_of_other_laws_estimators_or_numbers_of_draws_are_refused(other):
    base = {"hardware": "prototype", "controller.law": "pd"}
    every = [scenarios.load("hold", base | changes) for changes in ({}, other)]
    files = files_of(every[0])
    with pytest.raises(MixedRowsError):
        assembled(Columns([resolved(scenario, files) for scenario in every]), files)
