"""How a run stands: each status has its row, and whoever tells of it has nothing else to know."""

import json
import pickle

import pytest

from spheretwin.models.base.errors import InputError
from spheretwin.models.telemetry.status import BY_CODE, Level, Status, named
from spheretwin.plant.plant_tick import DIVERGED, GOING, LEFT_WORKSPACE


@pytest.mark.parametrize("status", Status)
def test_every_status_has_a_level_and_a_sentence_and_is_its_own_name(status):
    assert isinstance(status.level, Level)
    assert status.text.isprintable()
    assert len(status.text.split()) > 2
    assert status == named(str(status))
    assert f"{status}" == status.value == status.name.lower()


def test_a_status_is_text_to_whoever_keeps_it():
    assert Status.COMPLETED == "completed"
    assert json.dumps(Status.LEFT_WORKSPACE) == '"left_workspace"'
    assert pickle.loads(pickle.dumps(Status.DIVERGED)) is Status.DIVERGED


def test_the_loop_s_codes_are_those_of_the_rows():
    assert BY_CODE[GOING] is Status.RUNNING
    assert BY_CODE[LEFT_WORKSPACE] is Status.LEFT_WORKSPACE
    assert BY_CODE[DIVERGED] is Status.DIVERGED
    coded = [status for status in Status if status.code is not None]
    assert list(BY_CODE.values()) == coded  # no code twice: one would have taken the other's place


def test_a_name_that_is_none_is_told_with_those_that_are():
    with pytest.raises(InputError, match=r"expected one of running, .*; did you mean completed\?"):
        named("complete")
