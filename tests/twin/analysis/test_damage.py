"""Damaged files of a run: a flipped bit is reported on one line, or it changes nothing that is read."""

import json
import os
import random
import subprocess
import sys

import numpy as np
import pytest

from spheretwin import cli
from spheretwin import scenario as scenarios
from spheretwin.analysis import recovery
from spheretwin.analysis.recorded_run import read
from spheretwin.analysis.run_summary import figures
from spheretwin.models.base.errors import InputError
from spheretwin.models.telemetry.checksums import METADATA, NO_CHECKSUMS
from spheretwin.models.telemetry.parquet import TelemetryFile
from spheretwin.records import replay
from spheretwin.records.outputs import Outputs
from spheretwin.records.provenance import record_of
from spheretwin.session import Session
from spheretwin.simulation import follow
from tests.twin.analysis.runs import PLANT, WITH_EVENTS

# The path of a file below the folder of a test, and a sentence.
LONGEST_LINE = 600

# Kind of the message with the name of a run or of a layout.
NAME = 1

# What a user is told of damage names the place.
PLACES = ("row group 0", "footer", "entity ", "at byte ", "chunk ", "so damaged that Rerun crashes")


@pytest.fixture(scope="module")
def decimated(tmp_path_factory):
    """Recording that keeps 60 rows a second."""
    path = tmp_path_factory.mktemp("decimated") / "run.rrd"
    with Session(scenarios.load("hold", WITH_EVENTS)) as session:
        outputs = Outputs(session, path, None, live=False, record_rate_Hz=60.0)
        follow(session, session.scenario.ticks, outputs.sinks)
        assert outputs.close() == []
    return path


