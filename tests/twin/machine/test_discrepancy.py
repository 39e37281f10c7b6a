"""What a model may lack: the size of a component, and a machine with a scatter of its groups."""

import numpy as np
import pytest

import spheretwin
from spheretwin.machine import IdentifySettings, identify
from spheretwin.machine.discrepancy import VarianceComponent, _most_likely, widening
from spheretwin.machine.log import log_of
from spheretwin.machine.workflow import CALIBRATED


def test_the_deviation_of_departures_is_found():
    """100 draws of 18 members: the deviation is within 3 standard errors, and chance gains little."""
    generator = np.random.default_rng(0)
    slopes = generator.normal(0, 30.0, (400, 18))
    information, found, chance = slopes.T @ slopes, [], []
    for _ in range(100):
        noise, departures = generator.normal(size=400), generator.normal(0, 0.01, 18)
        found.append(_most_likely(slopes.T @ (noise + slopes @ departures), information, 0.05, 0.0)[0])
        chance.append(_most_likely(slopes.T @ noise, information, 0.05, 0.0)[1])
    # The mean square of 1,800 departures has a relative deviation of sqrt(2 / 1,800).
    assert np.sqrt(np.mean(np.square(found))) == pytest.approx(0.01, rel=0.06)
    assert np.mean(np.array(chance) > 1.0) < 0.15


def test_the_largest_effect_of_what_explains_most_widens_an_interval():
    covariance = np.diag([4.0, 1.0])

    def component(gain, slopes):
        return VarianceComponent((), np.zeros(1), 2.0, gain, np.zeros(1), np.array(slopes))

    strong, likely, other = (
        component(9.0, [[3.0], [0.0]]), component(8.0, [[1.0], [1.0]]), component(5.0, [[50.0], [50.0]])
    )  # fmt: skip
    assert widening([strong, likely, other], covariance) == pytest.approx([10**0.5, 5**0.5])
    assert np.array_equal(widening([component(0.9, [[9.0], [9.0]])], covariance), [1.0, 1.0])


@pytest.mark.release("5 s; tests/benchmarks/identification.py has the coverage")
def test_a_scatter_of_the_groups_widens_the_intervals_and_is_suggested():
    """0.6 % of scatter hardly changes the mean square; noise alone gives intervals that miss by far."""
    gains = (0.97 * (1 + np.random.default_rng(5).normal(0, 0.006, 18))).tolist()
    true = {"plant.coulomb_Nm": [3e-3, 2e-3, 1.5e-3], "plant.group_gain": gains}
    known, logs = {**CALIBRATED, "controller.law": "pid", "duration": 2.0}, []
    for seed, payload_kg in enumerate((0.0, 0.1)):
        conditions = {"plant.payload_kg": payload_kg}
        run = spheretwin.simulate("sinusoid", {**known, **true, **conditions, "seed": seed})
        logs.append(log_of(run.telemetry, conditions=conditions))
    wanted = ["torque_scale", "plant.modelling_error", "plant.coulomb_Nm"]
    result = identify(logs, "sinusoid", wanted, known, IdentifySettings(suggest=True))
    assert result.accepted, result.reasons
    values = {"torque_scale": float(np.mean(gains)), "plant.modelling_error": 0.0}
    values |= {f"plant.coulomb_Nm.{i}": value for i, value in enumerate(true["plant.coulomb_Nm"])}
    misses = []
    for name, value in values.items():
        found, (low, high), _, wider = result.parameters[name]
        assert low <= value <= high
        misses.append(2 * abs(found - value) * wider / (high - low))
    assert max(misses) > 1.5
    # In one short motion a scatter of the poles looks alike.
    assert "plant.group_gain" in [one.what for one in result.suggestions[:2]]
    assert result.suggestions[0].chi2 < result.held_out.chi2


@pytest.mark.release("3 s each; the parameters have tests of their own")
@pytest.mark.parametrize(
    ("field", "value", "place"),
    [("plant.coulomb_asymmetry", 0.3, 0), ("plant.backlash_rad", 6e-3, 1)],
)
def test_what_a_hinge_has_besides_friction_is_suggested_and_then_found(field, value, place):
    true = {"plant.coulomb_Nm": [3e-3, 2e-3, 1.5e-3], field: (value * np.eye(3)[place]).tolist()}
    conditions = {"plant.payload_kg": 0.1}
    known = {**CALIBRATED, "controller.law": "pid", "duration": 2.0}
    run = spheretwin.simulate("sinusoid", {**known, **true, **conditions, "seed": 1})
    log, wanted = log_of(run.telemetry, conditions=conditions), ["torque_scale", "plant.coulomb_Nm"]
    lacking = identify(log, "sinusoid", wanted, known, IdentifySettings(suggest=True))
    assert not lacking.accepted
    assert lacking.suggestions[0].member == f"{field}.{place}"
    result = identify(log, "sinusoid", [*wanted, field], known)
    assert result.accepted, result.reasons
    low, high = result.parameters[f"{field}.{place}"].interval
    assert low <= value <= high
    assert high - low < 0.2 * value
