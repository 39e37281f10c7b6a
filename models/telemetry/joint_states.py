"""MCAP files with topics of ROS 2 messages `sensor_msgs/msg/JointState` in CDR encoding, without ROS.

Rerun, Foxglove and PlotJuggler show their numbers by name; messages in JSON or protobuf stay opaque in Rerun.
"""

from __future__ import annotations

import io
import json
import struct
import zlib
from collections.abc import Callable, Iterator, Mapping, Sequence
from importlib.util import find_spec
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from spheretwin.models.base.arrays import Array
from spheretwin.models.base.errors import InputError, without_breaks
from spheretwin.models.base.extras import missing
from spheretwin.models.base.files import regular_file, whole_file
from spheretwin.models.telemetry import ros_messages
from spheretwin.models.telemetry.table import Table

FIELDS = ("position", "velocity", "effort")
TYPE, ENCODING = "sensor_msgs/msg/JointState", "cdr"
DEFINITION = """std_msgs/Header header
string[] name
float64[] position
float64[] velocity
float64[] effort

================================================================================
MSG: std_msgs/Header
builtin_interfaces/Time stamp
string frame_id
================================================================================
MSG: builtin_interfaces/Time
int32 sec
uint32 nanosec
"""
METADATA = "spheretwin"
ANGLE_NAMES = ("alpha", "beta", "gamma")
_FOOTER_BYTES, _CRC_ANDMAGIC_BYTES = 37, 12
_LITTLE_ENDIAN = b"\x00\x01\x00\x00"


class Topic(NamedTuple):
    """Joint states over time; a field without columns is empty in each message."""

    names: Sequence[str]
    """Of the joints, or of whatever has the numbers."""
    fields: Mapping[str, Array]
    """Numbers of ``position``, ``velocity`` or ``effort``, each (n, names)."""


def write(path: Path, t_s: Array, topics: Mapping[str, Topic], metadata: Mapping[str, str]) -> None:
    """Write a message of each topic for each time, completely or not at all.

    Times have a resolution of 1 ns, and are finite and not negative.

    Raises
    ------
    InputError
        The package mcap is not installed, a time cannot be represented, or no file can be made there.
    """
    _package()
    from mcap.writer import Writer

    if not np.all((t_s >= 0) & (t_s < 2**31)):
        raise InputError(f"MCAP {path}: expected times from 0 to 2**31 s, received others")
    with whole_file(path) as temporary, temporary.open("wb") as file:
        writer = Writer(file, enable_data_crcs=True)
        writer.start(profile="ros2", library="spheretwin")
        writer.add_metadata(METADATA, dict(metadata))
        schema = writer.register_schema(TYPE, "ros2msg", DEFINITION.encode())
        channels = [
            (writer.register_channel(f"/{name}", ENCODING, schema), MessageEncoder(topic))
            for name, topic in topics.items()
        ]
        for row, stamp in enumerate(stamps_ns(t_s)):
            for channel, encoder in channels:
                writer.add_message(channel, stamp, encoder.message(row, stamp), stamp)
        # mcap annotates its other methods, but not this one.
        writer.finish()  # type: ignore[no-untyped-call]


ANGLES = (("q_estimated_rad", "qdot_estimated_rad_s"), ("q_measured_rad", "qdot_estimated_rad_s"))
"""Columns of angles and rates as a shadow or a controller knows them, before those of the plant."""


def topics_of(table: Table) -> dict[str, Topic]:
    """Return the topics of a run or of a shadow: angles and rates, currents, and all other columns."""
    known = {signal.name for signal in table.signals}
    q, qdot = next((pair for pair in ANGLES if known.issuperset(pair)), ("q_rad", "qdot_rad_s"))
    current = "current_command_A" if "current_command_A" in known else "current_A"
    others = [signal for signal in table.signals if signal.name not in ("t_s", q, qdot, current)]
    scalars = [scalar.name for signal in others for scalar in signal.scalars()]
    return {
        "angles": Topic(ANGLE_NAMES, {"position": table[q], "velocity": table[qdot]}),
        "currents": Topic(group_names(table[current].shape[1]), {"effort": table[current]}),
        "telemetry": Topic(scalars, {"effort": np.column_stack([table[signal.name] for signal in others])}),
    }


def group_names(groups: int) -> list[str]:
    """Return the names of coil groups."""
    return [str(group) for group in range(groups)]


