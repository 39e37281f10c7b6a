"""How a run stands: each status has its row, and whoever tells of it has nothing else to know."""

import json
import pickle

from spheretwin.models.telemetry.status import BY_CODE, Status
from spheretwin.plant.plant_tick import DIVERGED, GOING, LEFT_WORKSPACE


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
