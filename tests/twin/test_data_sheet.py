"""The controller's data sheet: who writes it, what it does not follow, and what stays out of its reach."""

import json
import pickle
from pathlib import Path

import numpy as np
import pytest

from spheretwin import scenario as scenarios
from spheretwin.control.allocation import ALLOCATIONS
from spheretwin.control.allocation.least_norm import allocate
from spheretwin.control.law import Law
from spheretwin.models import actuator as actuators
from spheretwin.models.base.record import is_rows
from spheretwin.models.lagrangian import loaded_inertia
from spheretwin.scenario.fields import every_field, fields_of, kind_of
from spheretwin.scenario.sections import ResolvedScenario, Scenario
from spheretwin.scenario.writing import as_command, as_toml
from spheretwin.session import Session
from spheretwin.simulation import simulate
from tests.twin.session_cases import write_curve

# Every part of a controller is at work: estimator, governor, prediction, feed-forward, detector, watchdog.
WHOLE = {
    "hardware": "electronics", "controller.law": "adrc", "detector.detect": True, "duration": 0.2,
    "controller.governor.acceleration_rad_s2": 20.0, "controller.prediction.on": True,
    "controller.feed_forward.friction": 0.8, "controller.feed_forward.inertia": 1.0,
    "sensors.potentiometer.hysteresis_rad": 2e-4,
}  # fmt: skip

# Numerics and the start are no knowledge; a model file is another machine; the curve has a test of its own.
NOT_TRUTH = {
    f"plant.{name}"
    for name in (
        "engine",
        "step_s",
        "integrator",
        "initial_rad",
        "initial_rad_s",
        "mjcf",
        "torque_curve",
        "learned_torque.file",
        "learned_torque.sha256",
    )
}

ARRAY = "sensors.hall."
"""Fields of an array, which takes the place of other sensors."""


def other_value(value):
    """Return another value of a field."""
    if isinstance(value, tuple):
        return [other_value(inside) for inside in value]
    if isinstance(value, bool | int):
        return not value if isinstance(value, bool) else value + 1
    return 1.25 * value if value else 1e-5


def other_truth():
    """Return another value of everything that is true of plant, drive and sensors."""
    truth = {
        name: other_value(value)
        for name, value, _ in fields_of(scenarios.load("tilt", WHOLE))
        if name.partition(".")[0] in ("plant", "drive", "sensors")
        and name not in NOT_TRUTH
        and not name.startswith(ARRAY)
    }
    return truth | STATED


# Fields that the scenario gives no number, and one that is a multiple of the step.
STATED = {
    "plant.end_stops.on": True,
    "drive.delay_s": 5e-3,
    "plant.poles.errors": [[0.01, 1e-3, 1e-3, 1e-4]] * 16,
    "plant.coils.errors": [[0.01, 1e-3, 1e-3, 1e-4]] * 36,
    "plant.gravity_m_s2": 5.0,
    "plant.group_gain": [0.9] * 18,
    "plant.thermal.rotor_degC": 60.0,
    "plant.thermal.remanence_per_K": -0.002,
    "plant.thermal.knee_degC": 70.0,
    "plant.thermal.stator_heat_capacity_J_K": 1250.0,
    "plant.thermal.rotor_heat_capacity_J_K": 1125.0,
    "plant.thermal.stator_to_ambient_K_W": 1.0,
    "plant.thermal.air_gap_K_W": 2.5,
    "plant.thermal.rotor_to_ambient_K_W": 6.0,
    "drive.time_constant_s": None,
    "drive.shutdown_degC": 100.0,
    "drive.current_limit_A": 4.0,
    "drive.resistance_ohm": 2.0,
    "drive.inductance_H": 2e-3,
    "drive.resistance_per_K": 0.0039,
    "drive.heat_capacity_J_K": 75.0,
    "drive.thermal_resistance_K_W": 5.0,
}
TRUTH = other_truth()


def resolved(name="tilt", **changes):
    with Session(scenarios.load(name, changes)) as session:
        return session.scenario


