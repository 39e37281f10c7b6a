"""What the law with an observer is for: small errors, without the torque and the chatter that AFSM takes."""

import numpy as np
import pytest

from spheretwin import scenario as scenarios
from spheretwin.run import figures_of
from spheretwin.session import Session
from spheretwin.simulation import simulate

SEEDS = range(2)
CONDITIONS = [(0.0, 0.0), (0.2, 1.0), (0.5, 0.0), (0.5, 5.0)]

# Sensors whose errors no law can see are left out: offset, gain, residual nonlinearity.
PROTOTYPE = {
    "hardware": "electronics",
    "plant.engine": "lagrangian",
    "sensors.adc.offset_V": 0.0,
    "sensors.adc.gain_error": 0.0,
    "sensors.potentiometer.nonlinearity_rad": 0.0,
}

LEARNS_NOTHING = {
    "controller.disturbance_bandwidth_rad_s": 0.0,
    "controller.fast_disturbance_bandwidth_rad_s": 0.0,
}


def flown(m, load, seed, **changes):
    """Figures of one sinusoid through the whole coil chain."""
    fields = {"controller.law": "afsm_eso", "plant.engine": "lagrangian", "seed": seed}
    condition = {"plant.modelling_error": m, "disturbance.load": load}
    run = simulate(scenarios.load("sinusoid", {**fields, **condition, **changes}))
    assert run.status == "completed"
    return figures_of(run)


def largest(figures):
    return max(figures["max_abs_error_rad"])


@pytest.fixture(scope="module")
def afsm():
    return {
        (m, load, seed): flown(m, load, seed, **{"controller.law": "afsm"})
        for m, load in CONDITIONS
        for seed in SEEDS
    }


@pytest.mark.parametrize("seed", SEEDS)
@pytest.mark.parametrize(("m", "load"), CONDITIONS)
def test_ideal_is_exact_and_takes_no_more_than_afsm(afsm, m, load, seed):
    result, other = flown(m, load, seed), afsm[m, load, seed]
    assert largest(result) <= (0.0045 if (m, load) == (0.2, 1.0) else 0.0085)
    assert max(result["tail_rms_error_rad"]) <= 4.5e-4
    assert result["rms_torque_Nm"] <= other["rms_torque_Nm"]
    assert result["current_variation_A_s"] <= other["current_variation_A_s"]


@pytest.mark.parametrize("seed", SEEDS)
@pytest.mark.parametrize(("m", "load"), CONDITIONS)
def test_fast_is_twice_as_exact(afsm, m, load, seed):
    result = flown(m, load, seed, **{"controller.preset": "fast"})
    assert largest(result) <= (0.002 if (m, load) == (0.2, 1.0) else 0.004)
    assert max(result["tail_rms_error_rad"]) <= 2.5e-4
    assert result["current_variation_A_s"] <= afsm[m, load, seed]["current_variation_A_s"]


@pytest.mark.parametrize("seed", SEEDS)
def test_the_remaining_error_does_not_depend_on_the_load(seed):
    light, heavy = (flown(0.5, load, seed)["tail_rms_error_rad"] for load in (0.0, 5.0))
    assert max(heavy) <= 1.1 * max(light)


def test_benefit_of_each_part():
    """Without the schedule, the boost, the observer: worse, and worst without the observer."""
    whole = largest(flown(0.5, 5.0, 0))
    no_boost = largest(flown(0.5, 5.0, 0, **{"controller.boost_slope_1_s": 0.0}))
    no_schedule = largest(flown(0.5, 5.0, 0, **{"controller.fast_disturbance_bandwidth_rad_s": 20.0}))
    no_observer = largest(flown(0.5, 5.0, 0, **LEARNS_NOTHING))
    assert whole < 0.8 * no_boost < 0.8 * no_schedule < 0.64 * no_observer


def test_benefit_of_the_coupled_model_in_the_nutation():
    moving = {"plant.engine": "lagrangian", "controller.law": "afsm_eso"}
    coupled, single = (
        figures_of(simulate(scenarios.load("nutation", {**moving, "controller.coupled": coupled})))
        for coupled in (True, False)
    )
    assert max(coupled["tail_rms_error_rad"]) < 0.7 * max(single["tail_rms_error_rad"])
    assert coupled["current_variation_A_s"] < 0.8 * single["current_variation_A_s"]