class MessageEncoder:
    """Messages of a topic: a stamp, the same names each time, and a row of each field.

    Parameters
    ----------
    topic : Topic
    """

    def __init__(self, topic: Topic) -> None:
        names = struct.pack("<I", len(topic.names))
        for name in topic.names:
            text = name.encode() + b"\0"
            names = _aligned(names, 4) + struct.pack("<I", len(text)) + text
        # CDR aligns numbers to their size, counted from the end of the four bytes of its header.
        self._head = _aligned(struct.pack("<IB", 1, 0), 4) + names  # empty frame_id
        self._fields = [np.ascontiguousarray(topic.fields.get(field, np.empty((0, 0)))) for field in FIELDS]

    def message(self, row: int, stamp_ns: int) -> bytes:
        """Return the message of a row at a time, ns."""
        body = struct.pack("<iI", *divmod(stamp_ns, ros_messages.SECOND_ns)) + self._head
        for values in self._fields:
            body = _aligned(body, 4) + struct.pack("<I", values.shape[1])
            if values.size:
                body = _aligned(body, 8) + values[row].tobytes()
        return _LITTLE_ENDIAN + body


def stamps_ns(t_s: Array) -> list[int]:
    """Return times as whole nanoseconds."""
    stamps: list[int] = np.rint(t_s * ros_messages.SECOND_ns).astype(np.int64).tolist()
    return stamps


def _aligned(body: bytes, size: int) -> bytes:
    return body + bytes(-len(body) % size)


STAMPS, LOG_TIME, PUBLISH_TIME = "t_s", "log_time", "publish_time"
"""Times of messages: of their header, of the recorder, and of the sender."""


class JointStates(NamedTuple):
    """Joint states of a file: a row for each message, or for consecutive ones of topics at one time."""

    time_ns: NDArray[np.int64]
    columns: dict[str, Array]
    """Numbers by ``topic/field/name``, of other messages by ``topic/field``; NaN in rows without one."""
    metadata: dict[str, str]
    """Metadata that `write` stored; empty for a file of another program."""
    notes: tuple[str, ...]
    """What was unusual."""


class _Channel(NamedTuple):
    """Channel of a file that is read."""

    name: str
    decode: Callable[[bytes], dict[str, Any]]
    is_state: bool


def read(path: Path, time: str = STAMPS, names: Sequence[str] = ()) -> JointStates:
    """Read every number of the joint states of a file, and of other messages in CDR (ros2msg) or JSON.

    Messages without a header have the log time as their stamp.

    A file without an end, which a killed recorder leaves, is read up to its last complete message.

    Parameters
    ----------
    path : Path
    time : str
        Time of the rows: ``t_s``, ``log_time`` or ``publish_time``. If all stamps are 0, it is the log time.
    names : sequence of str
        Columns that are needed: other topics are not decoded. All are if it is empty, or has no topic.

    Raises
    ------
    InputError
        The package mcap is not installed, the file cannot be read, or has no joint states.
    """
    _package()
    from mcap.records import Channel, DataEnd, Message, Metadata, Schema

    messages: list[tuple[tuple[int, ...], dict[str, float]]] = []
    metadata: dict[str, str] = {}
    schemas: dict[int, Schema] = {}
    topics: dict[int, _Channel | None] = {}  # None for messages that are not read
    in_summary = False  # which repeats schemas and channels
    try:
        content, notes = _content(path)
        for record in _records(content):
            match record:
                case DataEnd():
                    in_summary = True
                case Metadata(name=name) if name == METADATA:
                    metadata |= record.metadata
                case Schema() if not in_summary:
                    schemas[record.id] = record
                case Channel() if not in_summary:
                    schema = schemas.get(record.schema_id)
                    decode = _decoder(schema, record.message_encoding)
                    is_state = schema is not None and schema.name == TYPE
                    topic = record.topic.strip("/")
                    is_needed = not names or any(name.startswith(f"{topic}/") for name in names)
                    topics[record.id] = _Channel(topic, decode, is_state) if decode and is_needed else None
                case Message(channel_id=channel) if channel not in topics:
                    raise ValueError(f"it has a message of channel {channel}, but not the channel")
                case Message(channel_id=channel) if (of_topic := topics[channel]) is not None:
                    message = of_topic.decode(record.data)
                    stamp_ns = ros_messages.stamp_ns(message)
                    stamps = record.log_time if stamp_ns is None else stamp_ns
                    numbers = _numbers(of_topic.name, message, is_state=of_topic.is_state)
                    messages.append(((stamps, record.log_time, record.publish_time), numbers))
    # The packages of MCAP, zstd and LZ4 raise errors of their own, and lack of memory, for a damaged file.
    except Exception as error:
        raise InputError(f"MCAP {path}: expected a readable file, {without_breaks(error)}") from None
    if not messages and names:
        return read(path, time)
    if not messages:
        raise InputError(
            f"MCAP {path}: expected messages in CDR with their definition, or in JSON, received none"
        )
    if time == STAMPS and not any(times[0] for times, _ in messages) and messages[-1][0][1]:
        time, notes = LOG_TIME, (*notes, "no stamps, so log times")
    time_ns, columns = _rows(messages, (STAMPS, LOG_TIME, PUBLISH_TIME).index(time))
    return JointStates(time_ns, columns, metadata, notes)


