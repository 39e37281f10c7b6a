"""Messages of ROS 2 in CDR encoding, decoded by their definition (ros2msg), without ROS."""

from __future__ import annotations

import re
import struct
from collections.abc import Iterator, Mapping, Sequence
from typing import Any, NamedTuple

SECOND_ns = 10**9
MOST_ENTRIES = 1024
"""Length of arrays beyond which their numbers are left out, such as those of an image."""

_CODES = {
    "bool": "?", "byte": "B", "char": "b", "int8": "b", "uint8": "B", "int16": "h", "uint16": "H",
    "int32": "i", "uint32": "I", "int64": "q", "uint64": "Q", "float32": "f", "float64": "d",
}  # fmt: skip
_FIELD = re.compile(r"(?P<type>[\w/]+)(?:<=\d+)?(?P<array>\[(?:<=)?\d*\])?\s+(?P<name>\w+)(?P<rest>.*)")


class _MessageField(NamedTuple):
    """Field of a message."""

    type: str
    name: str
    length: int | None
    """None for one value, -1 for a sequence, else the length of an array."""


class Definition:
    """Definition of a message.

    Parameters
    ----------
    name : str
        Type, such as ``sensor_msgs/msg/JointState``.
    text : str
        Its definition, followed by those of the types in it.

    Raises
    ------
    ValueError
        A line is no field, or a type is not defined.
    """

    def __init__(self, name: str, text: str) -> None:
        self._root = _plain(name)
        self._types: dict[str, list[_MessageField]] = {}
        for number, part in enumerate(re.split(r"^=+$", text, flags=re.MULTILINE)):
            head, *body = part.strip().splitlines() or [""]
            is_root = number == 0
            lines = [head, *body] if is_root else body
            self._types[self._root if is_root else _plain(head.removeprefix("MSG:").strip())] = [
                field for line in lines if (field := _field(line))
            ]
        for fields in self._types.values():
            for field in fields:
                if field.type not in _CODES and field.type != "string":
                    self._fields(field.type)

    def _fields(self, name: str) -> list[_MessageField]:
        """Return the fields of a type, whose name may lack its package."""
        last = name.rpartition("/")[2]
        for known, fields in self._types.items():
            if known == _plain(name) or known.rpartition("/")[2] == last:
                return fields
        raise ValueError(f"expected a definition of {name}, received {', '.join(self._types)}")

    def decode(self, data: bytes) -> dict[str, Any]:
        """Return the fields of a message, nested as they are.

        Raises
        ------
        ValueError, struct.error
            It is damaged, or in another encoding.
        """
        if data[1] > 1:
            raise ValueError("expected CDR of version 1, received another encoding")
        return self._message(self._types[self._root], _Reader(data))

    def _message(self, fields: Sequence[_MessageField], reader: _Reader) -> dict[str, Any]:
        return {field.name: self._value(field, reader) for field in fields}

    def _value(self, field: _MessageField, reader: _Reader) -> Any:
        if field.length is None:
            return self._values(field.type, 1, reader)[0]
        count = reader.numbers("I", 1)[0] if field.length < 0 else field.length
        return self._values(field.type, count, reader)

    def _values(self, name: str, count: int, reader: _Reader) -> Sequence[Any]:
        if code := _CODES.get(name):
            return reader.numbers(code, count)
        if name == "string":
            return [reader.text() for _ in range(count)]
        fields = self._fields(name)
        return [self._message(fields, reader) for _ in range(count)]


class _Reader:
    """Reader of CDR, which aligns numbers to their size, counted from the end of its header."""

    def __init__(self, data: bytes) -> None:
        self._data, self._order, self._place = data, "<" if data[1] else ">", 4

    def numbers(self, code: str, count: int) -> tuple[Any, ...]:
        """Return the next numbers; none of a long array."""
        size = struct.calcsize(code)
        start = self._place + (-(self._place - 4) % size if count else 0)
        self._place = start + size * count
        if count > MOST_ENTRIES:
            return ()
        return struct.unpack_from(f"{self._order}{count}{code}", self._data, start)

    def text(self) -> str:
        """Return the next text."""
        (length,) = self.numbers("I", 1)
        start, self._place = self._place, self._place + length
        return self._data[start : self._place - 1].decode()


def _plain(name: str) -> str:
    return name.replace("/msg/", "/")


def _field(line: str) -> _MessageField | None:
    """Return the field of a line; None for a comment or a constant."""
    text = line.partition("#")[0].strip()
    match = _FIELD.fullmatch(text)
    if not text or (match and match["rest"].lstrip().startswith("=")):
        return None
    if not match:
        raise ValueError(f"expected a field of a message, received {text!r}")
    array = match["array"]
    count = None if array is None else int(array[1:-1]) if array[1:-1].isdigit() else -1
    return _MessageField(match["type"], match["name"], count)


def stamp_ns(message: Mapping[str, Any]) -> int | None:
    """Return the stamp of a message with a header, ns; None without one."""
    stamp = message.get("header", {}).get("stamp") if isinstance(message.get("header"), Mapping) else None
    return None if stamp is None else stamp["sec"] * SECOND_ns + stamp["nanosec"]


def numbers(value: Any, name: str) -> Iterator[tuple[str, float]]:
    """Yield name and value of each number in a message; the name has its fields and places of arrays."""
    if isinstance(value, bool | str):
        return
    if isinstance(value, int | float):
        yield name, float(value)
    elif isinstance(value, Mapping):
        for field, entry in value.items():
            if field != "header":
                yield from numbers(entry, f"{name}/{field}")
    elif isinstance(value, list | tuple) and len(value) <= MOST_ENTRIES:
        for place, entry in enumerate(value):
            yield from numbers(entry, f"{name}/{place}")