@pytest.mark.release("ten minutes of two runs, 3 s; shorter runs have the same figures")
@pytest.mark.parametrize("preset", ["ideal", "fast"])
def test_nothing_drifts_in_ten_minutes(preset):
    """Error, torque, variation of the currents and what is observed: the last minute as the second."""
    fields = {"controller.law": "afsm_eso", "controller.preset": preset, "plant.engine": "lagrangian"}
    with Session(scenarios.load("sinusoid", fields)) as session:
        minutes = []
        for minute in range(10):
            rows = session.advance(60_000)
            if minute in (1, 9):
                current = np.abs(np.diff(rows["current_command_A"], axis=0))
                minutes.append(
                    [
                        *np.sqrt(np.mean(rows["error_rad"] ** 2, axis=0)),
                        np.sqrt(np.mean(np.sum(rows["torque_Nm"] ** 2, axis=1))),
                        current.sum(axis=0).mean(),
                        *np.sqrt(np.mean(rows["observed_disturbance_Nm"] ** 2, axis=0)),
                    ]
                )
    second, last = np.array(minutes)
    # Random torque goes on all the while: over a minute its effect is known to some 2 %.
    np.testing.assert_allclose(last, second, rtol=0.05)


def test_on_the_prototype_it_is_more_exact_than_pid_with_a_fifth_of_its_chatter():
    """Medians of ten seeds: one seed alone decides by the noise at the largest error."""

    def tilted(**law):
        runs = (simulate(scenarios.load("tilt", {**PROTOTYPE, "seed": seed, **law})) for seed in range(10))
        figures = [figures_of(run) for run in runs]
        errors = [max(each["max_abs_error_rad"][:2]) for each in figures]
        return np.median(errors), np.median([each["current_variation_A_s"] for each in figures])

    error, variation = tilted(**{"controller.law": "afsm_eso", "controller.preset": "prototype"})
    of_pid, its_variation = tilted(**{"controller.law": "pid"})
    assert error <= min(np.radians(0.035), 0.75 * of_pid)
    assert variation <= its_variation / 5


# Seeds that gains were neither searched nor chosen with.
FRESH = range(100, 120)
TILTED = {
    "hardware": "electronics",
    "plant.engine": "lagrangian",
    "sensors.adc.offset_V": 0.0,
    "sensors.adc.gain_error": 0.0,
    "nominal.coulomb_Nm": (2e-3, 2e-3, 2e-3),
    "controller.law": "afsm_eso",
}
MISMATCH = {
    "right": {},
    "friction": {"plant.coulomb_Nm": (5e-3, 5e-3, 5e-3)},
    "heavier": {"plant.modelling_error": 0.5},
}


@pytest.fixture(scope="module")
def median_deg():
    """Largest true error of α and β on the tilt, degrees, median over the seeds, by preset and mismatch."""

    def error_deg(preset, mismatch, seed):
        fields = {**TILTED, **MISMATCH[mismatch], "controller.preset": preset, "seed": seed}
        run = simulate(scenarios.load("tilt", fields))
        assert run.status == "completed"
        return np.degrees(np.abs(run.telemetry["error_rad"][:, :2]).max())

    return {
        (preset, mismatch): np.median([error_deg(preset, mismatch, seed) for seed in FRESH])
        for preset in ("prototype", "robust")
        for mismatch in MISMATCH
    }


@pytest.mark.release("3 s; the other targets have a shorter run of the same law")
@pytest.mark.parametrize("mismatch", ["friction", "heavier"])
def test_robust_bears_friction_and_inertia_that_the_nominal_model_does_not_have(median_deg, mismatch):
    """Nominal friction is 2 of 5 mN·m, or the rotor half as heavy again."""
    assert median_deg["robust", mismatch] <= 0.042
    assert median_deg["prototype", mismatch] > 0.045  # so that the goal asks for something


@pytest.mark.release("3 s; the other targets have a shorter run of the same law")
def test_robust_costs_a_tenth_at_most_where_the_nominal_model_is_right(median_deg):
    assert median_deg["robust", "right"] <= 1.1 * median_deg["prototype", "right"]
