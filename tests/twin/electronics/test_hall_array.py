"""Hall array: readings against the field itself, and runs whose angles come from it."""

from dataclasses import replace

import numpy as np
import pytest

from spheretwin import scenario as scenarios
from spheretwin.config.active_config import initial_config
from spheretwin.electronics.hall_array import HallSection
from spheretwin.loop import cuda_block
from spheretwin.loop.block import RunBlock
from spheretwin.models.base.errors import InputError
from spheretwin.models.kinematics import rotation
from spheretwin.models.scatter import Scatter, part_errors
from spheretwin.models.stator_field import field_of_groups, field_of_poles
from spheretwin.session import Session
from spheretwin.simulation import simulate
from tests.twin.electronics.hall_cases import ACTUATOR, array_of, at_rest, estimates

HALL = {"sensors.hall.count": 12, "sensors.hall.noise_T": 5e-5, "sensors.hall.bits": 14}
FAST = {"plant.engine": "lagrangian", "duration": 0.3}
Q = np.array([0.3, -0.2, 0.5])
CURRENT_A = np.linspace(-3, 2, len(ACTUATOR.groups))


def readings(array, **given):
    estimates(array, at_rest(Q, 1), current_A=CURRENT_A, **given)
    return array[0][0].reading_T.copy()


def true_field(section, actuator=ACTUATOR, remanence=1.0):
    p = section.directions()
    poles = remanence * field_of_poles(actuator, section.radius_m * p, rotation(Q))
    coils = np.einsum("gni,g->ni", field_of_groups(actuator, section.radius_m * p), CURRENT_A)
    return np.sum((poles + coils) * p, axis=1)


def test_readings_are_the_radial_field_of_poles_and_coils():
    array = array_of(count=9)
    expected = true_field(array[1], remanence=0.9)
    assert readings(array, remanence=0.9) == pytest.approx(expected, abs=1e-6 * np.abs(expected).max())


def test_three_axes_measure_the_whole_field():
    array = array_of(longitude_deg=(10.0, 0.0), latitude_deg=(40.0, 90.0), axes="three")
    axes = array[0][0].geometry.axes.reshape(2, 3, 3)
    for frame in axes:
        assert frame @ frame.T == pytest.approx(np.eye(3), abs=1e-12)
        assert np.linalg.det(frame) == pytest.approx(1)
    assert axes[0, 1] @ [0, 0, 1] == pytest.approx(0, abs=1e-12)  # east
    assert axes[0, 2] @ [0, 0, 1] > 0.7  # north


def test_scatter_changes_the_readings_as_it_changes_the_machine():
    rng = np.random.default_rng(4)
    errors = [
        part_errors(rng.uniform(-1, 1, (len(axes), 4)) * [0.05, 0.01, 0.01, 0.0])
        for axes in (ACTUATOR.pole_axes, ACTUATOR.coil_axes)
    ]
    scatter = Scatter(*errors)
    machine = replace(
        ACTUATOR,
        pole_axes=scatter.poles.axes(ACTUATOR.pole_axes),
        pole_polarity=ACTUATOR.pole_polarity * (1 + scatter.poles.gain),
        coil_axes=scatter.coils.axes(ACTUATOR.coil_axes),
        coil_direction=ACTUATOR.coil_direction * (1 + scatter.coils.gain),
    )
    array = array_of(scatter, count=9)
    expected = true_field(array[1], machine)
    assert readings(array) == pytest.approx(expected, abs=1e-6 * np.abs(expected).max())
    assert np.abs(expected - true_field(array[1])).max() > 1e-5


def test_errors_of_the_readings_are_within_their_bounds_and_from_the_seed():
    exact = true_field(HallSection(count=9))
    offset = readings(array_of(count=9, offset_T=1e-3)) - exact
    assert 3e-4 < np.abs(offset).max() <= 1e-3
    gain = readings(array_of(count=9, gain_error=0.1)) / exact - 1
    assert 0.03 < np.abs(gain).max() <= 0.1
    again, other = (readings(array_of(count=9, offset_T=1e-3, seed=seed)) - exact for seed in (0, 1))
    assert again == pytest.approx(offset, abs=1e-15)
    assert np.abs(other - offset).min() > 1e-6


def test_noise_range_and_steps_of_the_readings():
    section = {"count": 9, "range_T": 0.002}
    exact = true_field(HallSection(**section))
    limited = readings(array_of(**section))
    assert limited == pytest.approx(np.clip(exact, -0.002, 0.002), abs=1e-8)
    steps = readings(array_of(count=9, bits=10)) / (2 * 0.1 / 2**10)
    assert steps == pytest.approx(np.rint(steps), abs=1e-9)
    array = array_of(count=9, noise_T=1e-4)
    noise = [readings(array, seed=seed) - exact for seed in range(100)]
    assert np.std(noise) == pytest.approx(1e-4, rel=0.1)  # of 900 numbers: three deviations are 7 %


