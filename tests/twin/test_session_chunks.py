"""The same bytes, whatever the chunks."""

import functools

import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st

from spheretwin import scenario as scenarios
from spheretwin.loop.inputs import BLOCK_TICKS
from spheretwin.models.base.errors import InputError
from spheretwin.session import Session
from tests.twin.session_cases import COMPLETE, ENGINES, SHIPPED, WORN, rows, scenario

LENGTH = 2 * BLOCK_TICKS + 300
VARIANTS = ("ideal", "worn", "complete")


def changes_of(law, engine, variant):
    changes = {"ideal": {}, "worn": WORN, "complete": COMPLETE[engine]}[variant]
    return {"controller.law": law, "plant.engine": engine} | changes


@functools.cache
def whole(law, engine, variant):
    """Rows of one long call."""
    return rows(Session(scenario(**changes_of(law, engine, variant))).advance(LENGTH))


@settings(max_examples=60)
@given(
    law=st.sampled_from(SHIPPED),
    engine=st.sampled_from(ENGINES),
    variant=st.sampled_from(VARIANTS),
    cuts=st.lists(st.integers(0, LENGTH) | st.sampled_from([0, 1, 999, 1000, 1001, 1999, 2000]), max_size=12),
)
@example("afsm", "mujoco", "complete", [0, 0, 1, 999, 1000, 1000, 1001, 2000])
@example("pd", "lagrangian", "ideal", list(range(960, 1040)))
def test_chunks_change_no_bit(law, engine, variant, cuts):
    ends = [*sorted(cuts), LENGTH]
    chunked = Session(scenario(**changes_of(law, engine, variant)))
    parts = [chunked.advance(end - start) for start, end in zip([0, *ends], ends, strict=False)]
    assert b"".join(map(rows, parts)) == whole(law, engine, variant)
    assert chunked.tick == LENGTH


def test_chunks_do_not_decide_where_a_disturbance_is_lost():
    # exp(pi t) is infinite from 225.93 s on; the bound is small enough for the run to get there.
    changes = {
        "controller.law": "pd", "controller.period_s": 0.02, "plant.step_s": 0.02,
        "plant.engine": "lagrangian", "disturbance.random_bound_Nm": 1e-310,
        "disturbance.gamma_envelope": "growing",
    }  # fmt: skip
    last = int(np.log(np.finfo(float).max) / np.pi / 0.02) + 1
    for chunk in (10 * BLOCK_TICKS, 700, 1):
        long = Session(scenarios.load("hold", changes))
        long.advance(last - 50)
        while long.tick < last:
            long.advance(chunk)
        assert (long.status, long.tick) == ("running", last)
        with pytest.raises(InputError, match="finite disturbance"):
            long.advance(chunk)
        assert long.tick == last
