"""What a telemetry file says of its run: typed, and the same texts as ever."""

from hypothesis import given
from hypothesis import strategies as st

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
