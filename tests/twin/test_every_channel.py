"""What every stage's columns owe, whichever stage it is."""

import numpy as np
import pytest

from spheretwin import scenario as scenarios
from spheretwin.control.law import Law
from spheretwin.loop.channels import CHANNELS
from spheretwin.models.base.errors import InputError
from spheretwin.models.telemetry.signals import Signal, common_signals
from spheretwin.session import Session

SIGNALS = [signal for columns in CHANNELS for signal in columns.signals(18)]


@pytest.mark.parametrize("columns", CHANNELS, ids=lambda each: each.signals(18)[0].name)
@pytest.mark.parametrize(
    "changes",
    [{}, {"hardware": "prototype", "plant.engine": "lagrangian"}],
    ids=["nothing acts", "stages act"],
)
def test_every_column_is_there_where_its_stage_says_so_and_moves_no_other(columns, changes):
    with Session(scenarios.load("hold", {"duration": 0.02, **changes})) as session:
        table, scenario = session.advance(20), session.scenario
    names = [signal.name for signal in table.signals]
    for signal in columns.signals(18):
        assert (signal.name in names) == columns.logged(scenario)
        if signal.name in names:
            assert np.isfinite(table[signal.name]).all()
    others = [signal.name for signal in common_signals(18)]
    assert names[: len(others)] == others


@pytest.mark.parametrize("taken", SIGNALS, ids=lambda each: each.name)
def test_every_column_s_names_are_refused_to_a_law(taken):
    law = Law("mine", lambda *_: None, [], np.zeros(1), (Signal(taken.name, "1", 1, ""),))
    with pytest.raises(InputError, match=f"expected new names of signals, received {taken.name}"):
        Session(scenarios.load("hold"), law)


@pytest.mark.parametrize("signal", SIGNALS, ids=lambda each: each.name)
def test_every_column_is_documented(signal):
    assert signal.unit
    assert signal.meaning
    assert len(signal.labels) == signal.size or signal.size == 1  # one number needs no label beside its name
