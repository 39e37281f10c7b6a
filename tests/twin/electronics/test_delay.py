"""Commands come into force exactly as many physics steps after their sample as was said."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from spheretwin.electronics.delay import Delay, DelaySection, due, latch, steps_of
from spheretwin.electronics.drive_chain import stored_delays
from spheretwin.models.base.columns import Columns

STEP_S = 5e-4


def delay_of(section, step_s, substeps, groups):
    rows = Delay.zeros(groups=groups, delays=stored_delays(section, step_s, substeps))
    rows["steps"], rows["substeps"] = steps_of(section, step_s, substeps), substeps
    return rows[0]


def in_force(made, commands, substeps):
    """The command in force at every physics step, a row each."""
    out = np.full((len(commands) * substeps, commands.shape[1]), np.nan)
    for tick, command in enumerate(commands):
        latch(made, command)
        for substep in range(substeps):
            due(made, 0, substep, out[tick * substeps + substep])
    return out


@given(st.integers(0, 23), st.integers(1, 7), st.integers(1, 30))
def test_a_command_is_held_back_by_its_steps(steps, substeps, ticks):
    commands = np.random.default_rng(ticks).normal(size=(ticks, 3))
    made = delay_of(DelaySection(delay_s=steps * STEP_S), STEP_S, substeps, 3)
    substep_commands = np.repeat(commands, substeps, axis=0)
    expected = np.concatenate([np.zeros((steps, 3)), substep_commands])[: len(substep_commands)]
    np.testing.assert_array_equal(in_force(made, commands, substeps), expected)


@pytest.mark.parametrize("substeps", [1, 2, 10])
def test_without_delay_commands_pass_bit_by_bit(substeps):
    odd = np.array([[0.0, -0.0, np.inf, -np.inf, np.nan, 5e-324, -1.7e308, 0.1]])
    out = in_force(delay_of(DelaySection(), STEP_S, substeps, odd.shape[1]), odd, substeps)
    assert out.tobytes() == np.repeat(odd, substeps, axis=0).tobytes()


def test_a_delay_that_decimal_fractions_only_nearly_divide_is_taken():
    made = delay_of(DelaySection(delay_s=0.3), 0.1, 1, 1)  # 0.3 / 0.1 is 2.9999999999999996
    assert made.steps == 3


@pytest.mark.parametrize("delay_s", [7e-4, 1e-7, STEP_S * (1 + 1e-6)])
def test_a_delay_between_physics_steps_is_refused(delay_s):
    with pytest.raises(ValueError, match=rf"drive\.delay_s .*plant\.step_s.* {delay_s!r} and 0\.0005 s"):
        steps_of(DelaySection(delay_s=delay_s), STEP_S, 2)


def test_a_delay_of_too_many_periods_is_refused():
    steps_of(DelaySection(delay_s=1.0), STEP_S, 2)
    with pytest.raises(ValueError, match="at most 1000 control periods"):
        steps_of(DelaySection(delay_s=1.0), STEP_S, 1)


@given(st.integers(0, 100), st.integers(0, 1000), st.integers(1, 7))
def test_the_history_holds_the_longest_delay_by_faults(steps, more_steps, substeps):
    section = DelaySection(delay_s=steps * STEP_S)
    stored = stored_delays(section, STEP_S, substeps, more_steps)
    assert stored * substeps >= steps + more_steps + substeps  # entry 0 is the command of this period


def test_histories_of_many_rows_hold_the_longest_delay():
    columns = Columns([DelaySection(delay_s=steps * STEP_S) for steps in (0, 100, 3)])
    np.testing.assert_array_equal(steps_of(columns, STEP_S, 2), [[0], [100], [3]])
    assert stored_delays(columns, STEP_S, 2) == 64
    assert stored_delays(columns, STEP_S, np.array([[2], [1], [2]]), 28) == 256
    wrong = Columns([DelaySection(delay_s=delay_s) for delay_s in (0.0, 7e-4, 1e-7)])
    with pytest.raises(ValueError, match=r"received 0\.0007 and 0\.0005 s"):
        steps_of(wrong, STEP_S, 2)
