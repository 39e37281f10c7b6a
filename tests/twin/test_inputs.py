"""What comes from outside a loop: streams of random terms, snapshots, trajectories of the user's."""

from types import SimpleNamespace

import numpy as np
import pytest

from spheretwin import scenario as scenarios
from spheretwin.loop.inputs import BLOCK_TICKS, InputGenerator
from spheretwin.models.base.errors import InputError
from spheretwin.trajectories.shapes import Nutation

RANDOM_TERM = {"kind": "random", "bound_Nm": [0.01, 0.02, 0.03]}
LENGTH = 2 * BLOCK_TICKS + 300


def scenario(*terms, **changes):
    return scenarios.load("sinusoid", {"seed": 4, "disturbance.terms": list(terms)} | changes)


def run(exogenous, start=0, end=LENGTH):
    result, tick = [], start
    while tick < end:
        rows = exogenous.rows(tick, end - tick)
        result.append(rows)
        tick += len(rows.t)
    return [np.concatenate(parts) for parts in zip(*result, strict=True)]


@pytest.mark.parametrize("tick", [1, 999, 1000, 1001, 1700, 2000])
def test_neither_chunks_nor_another_start_change_a_bit_of_a_random_term(tick):
    whole = run(InputGenerator(scenario(RANDOM_TERM)))
    first, other = (InputGenerator(scenario(RANDOM_TERM)) for _ in range(2))
    before = run(first, end=tick)
    for generator in (first, other):
        for start, rest, rows in zip(before, run(generator, start=tick), whole, strict=True):
            assert start.tobytes() + rest.tobytes() == rows.tobytes()


def test_a_random_term_is_what_it_adds_and_leaves_the_paper_s_stream_alone():
    torque = [
        run(InputGenerator(scenario(*terms, **changes)))[2]
        for terms, changes in (
            ((), {}),
            ((RANDOM_TERM,), {}),
            ((RANDOM_TERM,), {"disturbance.load": 0.0, "disturbance.random_bound_Nm": 0.0}),
            ((RANDOM_TERM, RANDOM_TERM), {"disturbance.load": 0.0, "disturbance.random_bound_Nm": 0.0}),
        )
    ]
    np.testing.assert_allclose(torque[1] - torque[0], torque[2], atol=1e-16)
    second = torque[3] - torque[2]
    assert abs(np.corrcoef(second[:, 0], torque[2][:, 0])[0, 1]) < 4 / np.sqrt(LENGTH)


def test_a_term_may_come_in_between():
    exogenous = InputGenerator(scenario())
    before = run(exogenous, end=500)[2]
    exogenous.scenario = scenario(RANDOM_TERM)
    after = run(exogenous, start=500)[2]
    whole = run(InputGenerator(scenario(RANDOM_TERM)))[2]
    assert before.tobytes() == run(InputGenerator(scenario()))[2][:500].tobytes()
    assert after.tobytes() == whole[500:].tobytes()


def own(after=lambda samples: samples):
    """Nutation up to 1.5 s, after which it fails in a way of its own."""

    def sample(t):
        samples = Nutation().sample(t)
        return after(samples) if t[-1] > 1.5 else samples

    return SimpleNamespace(sample=sample)


def test_a_trajectory_of_the_user_s_is_followed_instead():
    followed = run(InputGenerator(scenario(), own()))
    named = run(InputGenerator(scenarios.load("nutation")))
    assert followed[1].tobytes() == named[1].tobytes()
    assert followed[2].tobytes() == run(InputGenerator(scenario()))[2].tobytes()
    generator = InputGenerator(scenario(), own())
    generator.scenario = scenario(RANDOM_TERM)
    assert run(generator)[1].tobytes() == named[1].tobytes()


def test_one_that_fails_later_is_refused_then():
    flat = InputGenerator(scenario(), own(lambda samples: samples[:, 0]))
    run(flat, end=1000)
    with pytest.raises(InputError, match=r"expected float64 of shape \(1000, 3, 3\)"):
        flat.rows(1000, 1)
    until_1700 = np.arange(1000)[:, None, None] < 700
    lost = InputGenerator(scenario(), own(lambda samples: np.where(until_1700, samples, np.nan)))
    assert len(run(lost, end=1700)[0]) == 1700
    with pytest.raises(InputError, match=r"expected a finite trajectory, received NaN at 1\.7 s"):
        lost.rows(1700, 1)
