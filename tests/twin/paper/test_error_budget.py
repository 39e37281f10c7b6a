"""The error budget: its stages are the prototype part by part, and both hardware sets."""

import numpy as np
import pytest

from spheretwin import scenario as scenarios
from spheretwin.config.active_config import initial_config
from spheretwin.paper import error_budget
from spheretwin.paper.error_budget import BASES, PROTOTYPE, STAGES, Budget, fields_of
from spheretwin.paper.experiment import Outcomes
from spheretwin.scenario.hardware import PROTOTYPE_NOMINAL
from spheretwin.session import Session
from spheretwin.simulation import simulate
from tests.twin.paper.cases import outcome

BY_NAME = {stage["stage"]: stage for stage in STAGES}
CASES = {(case.columns["law"], case.columns["stage"]): case for case in error_budget.cases()}
IDEAL, WITH_RATES, ELECTRONICS, ALL = "ideal", "estimator", "electronics", "prototype"
OF_STAGES = pytest.mark.release("3 s of plain Python; the fields of the stages are compared here")


def scenario(stage, **more):
    return scenarios.load("tilt", {**CASES["pd", stage["stage"]].fields, **more})


def test_single_stages_together_are_the_prototype():
    single = [dotted for stage in STAGES if "set" not in stage for dotted in fields_of(stage)]
    assert set(single) | set(error_budget.WITHOUT_ERROR) | set(PROTOTYPE_NOMINAL) == set(PROTOTYPE)
    assert not set(single) & set(error_budget.WITHOUT_ERROR)
    named = {"delay", "quantisation", "sensor noise", "sensor nonlinearity", "friction", "voltage limit"}
    assert {IDEAL, ALL, "amplifier bandwidth", *named} <= set(BY_NAME)


@pytest.mark.parametrize("name", [ELECTRONICS, ALL])
def test_a_set_is_that_of_the_scenario(name):
    stage, whole = (
        initial_config(loaded, None, None).scenario
        for loaded in (
            scenario(BY_NAME[name]),
            scenarios.load("tilt", {"hardware": name, "controller.law": "pd"}),
        )
    )
    for section in ("sensors", "estimator", "drive", "plant", "nominal"):
        assert getattr(stage, section) == getattr(whole, section)


def test_ideal_has_the_true_state_and_currents_at_once():
    run = simulate(scenario(BY_NAME[IDEAL], duration=0.1))
    names = {signal.name for signal in run.telemetry.signals}
    assert not names & {"q_measured_rad", "friction_Nm", "supply_power_W"}
    np.testing.assert_array_equal(run.telemetry["current_A"], run.telemetry["current_command_A"])


@pytest.mark.parametrize("stage", STAGES, ids=lambda stage: stage["stage"])
def test_the_controller_knows_the_parts_of_a_stage_but_not_the_mass(stage, actuator):
    """Were they not known, a stage would show a mismatch beside the cost of its parts."""
    with Session(scenario(stage)) as session:
        run = session.scenario
    nominal, drive = run.nominal, run.drive
    assert run.plant.payload_kg > 0
    assert nominal.inertia_kg_m2 == tuple(actuator.inertia.tolist())
    assert (nominal.delay_s, nominal.time_constant_s) == (drive.delay_s, drive.lag_s)
    assert (nominal.coulomb_Nm, nominal.viscous_Nm_s) == (run.plant.coulomb_Nm, run.plant.viscous_Nm_s)
    assert nominal.angle_noise_rad == run.sensors.angle_noise_rad
    assert nominal.angle_resolution_rad == run.sensors.angle_resolution_rad


@OF_STAGES
@pytest.mark.uncompiled
def test_a_stage_is_run_for_each_seed_where_it_draws_and_only_there():
    def rows(stage, seed):
        return simulate(scenario(stage, duration=0.003, seed=seed)).telemetry.values.tobytes()

    drawn = [stage["stage"] for stage in STAGES if rows(stage, 0) != rows(stage, 1)]
    assert drawn == [stage["stage"] for stage in STAGES if stage["is_random"]]


@OF_STAGES
@pytest.mark.uncompiled
def test_what_a_drive_s_stage_needs_beside_is_no_error():
    """Amplifiers of ample voltage and bandwidth are currents at once, but for the offsets of the stage."""
    limit, bandwidth = BY_NAME["voltage limit"], BY_NAME["amplifier bandwidth"]
    wide = {**limit["other"], **bandwidth["other"]}
    wide |= {f"drive.dac_{each}": 0 for each in ("offset_V", "gain_error", "inl_lsb", "bits")}
    wide |= {f"drive.{each}": 0 for each in ("drop_up_V", "drop_down_V", "amplifier_offset_V")}
    ideal = simulate(scenario(BY_NAME[IDEAL], duration=0.03)).telemetry["q_rad"]
    for stage in (limit, bandwidth, BY_NAME["drive offset and gain"]):
        apart = simulate(scenario(stage, duration=0.03, **wide)).telemetry["q_rad"] - ideal
        # A lag of 1e-7 s beside a period of 1e-3 s: a part in 1e4 of how far a current moves in a period.
        assert 0 < np.abs(apart).max() < 1e-4 * np.abs(ideal).max()


def test_single_sensor_errors_are_compared_with_the_estimator():
    sensors = [stage for stage in STAGES if {"estimator.kind"} < set(stage["parts"])]
    assert len(sensors) == 5
    assert {stage["base"] for stage in sensors} == {WITH_RATES}
    assert {stage["base"] for stage in STAGES if stage not in sensors} == {IDEAL}


def test_the_part_that_changes_most_is_named():
    """Outcomes made up: the estimator takes 0.01 rad off α, and friction, on β, is the worst by itself."""
    errors = {stage: [0.3, 0.0, 0.0] for stage in BASES}
    errors["friction"] = [0.3, np.radians(2.0), 0.0]
    errors[ELECTRONICS] = errors[ALL] = [1.0, 1.0, 1.0]
    errors[WITH_RATES] = [0.29, 0.0, 0.0]
    errors |= {stage: errors[WITH_RATES] for stage, base in BASES.items() if base == WITH_RATES}
    cases = {CASES["pd", stage].name: [outcome(errors[stage])] for stage in BASES}
    outcomes = Outcomes(cases)
    assert Budget(outcomes).largest_change("pd") == "PD, friction (β +2.000°)"
    del outcomes["pd: delay"]
    assert Budget(outcomes).largest_change("pd") == ""
