"""What a telemetry file says of its run: typed, and the same texts as ever."""

import json

import pytest
from hypothesis import given
from hypothesis import strategies as st

from spheretwin.models.base.errors import InputError
from spheretwin.models.telemetry.run_record import Change, RunRecord
from spheretwin.models.telemetry.status import Status

texts = st.text(st.characters(codec="utf-8"))
values = st.recursive(
    st.none() | st.booleans() | st.integers() | st.floats(allow_nan=False) | texts,
    lambda inner: st.lists(inner, max_size=3) | st.dictionaries(texts, inner, max_size=3),
    max_leaves=8,
)
records = st.builds(
    RunRecord,
    scenario=st.dictionaries(texts, values, max_size=3),
    journal=st.lists(st.builds(Change, st.integers(0), texts, values), max_size=3).map(tuple),
    ticks=st.integers(0),
    files=st.dictionaries(texts, st.none() | texts, max_size=3),
    versions=st.dictionaries(texts, texts, max_size=3),
    status=st.none() | st.sampled_from(Status),
)


@given(records)
def test_a_record_comes_back_from_its_texts(record):
    assert RunRecord.from_metadata(record.metadata()) == record


def test_the_texts_are_those_that_files_have_always_had():
    record = RunRecord(
        {"seed": 3}, (Change(7, "disturbance.load", 2.0),), 20, {"/m.xml": None}, {"python": "3"}
    )
    known = {
        "scenario": '{"seed": 3}',
        "journal": '[[7, "disturbance.load", 2.0]]',
        "ticks": "20",
        "files": '{"/m.xml": null}',
        "versions": '{"python": "3"}',
    }
    assert record.metadata() == known
    assert list(record.metadata()) == list(known)  # a file's bytes follow their order


def test_what_older_files_do_not_say_is_nothing():
    record = RunRecord.from_metadata({"scenario": "{}", "journal": "[]", "ticks": "1"})
    assert (record.files, record.versions, record.status) == ({}, {}, None)


def test_a_status_that_is_none_is_refused():
    with pytest.raises(InputError, match="received 'flying'"):
        RunRecord.from_metadata({"scenario": "{}", "journal": "[]", "ticks": "1", "status": "flying"})


@pytest.mark.parametrize("missing", ["scenario", "journal", "ticks"])
def test_a_record_needs_what_a_run_is_made_of(missing):
    known = {"scenario": "{}", "journal": json.dumps([]), "ticks": "1"}
    del known[missing]
    with pytest.raises(InputError, match=f"received no {missing}"):
        RunRecord.from_metadata(known)