def _rows(
    messages: Sequence[tuple[tuple[int, ...], dict[str, float]]], place: int
) -> tuple[NDArray[np.int64], dict[str, Array]]:
    """Return times, ns, and columns; consecutive messages with one of these times share a row."""
    rows: list[dict[str, float]] = []
    time_ns: list[int] = []
    for times, numbers in messages:
        if not rows or time_ns[-1] != times[place] or not numbers.keys().isdisjoint(rows[-1]):
            rows.append({})
            time_ns.append(times[place])
        rows[-1] |= numbers
    names = dict.fromkeys(name for row in rows for name in row)
    columns = {name: np.array([row.get(name, np.nan) for row in rows]) for name in names}
    return np.array(time_ns, np.int64), columns


MAGIC = b"\x89MCAP0\r\n"
_RECORD_HEAD = struct.Struct("<BQ")
_CHUNK, _FOOTER = 6, 2


def _content(path: Path) -> tuple[bytes, tuple[str, ...]]:
    """Return the bytes of a file, of one without an end the complete records; and notes."""
    content = regular_file(path).read_bytes()
    if content.endswith(MAGIC) or not content.startswith(MAGIC):
        return content, ()
    content = content.rstrip(b"\0")  # blocks that the file system had not written
    place, opcode = len(MAGIC), 0
    while place + _RECORD_HEAD.size <= len(content):
        following, length = _RECORD_HEAD.unpack_from(content, place)
        end = place + _RECORD_HEAD.size + length
        if not following or end > len(content):
            break
        place, opcode = end, following
    complete, rest = content[:place], content[place:]
    if opcode == _FOOTER:
        if not MAGIC.startswith(rest):
            raise ValueError("its last bytes differ")
        complete += MAGIC
    elif rest[:1] == bytes([_CHUNK]):
        complete += _complete_messages(rest[_RECORD_HEAD.size :])
    return complete, ("the file has no end: read up to its last complete message",)


def _complete_messages(chunk: bytes) -> bytes:
    """Return the complete records of a chunk that was cut."""
    import lz4.frame
    import zstandard

    size_of_times = 28  # two times, size, checksum
    if len(chunk) < size_of_times + 4:
        return b""
    (length,) = struct.unpack_from("<I", chunk, size_of_times)
    start = size_of_times + 4 + length
    compression, data = chunk[size_of_times + 4 : start], chunk[start + 8 :]
    if compression == b"zstd":
        data = zstandard.ZstdDecompressor().decompressobj().decompress(data)
    elif compression == b"lz4":
        data = lz4.frame.LZ4FrameDecompressor().decompress(data)
    place = 0
    while place + _RECORD_HEAD.size <= len(data):
        end = place + _RECORD_HEAD.size + _RECORD_HEAD.unpack_from(data, place)[1]
        if end > len(data):
            break
        place = end
    return data[:place]


def _records(content: bytes) -> Iterator[Any]:
    """Yield the records of a file in their order; compare the checksums of chunks, data and summary.

    The reader of the package that seeks by the summary compares those of the chunks alone.
    """
    from mcap.exceptions import EndOfFile
    from mcap.records import Footer
    from mcap.stream_reader import StreamReader

    record, stream = None, io.BytesIO(content)
    try:
        for record in StreamReader(stream, validate_crcs=True, record_size_limit=len(content)).records:
            yield record
    except EndOfFile:
        if content.endswith(MAGIC) or record is None:
            raise
    if isinstance(record, Footer) and record.summary_crc:
        start = record.summary_start or len(content) - _FOOTER_BYTES
        if zlib.crc32(content[start:-_CRC_ANDMAGIC_BYTES]) != record.summary_crc:
            raise ValueError("the checksum of its summary differs")


def _decoder(schema: Any, encoding: str) -> Callable[[bytes], dict[str, Any]] | None:
    """Return the decoder of messages in CDR or JSON; None for others."""
    if encoding == "json":
        return _of_json
    if schema is None or encoding != ENCODING:
        return None
    try:
        return ros_messages.Definition(schema.name, schema.data.decode() or DEFINITION).decode
    except ValueError:
        return None


def _of_json(data: bytes) -> dict[str, Any]:
    content = json.loads(data)
    return content if isinstance(content, dict) else {}


def _numbers(topic: str, message: dict[str, Any], *, is_state: bool) -> dict[str, float]:
    """Return the numbers of a message: by ``topic/field/name`` of joint states, else by ``topic/field``."""
    if not is_state:
        return dict(ros_messages.numbers(message, topic))
    return {
        f"{topic}/{field}/{name}": value
        for field in FIELDS
        for name, value in zip(message["name"], message[field], strict=False)
    }


def _package() -> None:
    if not find_spec("mcap"):
        raise missing("MCAP", "mcap", "machine")