def test_even_places_are_within_the_latitudes_and_apart():
    p = HallSection(count=24, highest_deg=30.0).directions()
    assert np.linalg.norm(p, axis=1) == pytest.approx(1)
    assert np.abs(p[:, 2]).max() < 0.5
    assert np.max(p @ p.T - 2 * np.eye(24)) < np.cos(np.radians(15))


def test_run_follows_the_array_whatever_the_chunks_and_after_a_snapshot():
    scenario = scenarios.load("nutation", {**FAST, **HALL, "hardware": "prototype"})
    with Session(scenario) as session:
        whole = session.advance(300)
    with Session(scenario) as session:
        session.advance(113)
        snapshot = session.snapshot()
        session.advance(50)
        session.restore(snapshot)
        rest = session.advance(187)
    for name in ("q_rad", "q_measured_rad", "hall_field_T", "hall_remanence"):
        assert np.array_equal(whole[name][113:], rest[name])
    error = whole["q_measured_rad"] - whole["q_rad"]
    assert 1e-4 < np.abs(error).max() < 0.06  # of poles with 3 % scatter
    assert np.abs(error[0]).max() > 0
    assert whole["hall_field_T"].shape == (300, 12)


def test_rows_of_a_block_are_those_of_sessions():
    rows = [{**FAST, **HALL, "sensors.hall.offset_T": 1e-4 * (1 + seed), "seed": seed} for seed in range(3)]
    configs = [initial_config(scenarios.load("nutation", changes), None, None) for changes in rows]
    block = RunBlock([config.scenario for config in configs], configs[0].files, ["max_abs_error_rad"])
    for changes, ending in zip(rows, block.run(), strict=True):
        alone = simulate("nutation", changes)
        assert ending.figures["max_abs_error_rad"] == alone.figures["max_abs_error_rad"]


def test_hot_magnets_lower_the_readings():
    heat = {"plant.thermal.on": True, "drive.supply_V": 24.0, "plant.thermal.rotor_degC": 80.0}
    with Session(
        scenarios.load("hold", {**FAST, **HALL, **heat, "sensors.hall.remanence_error": 0.1})
    ) as session:
        table = session.advance(200)
    expected = 1 - 0.0011 * 60
    assert table["hall_remanence"][-1] == pytest.approx(expected, abs=2e-3)


def test_array_replaces_the_sensors_of_the_hinges():
    prototype = scenarios.load("hold", {"hardware": "prototype", **HALL})
    assert prototype.sensors.hinge_sensors_ideal
    assert prototype.sensors.current.noise_A > 0
    with pytest.raises(InputError, match=r"expected no errors of potentiometer.* those of encoder"):
        scenarios.load("hold", {"sensors.encoder.counts": 2000, **HALL})
    fault = [{"target": "encoder.gamma", "mode": "stuck", "start_s": 0.1}]
    with pytest.raises(InputError, match=r"fault\.0: expected no fault of encoder"):
        scenarios.load("hold", {"fault": fault, **HALL})


@pytest.mark.parametrize(
    ("fields", "message"),
    [
        ({"count": 2}, "at least three readings"),
        ({"count": 4, "longitude_deg": [0.0], "latitude_deg": [0.0]}, "expected a count, or as many values"),
        ({"longitude_deg": [0.0, 1.0], "latitude_deg": [0.0]}, "2 and 1 values"),
    ],
)
def test_places_that_do_not_fit_are_refused(fields, message):
    with pytest.raises(InputError, match=message):
        scenarios.load("hold", {f"sensors.hall.{name}": value for name, value in fields.items()})


def test_sensors_within_a_winding_or_the_magnets_are_refused():
    longitude, latitude = np.degrees(np.arctan2(*ACTUATOR.coil_axes[0, 1::-1])), 0.0
    beside = longitude + np.degrees(0.007 / 0.063)
    at = {"longitude_deg": (beside, 0.0, 90.0), "latitude_deg": (latitude, 90.0, 90.0), "radius_m": 0.063}
    with pytest.raises(InputError, match="received sensor 0 within one"):
        array_of(**at)
    with pytest.raises(InputError, match="expected sensors at a radius of at least"):
        array_of(count=8, radius_m=0.05)


def test_gpu_is_refused_by_name(monkeypatch):
    monkeypatch.setattr(cuda_block.cuda, "check_gpu", lambda: None)
    with pytest.raises(InputError, match=r"expected no sensors\.hall"):
        cuda_block.check_gpu_runs("lagrangian", check_bounds=False, hall=True)


def test_array_cannot_change_during_a_run():
    with Session(scenarios.load("hold", FAST)) as session, pytest.raises(InputError, match=r"sensors\.hall"):
        session.set("sensors.hall.count", 12)
