"""MCAP files with topics of ROS 2 messages `sensor_msgs/msg/JointState` in CDR encoding, without ROS.

Rerun, Foxglove and PlotJuggler show their numbers by name; messages in JSON or protobuf stay opaque in Rerun.
"""

from __future__ import annotations

import io
import struct
import zlib
from collections.abc import Iterator, Mapping, Sequence
from importlib.util import find_spec
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from spheretwin.models.base.errors import InputError, without_breaks
from spheretwin.models.base.extras import missing
from spheretwin.models.base.files import regular_file, whole_file

Array = NDArray[np.float64]

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
_SECOND_ns = 10**9
_FOOTER_BYTES, _CRC_AND_MAGIC_BYTES = 37, 12
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
    stamps = np.rint(t_s * _SECOND_ns).astype(np.int64).tolist()
    with whole_file(path) as temporary, temporary.open("wb") as file:
        writer = Writer(file, enable_data_crcs=True)
        writer.start(profile="ros2", library="spheretwin")
        writer.add_metadata(METADATA, dict(metadata))
        schema = writer.register_schema(TYPE, "ros2msg", DEFINITION.encode())
        channels = [
            (writer.register_channel(f"/{name}", ENCODING, schema), Encoder(topic))
            for name, topic in topics.items()
        ]
        for row, stamp in enumerate(stamps):
            for channel, encoder in channels:
                writer.add_message(channel, stamp, encoder.message(row, stamp), stamp)
        # mcap annotates its other methods, but not this one.
        writer.finish()  # type: ignore[no-untyped-call]


def group_names(groups: int) -> list[str]:
    """Return the names of coil groups."""
    return [str(group) for group in range(groups)]


class Encoder:
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
        body = struct.pack("<iI", *divmod(stamp_ns, _SECOND_ns)) + self._head
        for values in self._fields:
            body = _aligned(body, 4) + struct.pack("<I", values.shape[1])
            if values.size:
                body = _aligned(body, 8) + values[row].tobytes()
        return _LITTLE_ENDIAN + body


def _aligned(body: bytes, size: int) -> bytes:
    return body + bytes(-len(body) % size)


STAMPS, LOG_TIME, PUBLISH_TIME = "t_s", "log_time", "publish_time"
"""Times of messages: of their header, of the recorder, and of the sender."""


class JointStates(NamedTuple):
    """Joint states of a file: a row for each message, or for consecutive ones of topics at one time."""

    time_ns: NDArray[np.int64]
    columns: dict[str, Array]
    """Numbers by ``topic/field/name``, NaN in rows without a message of it."""
    metadata: dict[str, str]
    """Metadata that `write` stored; empty for a file of another program."""
    notes: tuple[str, ...]
    """What was unusual."""


def read(path: Path, time: str = STAMPS) -> JointStates:
    """Read every number of the joint states of a file.

    A file without an end, which a killed recorder leaves, is read up to its last complete message.

    Parameters
    ----------
    path : Path
    time : str
        Time of the rows: ``t_s``, ``log_time`` or ``publish_time``. If all stamps are 0, it is the log time.

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
    topics: dict[int, str | None] = {}  # None for messages of another type
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
                    is_read = schema and schema.name == TYPE and record.message_encoding == ENCODING
                    topics[record.id] = record.topic.strip("/") if is_read else None
                case Message(channel_id=channel) if channel not in topics:
                    raise ValueError(f"it has a message of channel {channel}, but not the channel")
                case Message(channel_id=channel) if (topic := topics[channel]) is not None:
                    stamp_ns, numbers = _decode(topic, record.data)
                    messages.append(((stamp_ns, record.log_time, record.publish_time), numbers))
    # The packages of MCAP, zstd and LZ4 raise errors of their own, and lack of memory, for a damaged file.
    except Exception as error:
        raise InputError(f"MCAP {path}: expected a readable file, {without_breaks(error)}") from None
    if not messages:
        raise InputError(f"MCAP {path}: expected messages {TYPE} in CDR, received none")
    if time == STAMPS and not any(times[0] for times, _ in messages) and messages[-1][0][1]:
        time, notes = LOG_TIME, (*notes, "no stamps, so log times")
    rows: list[dict[str, float]] = []
    time_ns: list[int] = []
    place = (STAMPS, LOG_TIME, PUBLISH_TIME).index(time)
    for times, numbers in messages:
        if not rows or time_ns[-1] != times[place] or not numbers.keys().isdisjoint(rows[-1]):
            rows.append({})
            time_ns.append(times[place])
        rows[-1] |= numbers
    names = dict.fromkeys(name for row in rows for name in row)
    columns = {name: np.array([row.get(name, np.nan) for row in rows]) for name in names}
    return JointStates(np.array(time_ns, np.int64), columns, metadata, notes)


_MAGIC = b"\x89MCAP0\r\n"
_RECORD_HEAD = struct.Struct("<BQ")
_CHUNK, _FOOTER = 6, 2


def _content(path: Path) -> tuple[bytes, tuple[str, ...]]:
    """Return the bytes of a file, of one without an end the complete records; and notes."""
    content = regular_file(path).read_bytes()
    if content.endswith(_MAGIC) or not content.startswith(_MAGIC):
        return content, ()
    content = content.rstrip(b"\0")  # blocks that the file system had not written
    place, opcode = len(_MAGIC), 0
    while place + _RECORD_HEAD.size <= len(content):
        following, length = _RECORD_HEAD.unpack_from(content, place)
        end = place + _RECORD_HEAD.size + length
        if not following or end > len(content):
            break
        place, opcode = end, following
    complete, rest = content[:place], content[place:]
    if opcode == _FOOTER:
        if not _MAGIC.startswith(rest):
            raise ValueError("its last bytes differ")
        complete += _MAGIC
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
        if content.endswith(_MAGIC) or record is None:
            raise
    if isinstance(record, Footer) and record.summary_crc:
        start = record.summary_start or len(content) - _FOOTER_BYTES
        if zlib.crc32(content[start:-_CRC_AND_MAGIC_BYTES]) != record.summary_crc:
            raise ValueError("the checksum of its summary differs")


def _decode(topic: str, data: bytes) -> tuple[int, dict[str, float]]:
    """Return the stamp, ns, and the numbers of a message by ``topic/field/name``."""
    if data[1] > 1:
        raise ValueError(f"topic {topic}: expected CDR of version 1, received another encoding")
    order, place = "<" if data[1] else ">", 4

    def number(code: str, count: int = 1) -> tuple[Any, ...]:
        nonlocal place
        size = struct.calcsize(code)
        place += -(place - 4) % size if count else 0
        values = struct.unpack_from(f"{order}{count}{code}", data, place)
        place += size * count
        return values

    def text() -> str:
        nonlocal place
        (length,) = number("I")
        place += length
        return data[place - length : place - 1].decode()

    stamp_ns = number("i")[0] * _SECOND_ns + number("I")[0]
    text()  # frame_id
    names = [text() for _ in range(number("I")[0])]
    numbers: dict[str, float] = {}
    for field in FIELDS:
        values = number("d", number("I")[0])
        numbers |= {f"{topic}/{field}/{name}": value for name, value in zip(names, values, strict=False)}
    return stamp_ns, numbers


def _package() -> None:
    if not find_spec("mcap"):
        raise missing("MCAP", "mcap", "machine")
