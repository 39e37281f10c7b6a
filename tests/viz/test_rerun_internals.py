"""Internals of Rerun are as `viz.rerun_internals` expects; each failure names what a new version changed."""

import re
import subprocess

import numpy as np
import pytest
import rerun as rr
import rerun.blueprint as rrb
from rerun.chunk import RrdReader

from spheretwin.viz.rerun_internals import (
    HEADER_BYTES,
    PROGRAM,
    EncodedLayout,
    LogEncoder,
    check_readable,
    extent,
    messages,
    read_assets,
)
from tests.viz.recording.panels import layouts


@pytest.fixture
def recording(tmp_path):
    """A closed recording of two rows and a layout."""
    path = tmp_path / "run.rrd"
    stream = rr.RecordingStream("spheretwin-test")
    stream.set_log_time_enabled(False)
    stream.save(path)
    stream.send_columns(
        "value", [rr.TimeColumn("tick", sequence=[0, 1])], rr.Scalars.columns(scalars=np.ones(2))
    )
    stream.send_blueprint(EncodedLayout(rrb.TimeSeriesView(origin="/value", name="first")))
    stream.disconnect()
    return path


def test_the_version_is_one_whose_internals_are_known():
    assert rr.__version__.startswith("0.41."), "read viz/rerun_internals.py against the new Rerun"


def test_a_file_is_a_header_and_messages_with_kind_and_length(recording):
    result = extent(recording)
    assert result.ended, "RRF2: no footer found, or it has another kind than 0"
    assert not result.torn, "RRF2: the messages do not fill the file"
    content = recording.read_bytes()
    for cut in (content[:-1], content[: result.whole_bytes - 1]):
        recording.write_bytes(cut)
        assert extent(recording).whole_bytes <= len(cut), "RRF2: the length of a message is read wrongly"


def test_a_file_ends_with_the_place_of_its_footer(recording):
    trailer = recording.read_bytes()[extent(recording).whole_bytes :]
    assert b"RRF2FOOT" in trailer, "RRF2: the end of a file has no magic of the footer"
    assert len(trailer) <= 32, "RRF2: more than 32 bytes follow the footer"


def test_the_messages_of_a_stream_follow_its_header():
    stream = rr.RecordingStream("spheretwin-test")
    source = rr.binary_stream(stream)
    stream.log("value", rr.Scalars(1.0), static=True)
    first = source.read()
    assert first.startswith(b"RRF2"), "RRF2: a stream has another header"
    assert first[:HEADER_BYTES] + messages(first) == first[: HEADER_BYTES + len(messages(first))]
    stream.log("value", rr.Scalars(2.0), static=True)
    assert messages(source.read()), "RRF2: later parts of a stream have no messages"


def test_a_layout_is_sent_by_the_method_that_is_overridden(recording):
    reader = RrdReader(recording)
    (layout,) = reader.blueprints()
    batches = [chunk.to_record_batch() for chunk in reader.stream(store=layout)]
    names = {name for batch in batches for name in batch.schema.names}
    assert "ViewBlueprint:display_name" in names, "Blueprint._log_to_stream does not send the layout any more"
    assert "log_time" not in names, "the rows of a layout have clock times again"


def test_changes_replace_values_of_an_encoded_layout(tmp_path):
    view = rrb.TimeSeriesView(origin="/value", name="first")
    layout = EncodedLayout(view)
    renamed = rrb.archetypes.ViewBlueprint.from_fields(display_name="second")
    layout.changed({view.blueprint_path(): renamed}).save("spheretwin-test", tmp_path / "second.rbl")
    layout.save("spheretwin-test", tmp_path / "first.rbl")  # which has not changed
    for title in ("first", "second"):
        (content,) = layouts(tmp_path / f"{title}.rbl")
        assert content[f"/{view.blueprint_path()}", "ViewBlueprint:display_name"] == [[title]]


def test_encoded_values_are_those_of_a_log(tmp_path):
    encoder, points = LogEncoder(), rr.Points3D([[1, 2, 3], [4, 5, 6]], colors=[255, 0, 0])
    encoder.log("points", points, static=True)
    columns = []
    for name, send in (
        ("logged", lambda stream: stream.log("points", points, static=True)),
        ("encoded", lambda stream: stream.send_chunks(encoder.chunks().values())),
    ):
        stream = rr.RecordingStream("spheretwin-test")
        stream.save(tmp_path / name)
        send(stream)
        stream.disconnect()
        (chunk,) = (chunk for chunk in RrdReader(tmp_path / name).stream() if chunk.entity_path == "/points")
        batch = chunk.to_record_batch()
        columns.append({name: batch.column(name).to_pylist() for name in batch.schema.names if ":" in name})
    assert columns[0] == columns[1]
    assert columns[0]["Points3D:positions"] == [[[1, 2, 3], [4, 5, 6]]]


def test_the_program_verifies_a_file(recording):
    check_readable(recording, recording)
    command = [PROGRAM, "rrd", "verify", "--check-footers=false", recording]
    ended = subprocess.run(command, check=False, capture_output=True, text=True)
    assert ended.returncode == 0, f"`rerun rrd verify` has other options: {ended.stderr}"


def test_the_page_of_the_viewer_has_the_parts_that_are_replaced():
    page = read_assets()["/index.html"].content.decode()
    assert "window.fetch = (what, options)" in page, "the viewer's page has no <script> for the guard"
    links = re.findall(r"<link[^>]*>", page)
    assert not any("//" in link for link in links), (
        "the viewer's page takes files of other hosts in a new way"
    )
