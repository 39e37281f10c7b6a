"""What every metric of the registry owes, whichever it is."""

import json
import pickle

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from spheretwin import scenario as scenarios
from spheretwin.metrics import METRICS
from spheretwin.metrics.reduction import PlannedRun
from spheretwin.models.telemetry.signals import width
from spheretwin.models.telemetry.table import Table
from spheretwin.run import figures_of
from spheretwin.simulation import simulate


@pytest.fixture(scope="module")
def runs():
    """One that meets the current limit, one that holds still, one that ends early."""
    return [
        simulate(scenarios.load("nutation", {"duration": 1.3})),
        simulate(scenarios.load("hold", {"duration": 0.3})),
        simulate(scenarios.load("sinusoid", {"controller.law": "pd", "disturbance.load": 5.0})),
    ]


@pytest.mark.parametrize("name", METRICS)
def test_every_metric_is_what_json_holds_and_none_without_a_row(runs, name):
    for run in runs:
        empty = METRICS[name](planned_for(run))
        assert (empty.values()[0], empty.warnings()) == (None, [])
        value = figures_of(run)[name]
        assert json.loads(json.dumps(value, allow_nan=False)) == value


def planned_for(run):
    return PlannedRun(run.scenario, run.actuator, run.scenario.ticks)


def in_chunks(run, name, ends):
    metric = METRICS[name](planned_for(run))
    table = run.telemetry
    for first, last in zip([0, *ends], [*ends, len(table)], strict=True):
        if last > first:
            metric.write(table.rows(first, last))
    return metric.values()[0]


@pytest.mark.parametrize("name", METRICS)
@settings(max_examples=25)
@given(data=st.data())
def test_every_metric_s_bits_are_those_of_any_chunks(runs, name, data):
    run = data.draw(st.sampled_from(runs))
    ends = sorted(data.draw(st.lists(st.integers(0, len(run.telemetry)), max_size=8)))
    assert in_chunks(run, name, ends) == in_chunks(run, name, [])


@pytest.mark.parametrize("name", METRICS)
def test_every_metric_s_memory_does_not_hold_the_rows(runs, name):
    """A kilobyte for 10,000 ticks at most, where the rows take 600."""
    run, sizes = runs[0], []
    metric, signals = METRICS[name](PlannedRun(run.scenario, run.actuator, 40_000)), run.telemetry.signals
    for _ in range(3):
        metric.write(Table(signals, np.random.default_rng(0).normal(size=(10_000, width(signals)))))
        state = {key: value for key, value in vars(metric).items() if key != "planned"}
        sizes.append(len(pickle.dumps(state)))
    # 40 pieces of three sums, and the bytes by which longer counts are written.
    assert max(np.diff(sizes)) <= 1000
