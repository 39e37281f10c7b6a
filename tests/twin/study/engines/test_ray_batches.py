"""Batches: every row once, a second each, and back again when they are lost."""

from itertools import pairwise

from hypothesis import given
from hypothesis import strategies as st

from spheretwin.study.engines import engine
from spheretwin.study.engines.engine import Batches


@given(
    count=st.integers(0, 5000),
    at_a_time=st.integers(1, 64),
    row_s=st.floats(1e-6, 100.0),
    losses=st.lists(st.booleans(), max_size=40),
)
def test_every_row_lands_once_whatever_is_lost(count, at_a_time, row_s, losses):
    cut, landed, lost = Batches(iter(range(count)), count), [], iter(losses)
    while batch := cut.next(at_a_time):
        if next(lost, False) and len(batch) > 1:
            assert cut.lost(batch)
        else:
            landed += batch
            cut.landed(len(batch), row_s * len(batch))
    assert sorted(landed) == list(range(count))


@given(row_s=st.floats(1e-3, 1.0))
def test_a_batch_grows_until_it_lasts_long_enough(row_s):
    cut = Batches(iter(range(10**9)), 10**9)
    sizes = [len(cut.next(1)) for _ in range(12) if cut.landed(cut.rows, cut.rows * row_s) is None]
    assert all(after <= 2 * before for before, after in pairwise(sizes))
    # Rounded down to whole rows; twelve doublings reach the largest batch.
    assert sizes[-1] == int(min(max(engine.TASK_S / row_s * (1 + 1e-12), 1), engine.MOST_ROWS))


def test_one_slow_batch_does_not_undo_what_was_learnt():
    cut = Batches(iter(range(10**9)), 10**9)
    cut.rows = 512
    cut.landed(1, 3.0)  # first row of a process, with all that is read once
    assert cut.rows == 256


def test_towards_the_end_all_have_something_to_do():
    cut = Batches(iter(range(100)), 100)
    cut.rows = 1000
    assert len(cut.next(4)) == 13  # an eighth: two batches for each of four


def test_a_row_that_is_lost_again_and_again_is_found_among_others():
    cut, bad, alone = Batches(iter(range(64)), 64), 37, []
    cut.rows = 64
    landed = []
    while batch := cut.next(1):
        if bad in batch:
            alone.append(batch)
            if not cut.lost(batch):
                break
        else:
            landed += batch
    assert alone[-1] == [bad]
    assert bad not in landed
