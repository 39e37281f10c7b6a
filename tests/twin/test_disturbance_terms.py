"""Terms: each held to its exact torque, and its own refusals."""

import numpy as np
import pytest

from spheretwin.disturbances import (
    ConstantDisturbance,
    RandomDisturbance,
    SinusoidalDisturbance,
    StepDisturbance,
    TableDisturbance,
    term_draws,
)
from spheretwin.models.base.errors import InputError
from tests.twin.disturbance_cases import PERIOD, TORQUES, sampled


def test_constant_and_steps_hold_on_each_axis_by_itself():
    np.testing.assert_array_equal(
        sampled(ConstantDisturbance(torque_Nm=(1.0, 2.0, 3.0)), 7, 3), [[1, 2, 3]] * 3
    )
    steps = StepDisturbance(times_s=(0.002, 0.004), torques_Nm=((1.0, 0.0, -1.0), (0.0, 5.0, 0.0)))
    expected = [[0, 0, 0], [0, 0, 0], [1, 0, -1], [1, 0, -1], [0, 5, 0], [0, 5, 0]]
    np.testing.assert_array_equal(sampled(steps, 0, 6), expected)


def test_sinusoidal_swings_on_each_axis_by_itself():
    term = SinusoidalDisturbance(
        amplitude_Nm=(0.1, 0.2, 0.3), frequency_Hz=(1.0, 2.0, 0.0), phase_rad=(0.0, np.pi / 2, np.pi / 6)
    )
    quarters = term.sample(np.array([0.0, 0.25, 0.5, 0.75, 1.0]), None)
    expected = [[0, 0.2, 0.15], [0.1, -0.2, 0.15], [0, 0.2, 0.15], [-0.1, -0.2, 0.15], [0, 0.2, 0.15]]
    np.testing.assert_allclose(quarters, expected, atol=1e-15)


def test_table_goes_by_its_rows(torques):
    t = np.array([0.0, 0.5, 1.0, 1.5, 1.75, 2.0, 50.0])
    linear = TableDisturbance(file=torques).sample(t, None)
    rows = [[0.1, 0, 0], [0.3, -0.2, 0], [0, 0, 0.4]]
    first, second, last = rows
    expected = [first, first, [0.2, -0.1, 0], second, [0.15, -0.1, 0.2], last, last]
    np.testing.assert_allclose(linear, expected, atol=1e-16)
    steps = TableDisturbance(file=torques, between="held").sample(t, None)
    np.testing.assert_array_equal(steps, np.array(rows)[[0, 0, 0, 1, 1, 2, 2]])


def test_an_edit_of_the_file_changes_no_table_that_is_made(tmp_path, torques):
    term = TableDisturbance(file=torques)
    before = sampled(term, 0, 100).tobytes()
    (tmp_path / "torques.csv").write_text(TORQUES.replace("0.1", "0.2"))
    assert sampled(term, 0, 100).tobytes() == before
    assert TableDisturbance(file=torques) != term
    assert TableDisturbance.model_fields["file"].json_schema_extra == {"path": True}


def test_random_is_uniform_within_its_bounds():
    ticks, bound = 100_000, np.array([0.05, 0.02, 0.01])
    torque = sampled(RandomDisturbance(bound_Nm=tuple(bound.tolist())), 0, ticks)
    t = PERIOD * np.arange(ticks)
    envelope = np.stack([np.cos(np.pi * t), -np.sin(np.pi * t), np.exp(-np.pi * t)], axis=1)
    assert np.all(np.abs(torque) <= bound * np.abs(envelope) + 1e-15)
    known = np.abs(envelope) > 0.01
    for axis in range(3):
        share = (torque[:, axis] / bound[axis])[known[:, axis]] / envelope[known[:, axis], axis]
        count = len(share)
        # Mean 0 with variance 1/3, and its estimate with variance (1/5 - 1/9) / n: four standard deviations.
        assert abs(share.mean()) < 4 * np.sqrt(1 / 3 / count)
        assert abs(share.var() - 1 / 3) < 4 * np.sqrt((1 / 5 - 1 / 9) / count)
        assert abs(np.corrcoef(share[1:], share[:-1])[0, 1]) < 4 / np.sqrt(count)
    first = np.flatnonzero(known.all(axis=1))
    shares = (torque[first] / bound) / envelope[first]
    np.testing.assert_allclose(shares, shares[:, :1] * np.ones(3), atol=1e-13)  # one factor for all axes


def test_draws_count_by_tick_for_any_seed():
    far = 10**15
    for seed in (0, 2**200):
        whole = term_draws(seed, far, 20, 0)
        assert whole[7:9].tobytes() == term_draws(seed, far + 7, 2, 0).tobytes()
        assert not np.any(whole == term_draws(seed, far, 20, 1))
        assert len(np.unique(whole)) == 20


def test_bad_table_is_refused_on_one_line(tmp_path, torques):
    (tmp_path / "torques.csv").write_text(TORQUES.replace("0.3", "2000"))
    with pytest.raises(InputError) as refusal:
        TableDisturbance(file=torques)
    expected = (
        f"disturbance {torques}: line 3: expected a number from -1000 to 1000 as alpha_Nm, received '2000'"
    )
    assert str(refusal.value) == expected
