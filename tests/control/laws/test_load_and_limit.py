"""Laws with an integral or an observer: no error under a constant load, no windup at the current limit."""

import numpy as np
import pytest

from spheretwin import scenario as scenarios
from spheretwin.control.laws.afsm_eso import PRESETS
from spheretwin.simulation import simulate
from tests.control.laws.cases import PERIOD, WEAK

LAWS = ["pid", "computed_torque", "backstepping_sliding_mode", "adrc"]
LOADED = {"plant.engine": "lagrangian", "plant.payload_kg": 0.05, "disturbance.load": 1.0}
HEAVIER = {"controller.law": "afsm_eso", "plant.modelling_error": 0.3}


def hold(**fields):
    run = simulate(scenarios.load("hold", {name.replace("__", "."): value for name, value in fields.items()}))
    assert run.status == "completed"
    return run


@pytest.mark.parametrize(
    "fields",
    [
        *({"controller.law": law} for law in LAWS),
        *(HEAVIER | {"controller.preset": preset} for preset in PRESETS),
    ],
    ids=lambda fields: " ".join(map(str, fields.values())),
)
def test_a_constant_load_leaves_no_error(fields):
    last = hold(**LOADED, **fields).telemetry["error_rad"][-100:]
    # After 3 s the slowest pole, of afsm_eso at -20, leaves e^-60 of 0.2 rad; the rest is rounding.
    assert np.abs(last).max() < (1e-13 if "adrc" in fields.values() else 1e-14)


def test_super_twisting_leaves_what_its_root_does_over_a_period():
    """Without its integral it were some 10 mrad."""
    run = hold(**LOADED, controller__law="super_twisting")
    gains = run.scenario.controller
    band = (gains.root_gain[0] * PERIOD / 2) ** 2
    last = run.telemetry["error_rad"][-500:]
    assert np.abs(last).max() < 4 * band / gains.surface_slope[0]
    assert np.abs(last.mean(0)).max() < 0.1 * band / gains.surface_slope[0]


@pytest.mark.parametrize("law", [*LAWS, "super_twisting"])
def test_the_current_limit_winds_up_no_integral(law):
    faster = {"controller.bandwidth": 80.0} if law == "adrc" else {}
    table = hold(**WEAK, controller__law=law, **faster).telemetry
    assert table["allocation_scale"].min() < 0.2
    assert np.abs(table["current_command_A"]).max() == WEAK["nominal.current_limit_A"]
    start = table["error_rad"][0]
    assert np.max(-np.sign(start) * table["error_rad"] / np.abs(start)) < 0.5
    if law == "adrc":  # with no load and a true model, nothing but coupling is observed
        commanded = np.abs(table["torque_command_Nm"]).max()
        assert np.abs(table["observed_torque_Nm"]).max() < 0.05 * commanded
