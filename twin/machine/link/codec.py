"""Codec of frames: values to bytes, and bytes of any origin to values."""

from __future__ import annotations

import hmac
import json
import math
import struct
from binascii import crc_hqx
from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from spheretwin.machine.link.frame_format import QUANTITIES, FieldFormat, FrameFormat
from spheretwin.models.base.errors import InputError

Values = dict[str, Any]
"""Values of a frame in SI units by field: an int for integers, a float for one number, else an array."""

CRC_START, CRC_BYTES = 0xFFFF, 2
HMAC_BYTES = 16
"""Of HMAC-SHA256, the first ones: RFC 2104 allows half of the digest."""
LARGEST_FRAME = 65536
"""Bytes; a longer line is no frame."""


def crc16(content: bytes) -> int:
    """Return CRC-16/CCITT-FALSE: 0x29B1 for the text 123456789."""
    return crc_hqx(content, CRC_START)


class _Field:
    """Field for a number of coil groups: its count and its conversion."""

    def __init__(self, field: FieldFormat, groups: int) -> None:
        self.name, self.count, self.type = field.name, field.numbers(groups), np.dtype(field.type)
        self.scale, self.offset = field.si_scale, field.si_offset
        self.is_exact = (self.scale, self.offset) == (1.0, 0.0)
        self.is_integer, self.is_float = QUANTITIES[self.name].is_integer, self.type.kind == "f"
        limits: Any = np.finfo(self.type) if self.is_float else np.iinfo(self.type)
        self.lowest, self.highest = limits.min, limits.max
        # Numbers that no sensor reports stand for one that is missing.
        self.missing = math.nan if self.is_float else self.lowest or self.highest

    def numbers(self, values: Mapping[str, Any]) -> NDArray[Any]:
        """Return the numbers of the frame for its values; a value that is not given is missing."""
        value = values.get(self.name)
        if self.is_integer:
            return np.array([int(value or 0) & (self.highest - self.lowest)], self.type)
        if value is None:
            return np.full(self.count, self.missing)
        raw = np.ravel(value).astype(np.float64)
        if not self.is_exact:
            with np.errstate(over="ignore"):  # to infinity
                raw = (raw - self.offset) / self.scale
        if self.type.itemsize == 8:
            return raw
        if self.is_float:  # a shorter type has no larger number but infinity
            is_beyond = np.abs(raw) > self.highest
            return np.where(is_beyond, np.copysign(np.inf, raw), raw)
        whole = np.clip(np.rint(raw), self.lowest, self.highest)
        return np.where(np.isfinite(raw), whole, self.missing).astype(self.type)

    def value(self, raw: Any) -> Any:
        """Return the value in SI units of the numbers of the frame."""
        if self.is_integer:
            return int(raw[0])
        value = np.array(raw, np.float64)
        if not (self.is_float or self.name == "unused"):
            value[value == self.missing] = np.nan
        if not self.is_exact:
            value = self.scale * value + self.offset
        return value if self.count > 1 else float(value[0])


class Codec:
    """Encoder and decoder of one frame format.

    Parameters
    ----------
    frame : FrameFormat
    groups : int
        Coil groups of the machine.
    key : bytes
        With one, an HMAC authenticates each frame, in place of its checksum.

    Attributes
    ----------
    size : int
        Bytes of a binary frame.
    """

    def __init__(self, frame: FrameFormat, groups: int, key: bytes = b"") -> None:
        if key and not frame.has("session"):
            raise InputError("link: expected frames with the field session to authenticate, received others")
        self.frame, self._key = frame, key
        self._fields = [_Field(field, groups) for field in frame.field]
        columns = [(field.type.newbyteorder(frame.byte_order), field.count) for field in self._fields]
        self._type = np.dtype([(str(place), *column) for place, column in enumerate(columns)])
        self._crc = struct.Struct("<H" if frame.byte_order == "little" else ">H")
        self._json_check = b',"hmac":' if key else b',"crc16":'
        self.start, self._end = bytes(frame.start), bytes(frame.end)
        self._check_size = HMAC_BYTES if key else CRC_BYTES if frame.checksum == "crc16" else 0
        self.size = len(self.start) + self._type.itemsize + self._check_size + len(self._end)

    def encode(self, values: Mapping[str, Any]) -> bytes:
        """Return the frame of values in SI units; a field not given is missing.

        Numbers too large for their type saturate: integers at its ends, floats at infinity.
        """
        numbers = [field.numbers(values) for field in self._fields]
        if self.frame.encoding == "json":
            return self._encode_line(numbers)
        record = np.empty((), self._type)
        for place, raw in enumerate(numbers):
            record[str(place)] = raw
        content = self.start + record.tobytes()
        return content + self._check(content) + self._end

    def decode(self, content: bytes) -> Values | None:
        """Return the values of exactly one frame; None for any other bytes."""
        if self.frame.encoding == "json":
            return self._decode_line(content)
        if len(content) != self.size or not content.startswith(self.start) or not content.endswith(self._end):
            return None
        last = self.size - len(self._end) - self._check_size
        if not hmac.compare_digest(content[last : last + self._check_size], self._check(content[:last])):
            return None
        (record,) = np.frombuffer(content, self._type, 1, len(self.start))
        return {field.name: field.value(raw) for field, raw in zip(self._fields, record, strict=True)}

    def _check(self, content: bytes) -> bytes:
        """Return HMAC or checksum of the bytes of a frame before it; no bytes if it has none."""
        if self._key:
            return hmac.digest(self._key, content, "sha256")[:HMAC_BYTES]
        return self._crc.pack(crc16(content)) if self._check_size else b""

    def _check_text(self, text: bytes) -> bytes:
        """Return HMAC or checksum of the text of a line before it."""
        return b'"%s"' % self._check(text).hex().encode() if self._key else str(crc16(text)).encode()

    def _encode_line(self, numbers: list[NDArray[Any]]) -> bytes:
        entries = {}
        for field, raw in zip(self._fields, numbers, strict=True):
            plain = [number if math.isfinite(number) else None for number in raw.tolist()]  # JSON has no NaN
            entries[field.name] = plain if field.count > 1 else plain[0]
        text = json.dumps(entries, separators=(",", ":")).encode()
        if self._check_size:
            text = text[:-1]
            text += self._json_check + self._check_text(text) + b"}"
        return text + b"\n"

    def _decode_line(self, line: bytes) -> Values | None:
        line = line.strip()
        if self._check_size:
            content, mark, check = line.rpartition(self._json_check)
            if not mark or not hmac.compare_digest(check.rstrip(b"}").strip(), self._check_text(content)):
                return None
        try:
            entries = json.loads(line)
            if not isinstance(entries, dict):
                return None
            return {
                field.name: field.value(_plain_numbers(entries[field.name], field)) for field in self._fields
            }
        except (KeyError, TypeError, ValueError, OverflowError, RecursionError):
            return None


def _plain_numbers(entry: Any, field: _Field) -> list[Any]:
    """Return the numbers of an entry of a JSON object.

    Raises
    ------
    TypeError, ValueError
        It has another count or type.
    """
    raw = entry if isinstance(entry, list) else [entry]
    if len(raw) != field.count:
        raise ValueError(field.name)
    for number in raw:
        if isinstance(number, bool) or not isinstance(number, int | float | None):
            raise TypeError(field.name)
        if field.is_integer and not (isinstance(number, int) and field.lowest <= number <= field.highest):
            raise ValueError(field.name)
    return [math.nan if number is None else number for number in raw]
