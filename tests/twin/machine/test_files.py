"""Files of logs: each format gives the same log back, and other programs read it."""

import re
import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pyarrow as pa
import pyarrow.parquet
import pytest

import spheretwin as st
from spheretwin import machine
from spheretwin.machine import Log
from spheretwin.machine.files import OTHER_FORMATS
from spheretwin.machine.log import log_signals
from spheretwin.models.base.errors import InputError
from spheretwin.models.telemetry import joint_states
from spheretwin.models.telemetry.joint_states import Topic

GREEK = {"alpha": "α", "beta": "β", "gamma": "γ"}
TIMES = np.arange(50) * 1e-3
RANDOM = np.random.default_rng(0)
LOG = Log(
    TIMES, RANDOM.normal(size=(50, 18)), RANDOM.normal(size=(50, 3)), "measured", "a",
    {"plant.payload_kg": 0.05}, ("gaps",),
)  # fmt: skip


@pytest.mark.parametrize("suffix", [".parquet", ".csv", ".mcap"])
def test_a_log_comes_back(tmp_path, suffix):
    """Under any name: the first bytes tell the format."""
    machine.write(LOG, path := tmp_path / f"log{suffix}")
    log = machine.read(path := path.rename(tmp_path / f"log{suffix}.dat"), accepted=("jitter",))
    assert np.array_equal(log.current_A, LOG.current_A)
    assert np.array_equal(log.angle_rad, LOG.angle_rad)
    # MCAP counts nanoseconds.
    assert np.array_equal(log.t_s, TIMES) if suffix != ".mcap" else np.max(np.abs(log.t_s - TIMES)) < 1e-12
    assert (log.currents, log.name) == ("measured", str(path))
    if suffix != ".csv":
        assert (log.conditions, log.accepted) == ({"plant.payload_kg": 0.05}, ("gaps", "jitter"))


def test_a_column_without_a_number_is_missing_and_no_column_stands_twice(tmp_path):
    machine.write(replace(LOG, angle_rad=np.full((50, 3), np.nan)), path := tmp_path / "log.csv")
    assert np.all(np.isnan(machine.read(path).angle_rad))
    path.write_text(path.read_text().replace("angle_rad_beta", "angle_rad_alpha"))
    with pytest.raises(InputError, match="expected each column once, received angle_rad_alpha twice"):
        machine.read(path)


def test_columns_are_scalars_with_plain_names(tmp_path):
    machine.write(replace(LOG, currents="commanded"), path := tmp_path / "log.parquet")
    schema = pyarrow.parquet.read_schema(path)
    assert schema.names == [
        "t_s", "angle_rad_alpha", "angle_rad_beta", "angle_rad_gamma",
        *(f"current_command_A_{group}" for group in range(18)),
    ]  # fmt: skip
    assert set(schema.types) == {pa.float64()}


def test_a_log_that_a_spreadsheet_has_saved_is_read_without_a_column_map(tmp_path):
    machine.write(LOG, path := tmp_path / "log.csv")
    head, rows = path.read_text().split("\n", 1)
    names = head.split(",")
    units = dict.fromkeys(names, "A") | {"t_s": "s"} | dict.fromkeys(names[1:4], "rad")
    path.write_text(",".join(f"{name.upper()} [{unit}]" for name, unit in units.items()) + "\n" + rows)
    log = machine.read(path)
    assert (log.digest, log.currents) == (LOG.digest, "measured")


def test_telemetry_is_a_log(tmp_path):
    run = st.simulate("hold", {"duration": 0.1})
    run.save(path := tmp_path / "run.parquet")
    log = machine.read(path)
    assert np.array_equal(log.angle_rad, run.telemetry["q_rad"])
    assert np.array_equal(log.current_A, run.telemetry["current_command_A"])


@pytest.mark.parametrize("former", [False, True])
def test_names_of_telemetry_are_names_of_a_log(tmp_path, former):
    """As `review --export run.csv` writes them, and as it wrote them in former versions."""
    signals = log_signals(18, ("measured",))
    heads = [scalar.name for signal in signals for scalar in signal.scalars()]
    rows = np.column_stack([LOG.t_s, LOG.angle_rad, LOG.current_A])
    path = tmp_path / "run.csv"
    if former:
        heads = [re.sub(r"_(\d+)$", r"[group \1]", head) for head in heads]
        heads = [re.sub(r"_(alpha|beta|gamma)$", lambda end: f"[{GREEK[end[1]]}]", head) for head in heads]
    path.write_text("\n".join([",".join(heads), *(",".join(map(repr, row)) for row in rows.tolist())]))
    log = machine.read(path)
    assert (log.digest, log.currents, log.notes) == (LOG.digest, "measured", ())