def flips(content, count, seed=0):
    """Places of single bits, and the content with each flipped."""
    draws = random.Random(seed)
    for bit in (draws.randrange(8 * len(content)) for _ in range(count)):
        damaged = bytearray(content)
        damaged[bit // 8] ^= 1 << bit % 8
        yield bit, bytes(damaged)


def refused(printed, path):
    """True if what was printed is one line of bounded length about a file."""
    (line,) = printed.err.splitlines()
    assert printed.out == ""
    assert line.startswith("spheretwin: ")
    assert str(path) in line
    assert len(line) <= LONGEST_LINE, line
    return any(place in line for place in PLACES)


def read_unless_refused(path):
    try:
        return read(path)
    except InputError:
        return None


def same_run(run, other):
    messages = [json.dumps({**figures(each), "path": ""}) for each in (run, other)]
    same_table = run.table.signals == other.table.signals and np.array_equal(
        run.table.values.view(np.uint64), other.table.values.view(np.uint64)
    )
    return same_table and messages[0] == messages[1] and run.metadata == other.metadata


def passed(path, content, whole, capfd):
    """Review of a file with some content: True if it is refused, or the same as the whole run."""
    path.write_bytes(content)
    if cli.main(["review", str(path), "--json"]) == cli.DONE:
        printed = capfd.readouterr()
        thinned = [f"spheretwin: warning: {path} keeps 60 rows a second"] if whole.rate_Hz else []
        messages = [line.split(" and those")[0] for line in printed.err.splitlines()]
        return messages == thinned and same_run(read(path), whole)
    return refused(capfd.readouterr(), path)


@pytest.mark.release("flips bits of whole files for 7 s; test_checksums.py has each kind of damage")
@pytest.mark.parametrize(
    ("kind", "count"), [(0, 120), (1, 35), (2, 8)], ids=["telemetry", "recording", "few rows"]
)
def test_a_flipped_bit_is_reported_or_changes_nothing(files, decimated, tmp_path, capfd, kind, count):
    source = (*files, decimated)[kind]
    whole, path = read(source), tmp_path / source.name
    for bit, content in flips(source.read_bytes(), count):
        assert passed(path, content, whole, capfd), f"bit {bit}"


def test_rows_that_a_recording_leaves_out_are_no_damage(decimated):
    assert read(decimated).checked
    assert 0 < len(read(decimated).table) < 1000


@pytest.mark.release("a process for 1.2 s; changes with Rerun")
def test_rerun_writes_no_line_of_its_own(decimated, tmp_path):
    """Rerun reports some damage that changes no telemetry in its own log, as that of the layout's name."""
    content, path = bytearray(decimated.read_bytes()), tmp_path / "run.rrd"
    *_, layout = (place for place in places_of_messages(decimated) if content[place] == NAME)
    content[content.index(b"spheretwin-", layout)] ^= 1 << 3  # {pheretwin-
    path.write_bytes(content)
    environment = {name: value for name, value in os.environ.items() if name != "RUST_LOG"}
    done = subprocess.run(
        [sys.executable, "-m", "spheretwin", "review", str(path), "--json"],
        env=environment,
        capture_output=True,
        text=True,
    )
    (line,) = done.stderr.splitlines()
    assert line.startswith(f"spheretwin: warning: {path} keeps 60 rows a second")
    assert (done.returncode, same_run(read(path), read(decimated))) == (cli.DONE, True)


def test_facts_that_are_lost_are_reported_as_damage(files, tmp_path):
    """A message of another kind is skipped: what it has is missing in a recording with checksums."""
    content, path = bytearray(files[1].read_bytes()), tmp_path / "run.rrd"
    facts = content.index(b"scenario")
    content[max(place for place in places_of_messages(files[1]) if place < facts)] ^= 1
    path.write_bytes(content)
    with pytest.raises(InputError, match="in entity scenario, component facts: the file is damaged"):
        read(path)


def test_every_bit_of_the_footer_counts(files, tmp_path):
    """The footer states where columns are, how they are encoded, and what was run."""
    content, path = files[0].read_bytes(), tmp_path / "run.parquet"
    size = int.from_bytes(content[-8:-4], "little") + 8
    for bit, footer in flips(content[-size:], 300):
        path.write_bytes(content[:-size] + footer)
        with pytest.raises(InputError, match=r"the footer|expected a telemetry file"):
            replay.read(path)
        with pytest.raises(InputError, match=r"the footer|expected a telemetry file"):
            recovery.recover(path, tmp_path / "out.parquet")
        assert not (tmp_path / "out.parquet").exists(), f"bit {bit}"


def test_damage_is_reported_with_row_group_and_column(files, tmp_path):
    import pyarrow.parquet

    content, path = files[0].read_bytes(), tmp_path / "run.parquet"
    described = pyarrow.parquet.ParquetFile(files[0]).metadata.row_group(0)
    columns = [described.column(place) for place in range(described.num_columns)]
    (current,) = (each for each in columns if each.path_in_schema.startswith("current_A"))
    damaged = bytearray(content)
    damaged[current.data_page_offset + current.total_compressed_size // 2] ^= 1
    path.write_bytes(damaged)
    with pytest.raises(
        InputError, match="row group 0, rows 0 to 2199, column current_A: the file is damaged"
    ):
        read(path)


# --- what killed processes leave


@pytest.fixture(scope="module")
def left(tmp_path_factory):
    """Folder of parts: two whole batches of a run that goes on."""
    folder = tmp_path_factory.mktemp("left")
    session = Session(scenarios.load("hold", {**PLANT, "duration": 9.0}))
    file = TelemetryFile(folder / "run.parquet", session.signals, record_of(session).metadata())
    for _ in range(2):
        file.write(session.advance(4096))
    yield next(folder.glob(".run.parquet.*.parts"))
    file.close({})


def test_a_flipped_bit_of_flushed_rows_is_reported(left, tmp_path):
    (folder := tmp_path / ".run.parquet.00.parts").mkdir()
    whole = read(left)
    assert whole.checked
    for part in left.iterdir():
        (folder / part.name).write_bytes(part.read_bytes())
    assert same_run(read(folder), whole)
    for part in left.iterdir():
        for bit, content in flips(part.read_bytes(), 30):
            (folder / part.name).write_bytes(content)
            with pytest.raises(
                InputError, match=r"000000\.arrows.* (batch [01]|line [01]): the file is damaged"
            ):
                recovery.recover(folder, tmp_path / "out.parquet")
            assert not (tmp_path / "out.parquet").exists(), f"{part.name}, bit {bit}"
        (folder / part.name).write_bytes(part.read_bytes())


def test_a_flipped_bit_of_a_recording_without_an_end_costs_no_row_behind_it(files, tmp_path):
    """A damaged length is not taken for the end that a killed process leaves."""
    content, path = files[1].read_bytes(), tmp_path / ".run.rrd.00.part"
    path.write_bytes(content[: int(0.8 * len(content))])
    whole = read(path)
    assert not whole.whole
    assert len(whole.table) >= 1000
    messages = places_of_messages(path)
    for place in messages[1:-1][:: len(messages) // 12]:
        for bit in (0, 3, 8, 17, 30, 64, 66, 70, 80, 85, 100):  # kind, then length
            damaged = bytearray(content[: int(0.8 * len(content))])
            damaged[place + bit // 8] ^= 1 << bit % 8
            path.write_bytes(damaged)
            run = read_unless_refused(path)
            assert run is None or same_run(run, whole), f"message at {place}, bit {bit}"


def places_of_messages(path):
    """Places of the messages of a recording."""
    content, places = path.read_bytes(), [12]
    while places[-1] + 16 <= len(content):
        length = int.from_bytes(content[places[-1] + 8 : places[-1] + 16], "little")
        places.append(places[-1] + 16 + length)
    return places[:-1]


def test_a_recovered_recording_has_checksums_that_hold(files, tmp_path):
    content, path = files[1].read_bytes(), tmp_path / ".run.rrd.00.part"
    path.write_bytes(content[: int(0.8 * len(content))])
    assert recovery.recover(path, tmp_path / "whole.rrd").checked
    assert read(tmp_path / "whole.rrd").checked


# --- files of earlier versions


CHECKSUMS = ["checksum", "total", "facts_checksum", "described_checksum_0", "described_checksum_1"]


def without_checksums(source, target):
    """A file as earlier versions wrote it."""
    import pyarrow.parquet
    import rerun as rr
    from rerun.chunk import RrdReader

    if source.suffix == ".parquet":
        arrow = pyarrow.parquet.ParquetFile(source).read()
        metadata = {
            name: text for name, text in arrow.schema.metadata.items() if name.decode() not in METADATA
        }
        pyarrow.parquet.write_table(arrow.replace_schema_metadata(metadata), target)
        return
    recording = rr.RecordingStream("spheretwin-old")
    recording.set_sinks(rr.FileSink(target))
    recording.send_chunks(RrdReader(source).stream().drop(components=CHECKSUMS))
    recording.flush()
    recording.disconnect()


def warned(arguments, path, capsys):
    """True if a command on a file without checksums is done with that one warning."""
    assert cli.main([*map(str, arguments)]) == cli.DONE
    return capsys.readouterr().err == f"spheretwin: warning: {path} {NO_CHECKSUMS}\n"


def test_files_without_checksums_are_used_with_a_warning(files, left, tmp_path, capsys):
    """Files of earlier versions stay readable: refusing them would lose measured runs, and none is said to
    be undamaged.
    """
    for source in files:
        path = tmp_path / source.name
        without_checksums(source, path)
        assert same_run(read(path), read(source))
        assert warned(["review", path, "--json"], path, capsys)
        if path.suffix == ".parquet":
            assert warned(["simulate", "--replay", path, "--json"], path, capsys)
    (parts := tmp_path / ".other.parquet.00.parts").mkdir()
    (parts / "000000.arrows").write_bytes((left / "000000.arrows").read_bytes())
    assert warned(["recover", parts, "--out", tmp_path / "out.parquet"], parts, capsys)
    assert len(read(tmp_path / "out.parquet").table) == 8192