def numbers(part, path=""):
    """Every number of a controller by its place; what is computed anew in each tick is left out."""
    if isinstance(part, tuple) or is_rows(part):
        names = part.dtype.names if is_rows(part) else getattr(part, "_fields", range(len(part)))
        values = [part[name] for name in names] if is_rows(part) else part
        inside = [numbers(value, f"{path}.{name}") for name, value in zip(names, values, strict=True)]
        return {place: value for each in inside for place, value in each.items()}
    computed = path.rpartition(".")[2] in ("scratch", "G")
    return {} if computed else {path: np.asarray(part).tobytes()}


def controller(changes):
    with Session(scenarios.load("tilt", changes)) as session:
        return numbers(session._runtime._assembly.controllers)


@pytest.fixture(scope="module")
def whole():
    return controller(WHOLE)


def test_the_list_of_what_is_true_is_complete():
    leaves = {name for name, field in every_field(Scenario) if not kind_of(field)}
    of_the_truth = {name for name in leaves if name.partition(".")[0] in ("plant", "drive", "sensors")}
    of_the_truth -= {name for name in of_the_truth if name.startswith(ARRAY)}
    assert of_the_truth == set(TRUTH) | NOT_TRUTH


@pytest.mark.parametrize("dotted", TRUTH)
def test_a_change_of_the_truth_does_not_reach_the_controller(dotted, whole):
    changes = WHOLE | {dotted: TRUTH[dotted]}
    assert resolved(**changes).nominal == resolved(**WHOLE).nominal
    other = controller(changes)
    assert [place for place in whole if whole[place] != other[place]] == []


@pytest.mark.parametrize("hardware", ["ideal", "electronics"])
def test_where_the_sheet_is_right_it_equals_the_truth(hardware):
    stated = resolved("hold", hardware=hardware).nominal
    true = resolved("hold", hardware=hardware, **{"nominal.equals_truth": True}).nominal
    assert true.equals_truth
    assert true.model_copy(update={"equals_truth": False}) == stated


def test_a_nominal_model_that_equals_the_truth_is_recorded_with_its_values(actuator):
    fields = {
        "plant.modelling_error": 0.4, "plant.payload_kg": 0.04, "plant.coulomb_Nm": [5e-3] * 3,
        "drive.supply_V": 12.0, "drive.drop_up_V": 9.0, "drive.drop_down_V": 9.0,
        "drive.bandwidth_rad_s": 1e3, "drive.transconductance_A_V": 0.5, "drive.amplifier_offset_V": 1e-2,
        "drive.current_limit_A": 4.0, "drive.dac_bits": 16, "drive.dac_range_V": 12.0,
        "drive.dac_offset_V": 1e-2, "drive.dac_inl_lsb": 8.0, "drive.dac_gain_error": 1e-2,
        "drive.resistance_ohm": 2.0, "drive.inductance_H": 2e-3,
        "sensors.current.noise_A": 0.2, "sensors.encoder.counts": 500,
    }  # fmt: skip
    scenario = resolved(**WHOLE | fields | {"nominal.equals_truth": True, "nominal.delay_s": 2e-3})
    nominal, height_m = scenario.nominal, actuator.payload_mount_m[2]
    assert nominal.equals_truth
    inertia = loaded_inertia(1.4 * actuator.inertia, 0.04, height_m)
    assert nominal.inertia_kg_m2 == tuple(inertia.tolist())
    assert nominal.coulomb_Nm == (5e-3,) * 3
    assert (nominal.swing_V, nominal.time_constant_s, nominal.current_limit_A) == (3.0, 1e-3, 4.0)
    assert (nominal.resistance_ohm, nominal.inductance_H) == (2.0, 2e-3)
    assert nominal.current_noise_A == 0.2
    assert nominal.gain_error == 1e-2
    # 0.5 A a volt; 10 mV of the amplifier, 10 mV of the converter and 8.5 steps of 24 V / 2^16.
    assert nominal.offset_error_A == pytest.approx(0.5 * (2e-2 + 8.5 * 24 / 2**16))
    assert nominal.angle_resolution_rad[2] == pytest.approx(2 * np.pi / 500)
    assert nominal.delay_s == 2e-3  # what the user states counts


