"""Commands of scripts: `do` waits and raises, `until` waits for a condition, outcomes are distinct."""

import pytest

from spheretwin.bench.command_queue import CommandOutcome, Ticket, settled_ticket
from spheretwin.models.base.errors import InputError, SpheretwinError
from tests.twin.bench.cases import paused
from tests.waiting import UNLIMITED_S


def test_outcomes_of_waiting_are_distinct():
    assert Ticket().wait(0.0) == CommandOutcome.TIMED_OUT
    assert settled_ticket().wait(0.0) == CommandOutcome.DONE
    assert settled_ticket("no").wait(0.0) == CommandOutcome.REFUSED
    assert settled_ticket("no").refused == "no"


@pytest.mark.parametrize("in_thread", [False, True])
def test_a_script_waits_for_commands_and_conditions(in_thread):
    with paused() as made:
        if in_thread:
            made.begin()
        assert made.do("start", UNLIMITED_S).running
        state = made.until(lambda state: state.t_s >= 0.1, UNLIMITED_S)
        assert state.t_s >= 0.1
        with pytest.raises(InputError, match="expected a group from 0 to 17, received 99"):
            made.do("manual", UNLIMITED_S, group=99)
        with pytest.raises(InputError, match="expected one of start"):
            made.do("strat")
        with pytest.raises(SpheretwinError, match=r"received: it was not within 0\.05 s"):
            made.until(lambda state: state.mode == "replay", timeout_s=0.05)
        assert made.do("hold", UNLIMITED_S).mode == "hold"


def test_until_ends_with_the_run_and_with_a_pause():
    with paused(disturbance__load=1000.0) as made:
        with pytest.raises(SpheretwinError, match="received a pause"):
            made.until(lambda state: state.t_s > 1.0)
        made.do("start")
        with pytest.raises(SpheretwinError, match=r"left_workspace|diverged"):
            made.until(lambda state: False)


def test_a_command_that_is_not_executed_in_time_is_no_refusal(monkeypatch):
    with paused() as made:
        monkeypatch.setattr(made._processor, "process", lambda waits: None)
        with pytest.raises(SpheretwinError, match=r"expected hold to be executed within 0\.01 s") as caught:
            made.do("hold", timeout_s=0.01)
        assert not isinstance(caught.value, InputError)