@pytest.mark.parametrize("size", [3, -1])
def test_vectors_with_missing_rows_and_structures_are_read(size, tmp_path):
    """A vector of fixed or variable length that is missing, or shorter than others; a structure."""
    vectors = [[1.0, 2.0, 3.0], None, [4.0, 5.0, 6.0], None if size == 3 else [7.0]]
    columns = {
        "t_s": pa.array([0.0, 0.1, 0.2, 0.3]),
        "q": pa.array(vectors, pa.list_(pa.float64(), size)),
        "i": pa.array([{"a": 1.0, "b": [2, 3]}] * 3 + [None]),
    }
    pyarrow.parquet.write_table(pa.table(columns), path := tmp_path / "log.parquet")
    fields = {
        "angles": {"columns": ["q_0", "q_1", "q_2"]},
        "currents": {"columns": ["i.a", "i.b_0", "i.b_1"]},
    }
    log = machine.read(path, fields)
    last = np.nan if size == 3 else 7.0
    expected = [[1, 2, 3], [np.nan] * 3, [4, 5, 6], [last, np.nan, np.nan]]
    assert np.array_equal(log.angle_rad, expected, equal_nan=True)
    assert np.array_equal(log.current_A, [[1, 2, 3]] * 3 + [[np.nan] * 3], equal_nan=True)


def test_a_file_with_other_names_needs_a_column_map(tmp_path):
    (path := tmp_path / "other.csv").write_text("stamp,pose_0,pose_1,pose_2,i\n0,1,2,3,\n1000,4,5,6,7.5\n")
    with pytest.raises(InputError, match="expected a column map"):
        machine.read(path)


def test_topics_with_times_of_their_own_are_read_at_those_of_the_angles(tmp_path):
    # As in a recording of ROS: angles and currents arrive in turn, and neither has the other's stamps.
    joint_states.write(tmp_path / "a.mcap", np.array([0.0, 0.002]), {
        "angles": Topic(joint_states.ANGLE_NAMES, {"position": np.ones((2, 3))}),
    }, {})  # fmt: skip
    assert joint_states.read(tmp_path / "a.mcap").time_ns.tolist() == [0, 2_000_000]
    from mcap.writer import Writer

    with (path := tmp_path / "b.mcap").open("wb") as file:
        writer = Writer(file)
        writer.start()
        schema = writer.register_schema(joint_states.TYPE, "ros2msg", joint_states.DEFINITION.encode())
        topics = {
            "/angles": Topic(joint_states.ANGLE_NAMES, {"position": np.ones((2, 3))}),
            "/currents": Topic(["0", "1"], {"effort": np.full((2, 2), 2.0)}),
        }
        channels = {name: writer.register_channel(name, "cdr", schema) for name in topics}
        for row in range(2):
            for place, (name, topic) in enumerate(topics.items()):
                stamp_ns = 1000 * (2 * row + place)
                message = joint_states.MessageEncoder(topic).message(row, stamp_ns)
                writer.add_message(channels[name], stamp_ns, message, stamp_ns)
        writer.finish()
    states = joint_states.read(path)
    assert states.time_ns.tolist() == [0, 1000, 2000, 3000]
    assert np.isnan(states.columns["currents/effort/0"]).tolist() == [True, False, True, False]
    log = machine.read(path)
    assert log.t_s == pytest.approx([0, 2e-6], abs=1e-12)
    assert log.current_A == pytest.approx(np.full((2, 2), 2.0))


def test_rerun_shows_each_number_by_name(tmp_path):
    machine.write(LOG, path := tmp_path / "log.mcap")
    rerun = Path(sys.executable).with_name("rerun")
    out = tmp_path / "log.rrd"
    subprocess.run([rerun, "mcap", "convert", path, "-o", out], check=True, capture_output=True)
    import rerun as rr

    names, values = {}, {}
    for chunk in rr.chunk.RrdReader(str(out)).stream():
        batch = chunk.to_record_batch().to_pydict()
        for row in batch.get("SeriesLines:names", []):
            names[chunk.entity_path] = row or names.get(chunk.entity_path)
        for row in filter(None, batch.get("Scalars:scalars", [])):
            values.setdefault(chunk.entity_path, []).append(row)
    assert np.array_equal(values["/angles/position"], LOG.angle_rad)
    assert np.array_equal(values["/currents/effort"], LOG.current_A)
    assert names["/angles/position"] == ["alpha", "beta", "gamma"]


@pytest.mark.parametrize("suffix", [".parquet", ".csv", ".mcap", ".txt"])
def test_a_file_that_cannot_be_read_is_refused(tmp_path, suffix):
    (path := tmp_path / f"log{suffix}").write_bytes(b"\x00\x01no log")
    for file in (path, tmp_path / f"missing{suffix}"):
        with pytest.raises(InputError, match="expected"):
            machine.read(file)


@pytest.mark.parametrize("start", OTHER_FORMATS, ids=lambda start: start[:4].hex())
def test_files_of_other_formats_are_named(start, tmp_path):
    (path := tmp_path / "log.csv").write_bytes(start + bytes(100))
    with pytest.raises(InputError, match=r"expected CSV, Parquet or MCAP, received .*: "):
        machine.read(path)


def test_parquet_of_a_killed_writer_says_so(tmp_path):
    machine.write(LOG, path := tmp_path / "log.parquet")
    path.write_bytes(path.read_bytes()[:-100])
    with pytest.raises(
        InputError, match="expected Parquet with its end, received none: its writer was killed"
    ):
        machine.read(path)


def test_another_suffix_is_refused(tmp_path):
    with pytest.raises(InputError, match=r"expected a file .parquet, .csv or .mcap"):
        machine.write(LOG, tmp_path / "log.txt")