@pytest.mark.parametrize("at_start", [True, False])
def test_the_truth_is_read_once(at_start):
    """Where it is stated to be known, at the start or during a run."""
    changes = {"nominal.equals_truth": at_start, "nominal.torque_scale": 1.0 if at_start else 1.1}
    with Session(scenarios.load("hold", changes | {"plant.coulomb_Nm": [1e-3] * 3})) as session:
        assert (session.scenario.nominal.coulomb_Nm == (1e-3,) * 3) is at_start
        session.set("nominal.equals_truth", True)
        known = session.scenario.nominal
        assert (known.coulomb_Nm, known.torque_scale) == ((1e-3,) * 3, 1.0)
        session.set("plant.coulomb_Nm", [4e-3] * 3)
        session.set("drive.supply_V", None)
        session.set("plant.torque_curve", str(actuators.TORQUE_CURVE_PATH))
        assert session.scenario.nominal == known
        assert session.scenario.plant.coulomb_Nm == (4e-3,) * 3
        restored = pickle.loads(pickle.dumps(session.snapshot())).scenario
        assert isinstance(restored, ResolvedScenario)
        assert restored == session.scenario
        session.set("nominal.equals_truth", False)
        assert session.scenario.nominal.coulomb_Nm == (1e-3,) * 3


@pytest.mark.parametrize("knows", [False, True])
def test_a_resolved_scenario_written_down_is_the_same_when_it_is_read_again(knows, tmp_path):
    changes = {"hardware": "electronics", "nominal.equals_truth": knows, "plant.coulomb_Nm": [3e-3] * 3}
    scenario = resolved(**changes)
    (tmp_path / "again.toml").write_text(as_toml(scenario))
    again = resolved(str(tmp_path / "again.toml"))
    assert again.nominal == scenario.nominal
    assert again.plant == scenario.plant
    assert ("--nominal.equals-truth true" in as_command(scenario)) is knows


# --- torque curves and model files


@pytest.fixture
def half(tmp_path, actuator):
    return write_curve(tmp_path / "half.csv", actuator.torque_curve, 0.5)


def first_row(changes):
    with Session(scenarios.load("hold", {"controller.law": "pd", **changes})) as session:
        return session.advance(1), session.scenario.nominal.torque_curve


def test_another_curve_of_the_shipped_machine_is_the_truth_alone(half):
    shipped, name = first_row({})
    assert name == "shipped"
    weak, name = first_row({"plant.torque_curve": half})
    assert name == "shipped"
    np.testing.assert_array_equal(weak["current_command_A"], shipped["current_command_A"])
    # Samples are halved without rounding; the spline through them rounds anew.
    np.testing.assert_allclose(weak["torque_Nm"], 0.5 * shipped["torque_Nm"], rtol=1e-9, atol=1e-12)


def test_the_curve_of_a_machine_of_one_s_own_is_in_its_data_sheet(half):
    own = {"plant.mjcf": str(actuators.MJCF_PATH), "plant.torque_curve": half}
    shipped, _ = first_row({})
    weak, name = first_row(own)
    assert name == half
    # The controller knows that it takes twice the current, and the torque is the commanded one.
    for signal, factor in (("current_command_A", 2.0), ("torque_Nm", 1.0)):
        np.testing.assert_allclose(weak[signal], factor * shipped[signal], rtol=1e-9, atol=1e-12)
    _, name = first_row(own | {"nominal.torque_curve": "shipped"})
    assert name == "shipped"


@pytest.mark.parametrize("fields", [{"nominal.equals_truth": True}, {"plant.mjcf": str(actuators.MJCF_PATH)}])
def test_a_curve_that_was_resolved_does_not_follow_a_later_one(fields, half):
    with Session(scenarios.load("hold", fields | {"controller.law": "pd"})) as session:
        nominal = session._config.files.nominal.torque_curve
        session.set("plant.torque_curve", half)
        assert session.scenario.nominal.torque_curve == "shipped"
        assert session._config.files.nominal.torque_curve is nominal
        assert session.actuator.torque_curve.peak_Nm_per_A == 0.5 * nominal.peak_Nm_per_A


