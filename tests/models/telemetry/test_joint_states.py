"""Joint states in MCAP: every number comes back, and the bytes are CDR as the OMG specifies it."""

import random
import struct

import numpy as np
import pytest
from mcap.reader import make_reader
from mcap.writer import CompressionType, Writer

from spheretwin.models.base.errors import InputError
from spheretwin.models.telemetry import joint_states
from spheretwin.models.telemetry.joint_states import ANGLE_NAMES, DEFINITION, TYPE, Topic

TIMES = np.array([0.0, 0.001, 1.5, 12345.678901234])
NUMBERS = np.arange(12.0).reshape(4, 3) / 7


@pytest.fixture
def path(tmp_path):
    topics = {
        "angles": Topic(("alpha", "beta", "gamma"), {"position": NUMBERS, "velocity": -NUMBERS}),
        "currents": Topic(("0", "11"), {"effort": NUMBERS[:, :2]}),
    }
    joint_states.write(path := tmp_path / "run.mcap", TIMES, topics, {"currents": "commanded"})
    return path


def test_numbers_come_back(path):
    time_ns, columns, metadata, notes = joint_states.read(path)
    assert (metadata, notes) == ({"currents": "commanded"}, ())
    assert list(columns) == [
        *(f"angles/{field}/{name}" for field in ("position", "velocity") for name in ANGLE_NAMES),
        "currents/effort/0", "currents/effort/11",
    ]  # fmt: skip
    assert np.max(np.abs(1e-9 * time_ns - TIMES)) <= 5e-10
    assert np.array_equal(columns["angles/velocity/beta"], -NUMBERS[:, 1])
    assert np.array_equal(columns["currents/effort/11"], NUMBERS[:, 1])


def test_messages_are_little_endian_cdr_with_their_schema(path):
    with path.open("rb") as file:
        messages = make_reader(file).iter_messages(topics=["/currents"], reverse=True)
        schema, channel, message = next(iter(messages))
    assert (schema.name, schema.encoding, channel.message_encoding) == (TYPE, "ros2msg", "cdr")
    assert schema.data.decode() == DEFINITION
    assert message.log_time == 12345678901234
    # Written by hand: header, stamp, empty frame_id, two names, two empty lists, two numbers aligned to 8.
    numbers = NUMBERS[3, :2].tolist()
    values = 0, 1, 0, 12345, 678901234, 1, 0, 2, 2, b"0\0", 3, b"11\0", 0, 0, 2, *numbers
    expected = struct.pack("<BBH iI IB3x I I2s2x I3sx I I I2d", *values)
    body, tail = expected[:-16], expected[-16:]
    body += bytes(-(len(body) - 4) % 8)
    assert message.data == body + tail


def test_big_endian_messages_are_read(tmp_path):
    body = struct.pack(">iI I1s3x I I2s2x Id I I", 1, 500, 1, b"\0", 1, 2, b"a\0", 1, 2.5, 0, 0)
    with (path := tmp_path / "big.mcap").open("wb") as file:
        writer = Writer(file)
        writer.start()
        schema = writer.register_schema(TYPE, "ros2msg", DEFINITION.encode())
        channel = writer.register_channel("/robot/joints", "cdr", schema)
        writer.add_message(channel, 1, b"\0\0\0\0" + body, 1)
        writer.finish()
    states = joint_states.read(path)
    assert states.time_ns.tolist() == [1_000_000_500]
    assert {name: values.tolist() for name, values in states.columns.items()} == {
        "robot/joints/position/a": [2.5]
    }
    assert states.metadata == {}
    for time in ("log_time", "publish_time"):
        assert joint_states.read(path, time).time_ns.tolist() == [1]


def test_a_file_that_cannot_be_read_is_refused(path):
    for damage in (lambda: path.write_bytes(b"t_s,a\n"), path.unlink):
        damage()
        with pytest.raises(InputError, match=r"MCAP .*run\.mcap: expected"):
            joint_states.read(path)


def test_each_flipped_bit_of_a_file_is_found(path):
    content, draws = path.read_bytes(), random.Random(43)
    for _ in range(300):
        damaged = bytearray(content)
        damaged[draws.randrange(len(content))] ^= 1 << draws.randrange(8)
        path.write_bytes(damaged)
        with pytest.raises(InputError, match=r"MCAP .*run\.mcap: expected a readable file"):
            joint_states.read(path)


@pytest.mark.parametrize("compression", list(CompressionType))
@pytest.mark.parametrize("chunk_size", [64, 1 << 20])
def test_a_file_that_a_killed_recorder_left_is_read_up_to_its_last_complete_message(
    path, compression, chunk_size, monkeypatch
):
    options = {"compression": compression, "chunk_size": chunk_size}
    monkeypatch.setattr("mcap.writer.Writer", lambda file, **_: Writer(file, **options))
    numbers = np.random.default_rng(0).normal(size=(600, 40))  # more than the smallest part of a compression
    times = 1e-3 * np.arange(600)
    joint_states.write(path, times, {"angles": Topic([str(j) for j in range(40)], {"position": numbers})}, {})
    content, most = path.read_bytes(), 0
    path.write_bytes(content[:100])
    with pytest.raises(InputError, match=r"expected messages .* received none"):
        joint_states.read(path)
    for share in (0.3, 0.6, 0.9, 1 - 4 / len(content)):
        path.write_bytes(content[: round(share * len(content))])
        states = joint_states.read(path)
        assert states.notes == ("the file has no end: read up to its last complete message",)
        rows = len(states.time_ns)
        assert rows >= most
        most = rows
        assert np.array_equal(states.columns["angles/position/7"], numbers[:rows, 7])
    assert most == 600
    path.write_bytes(content[: len(content) // 2] + bytes(4096))
    assert len(joint_states.read(path).time_ns) > 100  # the blocks of a file system that were not written


@pytest.mark.parametrize("compression", [CompressionType.ZSTD, CompressionType.LZ4])
@pytest.mark.parametrize("chunked", [True, False])
def test_a_damaged_file_of_another_program_is_no_other_error(path, compression, chunked, monkeypatch):
    options = {"compression": compression, "use_chunking": chunked}
    monkeypatch.setattr("mcap.writer.Writer", lambda file, **_: Writer(file, **options))
    joint_states.write(path, TIMES, {"angles": Topic(ANGLE_NAMES, {"position": NUMBERS})}, {})
    content, draws, changed = path.read_bytes(), random.Random(43), 0
    numbers = joint_states.read(path).columns
    for _ in range(200):
        damaged = bytearray(content)
        damaged[draws.randrange(len(content))] ^= 1 << draws.randrange(8)
        path.write_bytes(damaged)
        try:
            columns = joint_states.read(path).columns
        except InputError:
            continue
        changed += columns.keys() != numbers.keys()
        changed += not all(np.array_equal(columns.get(name), numbers[name]) for name in numbers)
    if chunked:  # without chunks its writer computes no checksum of the data
        assert not changed
