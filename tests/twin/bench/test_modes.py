"""Changes between any modes are without a jump of reference, error and torque."""

from itertools import product

import numpy as np
import pytest

from spheretwin.bench import modes
from spheretwin.bench.modes import Limits
from tests.twin.bench.cases import MODES, begun, done, kept_rows

BY_HAND = ("off", "manual")


@pytest.fixture
def recorded(tmp_path):
    """Runs a bench through some modes, 400 ticks each; gives back the rows and the ticks of the changes."""

    def run(*names, **changes):
        with begun(**changes) as bench:
            done(bench, "record", telemetry=str(tmp_path / "run.parquet"))
            ticks = []
            for name in names:
                done(bench, name, **MODES[name])
                ticks.append(bench.state().tick)
                assert bench.advance(400) == 400
                assert bench.state().mode == name
        return kept_rows(tmp_path / "run.parquet"), ticks

    return run


@pytest.mark.parametrize(("before", "after"), list(product(MODES, MODES)))
def test_every_change_of_mode_is_bumpless(recorded, before, after):
    rows, (_, tick) = recorded(before, after)
    q_ref, rates, error, torque = (
        rows[name] for name in ("q_ref_rad", "qdot_ref_rad_s", "error_rad", "torque_command_Nm")
    )
    if after in BY_HAND:
        np.testing.assert_array_equal(torque[tick:], 0.0)
        current = np.zeros(18)
        current[5] = 0.1 if after == "manual" else 0.0
        np.testing.assert_array_equal(rows["current_command_A"][tick:], np.tile(current, (400, 1)))
        return
    if before in BY_HAND:
        # The reference begins where the rotor is, to rounding.
        np.testing.assert_allclose(error[tick], 0.0, atol=1e-15)
        np.testing.assert_allclose(rates[tick], rows["qdot_rad_s"][tick], atol=1e-12)
        # The law begins anew, with the error and its rate at 0: what it asks for, it asks for the motion.
        assert np.abs(torque[tick]).max() < 0.02
    else:
        # It moves on by its rate and an acceleration within 10 rad/s²: 5 µrad and 10 mrad/s in a tick.
        np.testing.assert_allclose(q_ref[tick], q_ref[tick - 1] + 1e-3 * rates[tick - 1], atol=5e-6)
        np.testing.assert_allclose(rates[tick], rates[tick - 1], atol=0.01)
        # The error goes on from what it was: within a tick it moves by no more than its rate then.
        np.testing.assert_allclose(error[tick], error[tick - 1], atol=1e-5)
        # 10 rad/s² of 2.3e-3 kg·m² are 0.023 N·m, and an error that moves by 0.1 mrad adds little.
        assert np.abs(torque[tick] - torque[tick - 1]).max() < 0.025
    # Nor does anything jump later on: 5 rad/s² of the profile, and twice the 2 rad/s² of the sine.
    assert np.abs(np.diff(rates[tick:], axis=0)).max() < 1e-3 * (5 + 2 * 2)


def test_a_pose_is_reached_within_the_limits(made, recorded):
    rows, (tick,) = recorded("point")
    limits = Limits()
    # The limits hold for the way; the rate that it began with, 0.63 rad/s of the sine, comes on top.
    assert np.abs(rows["qdot_ref_rad_s"][tick:]).max() < limits.rate_rad_s + 0.63
    done(made, "point", pose_rad=[0.3, -0.2, 2.0])
    made.advance(6000)
    np.testing.assert_array_equal(made.state().q_ref_rad, [0.3, -0.2, 2.0])
    assert made.state().error_mrad < 1


def test_hold_comes_to_rest_without_turning_back(recorded):
    rows, (_, tick) = recorded("jog", "hold")
    rates = rows["qdot_ref_rad_s"][tick:]
    assert np.abs(rates[-1]).max() == 0.0
    # Rates fall to 0 without another sign: to a thousandth, as the way is a few per cent longer than need be.
    assert (rates * np.sign(rates[0])).min() > -1e-3 * np.abs(rates[0]).max()


def test_jogging_ends_at_the_edge_of_the_workspace(made):
    done(made, "jog", rates_rad_s=[0.8, -0.8, 0.5])
    made.advance(4000)
    state = made.state()
    edge = 80 * np.pi / 180 - modes.EDGE_rad
    np.testing.assert_allclose(state.q_ref_rad[:2], [edge, -edge], atol=1e-9)
    assert state.mode == "jog"
    done(made, "jog", rates_rad_s=[0.5, 0.0, 0.0])  # there is no room
    made.advance(300)
    np.testing.assert_allclose(made.state().q_ref_rad[0], edge, atol=1e-9)


def test_a_changed_field_of_the_trajectory_keeps_its_phase(made):
    made.advance(300)
    done(made, "set", name="trajectory.amplitude_rad", value=[0.1, 0.1, 0.1])
    made.advance(2000)
    t = made.state().t_s
    np.testing.assert_allclose(made.state().q_ref_rad, 0.1 * np.sin(np.pi * t), atol=1e-12)


@pytest.mark.parametrize("mode", MODES)
def test_the_history_has_an_error_only_in_modes_with_a_reference(mode):
    with begun() as bench:
        done(bench, mode, **MODES[mode])
        last = bench.bins().numbers[-1:] or [-1]
        bench.advance(200)
        bins = bench.bins(last[0] + 1)
    for name in ("q_ref_rad", "error_rad"):
        assert np.isnan(bins.high[name]).all() == np.isnan(bins.low[name]).any() == (mode in BY_HAND)
    assert np.isfinite(bins.high["q_rad"]).all()