def test_only_the_nominal_curve_has_a_shipped_file_by_name(tmp_path, half):
    """A file of the user's named so is found beside the scenario that names it."""
    (tmp_path / "shipped").write_text(Path(half).read_text())
    sections = "".join(f'[{name}]\ntorque_curve = "shipped"\n' for name in ("plant", "nominal"))
    (tmp_path / "s.toml").write_text(f'[trajectory]\nshape = "hold"\n{sections}')
    read = scenarios.load(str(tmp_path / "s.toml"))
    assert (read.plant.torque_curve, read.nominal.torque_curve) == (str(tmp_path / "shipped"), "shipped")


# --- older records


def test_a_record_of_a_version_without_a_data_sheet_knows_drive_and_sensors_as_they_were():
    scenario = resolved("hold", hardware="electronics", **{"drive.supply_V": 12.0, "nominal.delay_s": 0.0})
    fields = json.loads(scenario.model_dump_json())
    older = (
        "torque_scale", "inertia_kg_m2", "current_limit_A", "coulomb_Nm", "viscous_Nm_s", "time_constant_s",
        "delay_s",
    )  # fmt: skip
    fields["nominal"] = {name: fields["nominal"][name] for name in older} | {"torque_curve": None}
    with Session(scenarios.from_record(fields, "older")) as session:
        nominal = session.scenario.nominal
    assert (nominal.swing_V, nominal.current_noise_A, nominal.delay_s) == (12.0 - 4.8, 0.02, 0.0)
    assert nominal.angle_noise_rad == scenario.nominal.angle_noise_rad
    assert nominal.inertia_kg_m2 == scenario.nominal.inertia_kg_m2


# --- what law and allocation write reaches nothing else


def overwriting(G, torque_S, limit, current, scratch):
    """The least-norm allocation, which leaves nothing of what it was handed."""
    share = allocate(G, torque_S, limit, current)
    G[:] = 0.0
    torque_S[:] = np.nan
    scratch[:] = np.nan
    return share


ESO = {"detector.detect": True, "controller.law": "afsm_eso"}


@pytest.mark.parametrize("changes", [{}, WHOLE, ESO], ids=["plain", "whole", "eso"])
def test_an_allocation_that_overwrites_its_arguments_changes_no_byte(changes, monkeypatch):
    scenario = scenarios.load("hold", {"duration": 0.2, **changes})
    plain = simulate(scenario).telemetry
    assert np.abs(plain["torque_Nm"]).max() > 1e-3
    monkeypatch.setitem(ALLOCATIONS, "least_norm", overwriting)
    assert simulate(scenario).telemetry.values.tobytes() == plain.values.tobytes()


WHOLE_LOOP = pytest.mark.release("2.5 s; the ideal loop takes 0.1 s")


def springy(t, reference, measurement, parameters, state, torque):
    for i in range(3):
        error, rate = measurement[0, i] - reference[0, i], measurement[1, i] - reference[1, i]
        torque[i] = -2.0 * error - 0.1 * rate


def careless(t, reference, measurement, parameters, state, torque):
    springy(t, reference, measurement, parameters, state, torque)
    reference[:] = np.nan
    measurement[:] = np.nan


@pytest.mark.parametrize(
    "whole",
    [False, pytest.param(True, marks=[pytest.mark.uncompiled, WHOLE_LOOP])],
)
def test_a_law_that_overwrites_its_arguments_changes_no_byte(whole):
    parts = {name: value for name, value in WHOLE.items() if name != "controller.law"}
    scenario = scenarios.load("hold", parts if whole else {"duration": 0.2})
    tidy, other = (
        simulate(scenario, law=Law("own", step, [], [], asks_torque=whole)).telemetry
        for step in (springy, careless)
    )
    assert other.values.tobytes() == tidy.values.tobytes()
