"""The prototype's way in, in the loop: sensors with noise, estimated rates, and hardware by name."""

import numpy as np
import pytest

from spheretwin import assembly, cli
from spheretwin import scenario as scenarios
from spheretwin.control.estimators import ESTIMATORS
from spheretwin.control.estimators.estimator import estimates
from spheretwin.electronics.random_streams import noise_table
from spheretwin.electronics.sensor_chain import noise_streams, sense, sensor_chain
from spheretwin.models.base.errors import InputError
from spheretwin.scenario import reading
from spheretwin.scenario.hardware import HARDWARE
from spheretwin.session import Session
from spheretwin.simulation import simulate

MADE = [kind for kind in ESTIMATORS if kind != "ideal"]


def prototype(**changes):
    return scenarios.load("tilt", {"hardware": "electronics", "duration": 0.5, "seed": 3, **changes})


@pytest.mark.parametrize("engine", ["mujoco", "lagrangian"])
@pytest.mark.parametrize("kind", MADE)
def test_the_law_is_handed_what_the_stages_make_of_the_true_state(kind, engine):
    """Sensors and estimator called one after the other, outside the loop, give the logged columns."""
    scenario = prototype(**{"estimator.kind": kind, "plant.engine": engine})
    run = simulate(scenario)
    table, resolved = run.telemetry, run.scenario
    chain = sensor_chain(resolved.sensors, resolved.seed)
    noise = noise_table(resolved.seed, 0, len(table), noise_streams(resolved.sensors))
    measurement = np.empty((3, 3))
    angles = np.empty((len(table), 3))
    for tick, (q, qdot) in enumerate(zip(table["q_rad"], table["qdot_rad_s"], strict=True)):
        sense(chain, q.copy(), qdot.copy(), noise[tick], measurement)
        angles[tick] = measurement[0]
    np.testing.assert_array_equal(table["q_measured_rad"], angles)
    rates = estimates(assembly.estimator_of(resolved), angles)
    # The same machine code, but for products and sums that are fused in one place and not in the other.
    np.testing.assert_allclose(table["qdot_estimated_rad_s"], rates, rtol=1e-9, atol=1e-9)
    assert np.abs(table["q_measured_rad"] - table["q_rad"]).max() > 1e-4


@pytest.mark.parametrize("kind", MADE)
@pytest.mark.parametrize("length", [1, 7, 999, 1500])
def test_noise_and_estimates_do_not_depend_on_chunks(kind, length):
    scenario = prototype(**{"estimator.kind": kind, "duration": 1.5})
    with Session(scenario) as session:
        pieces = []
        while session.tick < 1500:
            pieces.append(session.advance(min(length, 1500 - session.tick)).values)
    assert np.concatenate(pieces).tobytes() == simulate(scenario).telemetry.values.tobytes()


@pytest.mark.parametrize("kind", MADE)
def test_a_snapshot_goes_on_with_noise_and_memory(kind):
    with Session(prototype(**{"estimator.kind": kind})) as session, Session(prototype()) as other:
        session.advance(123)
        other.restore(session.snapshot())
        assert other.advance(200).values.tobytes() == session.advance(200).values.tobytes()


def test_a_change_beside_it_leaves_the_estimator_s_memory():
    with Session(prototype()) as unchanged, Session(prototype()) as changed:
        unchanged.advance(200)
        changed.advance(100)
        changed.set("disturbance.load", 0.0)
        changed.set("plant.group_gain", [1.0] * 18)
        changed.advance(100)
        assert unchanged.advance(50).values.tobytes() == changed.advance(50).values.tobytes()


def test_another_seed_is_another_prototype():
    first, second = (simulate(prototype(seed=seed)).telemetry["q_measured_rad"][0] for seed in (1, 2))
    assert np.all(first[:2] != second[:2])


def test_neutral_stages_move_no_bit():
    ideal = simulate(scenarios.load("tilt", {"duration": 0.2})).telemetry
    named = simulate(scenarios.load("tilt", {"duration": 0.2, "hardware": "ideal"})).telemetry
    assert ideal.values.tobytes() == named.values.tobytes()
    assert "q_measured_rad" not in [signal.name for signal in ideal.signals]


def test_a_field_that_is_set_is_not_set_by_the_hardware(tmp_path):
    (path := tmp_path / "mine.toml").write_text(
        'hardware = "electronics"\n[trajectory]\nshape = "hold"\n[sensors.adc]\nbits = 12\n'
    )
    scenario = scenarios.load(str(path), reading.overrides(["--sensors.encoder.counts", "4096"]))
    assert (scenario.sensors.adc.bits, scenario.sensors.encoder.counts) == (12, 4096)
    assert scenario.sensors.adc.noise_V == HARDWARE["electronics"]["sensors.adc.noise_V"]
    assert scenario.plant.coulomb_Nm == (2e-3, 2e-3, 2e-3)


@pytest.mark.parametrize("name", HARDWARE)
def test_every_set_is_fields_of_a_scenario(name):
    scenario = scenarios.load("hold", {"hardware": name})
    for dotted, value in HARDWARE[name].items():
        result = scenario
        for part in dotted.split("."):
            result = getattr(result, part)
        assert result == value, dotted


def test_a_run_of_the_prototype_is_replayed(tmp_path):
    first, again = tmp_path / "first.parquet", tmp_path / "again.parquet"
    arguments = ["simulate", "tilt", "--hardware", "electronics", "--duration", "0.3"]
    assert cli.main([*arguments, "--telemetry", str(first)]) == 0
    assert cli.main(["simulate", "--replay", str(first), "--telemetry", str(again)]) == 0
    assert first.read_bytes() == again.read_bytes()


def test_hardware_that_is_none_is_refused():
    with pytest.raises(InputError, match="did you mean prototype"):
        scenarios.load("hold", {"hardware": "protoype"})
    with Session(prototype()) as session, pytest.raises(InputError, match="may change during a run"):
        session.set("hardware", "ideal")


@pytest.mark.release("1.3 s of plain Python; test_the_prototype_is_its_plain_copy has plain loops")
@pytest.mark.uncompiled
def test_a_plain_law_runs_under_it_too():
    from spheretwin.control.law import Law

    def step(t, reference, measurement, parameters, state, torque):
        torque[:] = -0.5 * (measurement[0] - reference[0]) - 0.03 * measurement[1]

    run = simulate(prototype(duration=0.05), law=Law("plain", step, [], []))
    assert run.status == "completed"
    assert np.isfinite(run.telemetry.values).all()
