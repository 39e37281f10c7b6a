"""What the law with an observer is for: small errors, without the torque and the chatter that AFSM takes."""

import numpy as np
import pytest

from spheretwin import scenario as scenarios
from spheretwin.run import figures_of
from spheretwin.session import Session
from spheretwin.simulation import simulate
from spheretwin.study.statistics import interval

SEEDS = range(2)
CONDITIONS = [(0.0, 0.0), (0.2, 1.0), (0.5, 0.0), (0.5, 5.0)]

# Sensors whose errors no law can see are left out: offset, gain, residual nonlinearity.
PROTOTYPE = {
    "hardware": "electronics",
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
@pytest.mark.parametrize(
    ("preset", "nominal_rad", "largest_rad", "tail_rad"),
    [("ideal", 0.0045, 0.0085, 4.5e-4), ("fast", 0.002, 0.004, 2.5e-4)],
)
def test_it_is_exact_and_takes_no_more_than_afsm(
    afsm, preset, nominal_rad, largest_rad, tail_rad, m, load, seed
):
    result, other = flown(m, load, seed, **{"controller.preset": preset}), afsm[m, load, seed]
    assert largest(result) <= (nominal_rad if (m, load) == (0.2, 1.0) else largest_rad)
    assert max(result["tail_rms_error_rad"]) <= tail_rad
    assert result["current_variation_A_s"] <= other["current_variation_A_s"]
    if preset == "ideal":
        assert result["rms_torque_Nm"] <= other["rms_torque_Nm"]


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
    """Medians of five seeds: one seed alone decides by the noise at the largest error."""

    def tilted(**law):
        runs = (simulate(scenarios.load("tilt", {**PROTOTYPE, "seed": seed, **law})) for seed in range(5))
        figures = [figures_of(run) for run in runs]
        errors = [max(each["max_abs_error_rad"][:2]) for each in figures]
        return np.median(errors), np.median([each["current_variation_A_s"] for each in figures])

    error, variation = tilted(**{"controller.law": "afsm_eso", "controller.preset": "prototype"})
    of_pid, its_variation = tilted(**{"controller.law": "pid"})
    assert error <= min(np.radians(0.035), 0.75 * of_pid)
    assert variation <= its_variation / 5


MISMATCH = {
    "right": {},
    "friction": {"plant.coulomb_Nm": (5e-3, 5e-3, 5e-3)},
    "heavier": {"plant.modelling_error": 0.5},
    "lighter": {"plant.modelling_error": -0.3},
}


@pytest.mark.release("320 runs, 10 s; the other targets have a shorter run of the same law")
def test_robust_bears_friction_and_inertia_that_the_nominal_model_does_not_have():
    """Nominal friction is 2 of 5 mN·m, or the rotor half as heavy again; it pays for it with a lighter rotor.

    Largest true error of α and β on the tilt, median over seeds that gains were neither searched nor chosen
    with.
    """

    def error_deg(preset, mismatch, seed):
        law = {"controller.law": "afsm_eso", "controller.preset": preset, "seed": seed}
        fields = PROTOTYPE | {"plant.engine": "lagrangian", "nominal.coulomb_Nm": [2e-3] * 3}
        del fields["sensors.potentiometer.nonlinearity_rad"]
        run = simulate(scenarios.load("tilt", fields | MISMATCH[mismatch] | law))
        assert run.status == "completed"
        return np.degrees(np.abs(run.telemetry["error_rad"][:, :2]).max())

    errors_deg = {
        (preset, mismatch): [error_deg(preset, mismatch, seed) for seed in range(100, 140)]
        for preset in ("prototype", "robust")
        for mismatch in MISMATCH
    }
    median_deg = {case: np.median(errors) for case, errors in errors_deg.items()}
    for mismatch in ("friction", "heavier"):
        assert median_deg["robust", mismatch] <= 0.042
        assert median_deg["prototype", mismatch] > 0.045  # so that the goal asks for something
    assert median_deg["robust", "right"] <= 1.1 * median_deg["prototype", "right"]
    # 400 other seeds gave 0.047 degrees.
    low_deg, high_deg = interval(errors_deg["robust", "lighter"])
    assert interval(errors_deg["prototype", "lighter"])[1] < low_deg < 0.046 < high_deg
