"""Internals of Rerun 0.41 that have no public API; `tests/viz/test_rerun_internals.py` reports a change.

File format (RRF2)
    Read to find the complete messages of a killed process, and to cut a live stream into messages. If it
    changes, partial recordings cannot be recovered and a live view shows nothing.
`rerun.blueprint.Blueprint._log_to_stream`
    Overridden: layouts have no clock times, and their constant part is encoded once. If it changes, layouts
    are sent complete and larger, or not at all.
Program and files of the viewer
    The program verifies damaged files in a separate process and contains the viewer's page. If its options,
    its paths or the page change, damaged files may end the process, and a live view has no page, or one that
    sends requests to other hosts.
"""

from __future__ import annotations

import os
import re
import shutil
import socket
import struct
import subprocess
import sys
import tempfile
import time
import urllib.error
import urllib.request
from collections import defaultdict
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from copy import copy
from mmap import ACCESS_READ, mmap
from pathlib import Path
from typing import Any, BinaryIO, NamedTuple

import pyarrow as pa
import rerun as rr
import rerun.blueprint as rrb
import rerun_cli
from rerun.chunk import Chunk

from spheretwin.models.base.errors import InputError, SpheretwinError, without_breaks
from spheretwin.models.base.files import regular_file

# Rerun's file format 2: magic, version and options, then messages, each with its kind and its length before
# it. The last message of a file is the footer, with the places of all others.
HEADER_BYTES = 12
_FILE_MAGIC = b"RRF2"
_MESSAGE_HEADER = struct.Struct("<QQ")
_FOOTER, _CHUNK = 0, 2
_KINDS = range(4)


def messages(encoded: bytes) -> bytes:
    """Return the messages of an encoded recording, without header and footer.

    Parameters
    ----------
    encoded : bytes
        A complete recording, or a later part of one.
    """
    first = place = HEADER_BYTES if encoded.startswith(_FILE_MAGIC) else 0
    while place + _MESSAGE_HEADER.size <= len(encoded):
        kind, length = _MESSAGE_HEADER.unpack_from(encoded, place)
        if kind == _FOOTER:
            break
        place += _MESSAGE_HEADER.size + length
    return encoded[first:place]


# Bytes of a chunk's message that are enough for the identity of its recording.
_SIGNATURE_BYTES = 256

# The end of a file holds the position of the footer and this magic, with a version.
_AFTER_FOOTER_BYTES = 32
_FOOTER_MAGIC, _FOOTER_MAGIC_BYTES = b"RRF2FOOT", 12


class Extent(NamedTuple):
    """Extent of the complete messages of a file."""

    whole_bytes: int
    """Bytes to the end of the last complete message."""
    ended: bool
    """True if the footer is among them."""
    torn: bool
    """True if an incomplete message follows."""


def extent(path: Path) -> Extent:
    """Return the extent of the complete messages of a recording; only their lengths are read.

    Raises
    ------
    InputError
        It cannot be read, does not begin as a recording, or a message is damaged: its kind or
        length is not a valid one.
    """
    try:
        with regular_file(path).open("rb") as file:
            size = path.stat().st_size
            if file.read(HEADER_BYTES)[: len(_FILE_MAGIC)] != _FILE_MAGIC or size < HEADER_BYTES:
                raise InputError(f"recording {path}: expected a Rerun recording, received another file")
            place, ended, signature = HEADER_BYTES, False, b""
            while not ended and len(before := file.read(_MESSAGE_HEADER.size)) == _MESSAGE_HEADER.size:
                kind, length = _MESSAGE_HEADER.unpack(before)
                if kind not in _KINDS:
                    raise _damaged(path, place)
                if (next_place := place + len(before) + length) > size:
                    break
                if kind == _CHUNK and not signature:
                    signature = _signature(file.read(min(length, _SIGNATURE_BYTES)))
                place, ended = next_place, kind == _FOOTER
                file.seek(place)
            if _has_more_messages(file, place, size, ended=ended, signature=signature):
                raise _damaged(path, place)
    except OSError as error:
        raise InputError(f"recording {path}: expected a readable file, {error.strerror or error}") from None
    return Extent(place, ended, not ended and place < size)


def _signature(payload: bytes) -> bytes:
    """Return the first bytes of every chunk of one recording: its identity, with the length before it."""
    return payload[: 2 + payload[1]] if len(payload) > 1 else b""


def _has_more_messages(file: BinaryIO, place: int, size: int, *, ended: bool, signature: bytes) -> bool:
    """True if more messages follow a place at which the messages seem to end.

    A killed process leaves a part of one message at most; after the footer there is only its position.
    """
    if ended:
        return size - place > _AFTER_FOOTER_BYTES
    if size - place <= _MESSAGE_HEADER.size or not signature:
        return False
    file.seek(-_FOOTER_MAGIC_BYTES, os.SEEK_END)
    if file.read().startswith(_FOOTER_MAGIC):
        return True
    # A chunk is known by its kind, a length below 2^40 and the identity.
    chunk = _CHUNK.to_bytes(8, "little") + b".{5}\\0{3}" + re.escape(signature)
    with mmap(file.fileno(), 0, access=ACCESS_READ) as content:
        return re.compile(chunk, re.DOTALL).search(content, place + 1) is not None


def _damaged(path: Path, place: int) -> InputError:
    return InputError(
        f"recording {path}: expected an intact message, received other content at byte {place}:"
        " the file is damaged, or was changed by another program"
    )


@contextmanager
def whole_messages(path: Path) -> Iterator[tuple[Path, Extent]]:
    """Yield the path of a file with only the complete messages of a recording: a copy if it is incomplete.

    Raises
    ------
    InputError
        As `extent`, or a copy cannot be made.
    """
    result = extent(path)
    if not result.torn:
        yield path, result
        return
    with tempfile.TemporaryDirectory(prefix="spheretwin-") as folder:
        copy = Path(folder) / "whole.rrd"
        try:
            shutil.copyfile(path, copy)
            with copy.open("r+b") as file:
                file.truncate(result.whole_bytes)
        except OSError as error:
            raise InputError(f"recording {path}: expected room for a copy, {without_breaks(error)}") from None
        yield copy, result


class LogEncoder:
    """Stream that encodes what is logged as chunks, which any number of recordings can send.

    Parameters
    ----------
    index : rr.TimeColumn, optional
        Time of what is not static.
    """

    def __init__(self, index: rr.TimeColumn | None = None) -> None:
        self._index = index
        self._entities: dict[tuple[str, bool], dict[rr.ComponentDescriptor, pa.Array]] = defaultdict(dict)

    def log(self, entity: str, *values: Any, static: bool = False) -> None:
        """Log values; a component that the entity has already is replaced."""
        for value in values:
            for batch in value if isinstance(value, list) else value.as_component_batches():
                self._entities[entity, static][batch.component_descriptor()] = batch.as_arrow_array()

    def drop(self, component: str, value: Any) -> None:
        """Drop a component wherever it has one value."""
        for components in self._entities.values():
            for descriptor, array in list(components.items()):
                if descriptor.component == component and array.to_pylist() == [value]:
                    del components[descriptor]

    def chunks(self) -> dict[tuple[str, bool], Chunk]:
        """Return a chunk for each entity, by its path and whether it is static."""
        return {entity: self._chunk(*entity, components) for entity, components in self._entities.items()}

    def changed(self, values: Mapping[str, Any]) -> dict[tuple[str, bool], Chunk]:
        """Return chunks of entities with new values; their other components remain."""
        encoder = LogEncoder(self._index)
        for entity, value in values.items():
            encoder._entities[entity, False] |= self._entities.get((entity, False), {})
            encoder.log(entity, value)
        return encoder.chunks()

    def _chunk(
        self, entity: str, static: bool, components: Mapping[rr.ComponentDescriptor, pa.Array]
    ) -> Chunk:
        columns = [
            rr.ComponentColumn(descriptor, ArrowComponent(array), lengths=[len(array)])
            for descriptor, array in components.items()
        ]
        return Chunk.from_columns(entity, [] if static or not self._index else [self._index], columns)


class ArrowComponent(NamedTuple):
    """Component whose values are an Arrow array.

    Rerun's own form for unknown types requires one type for each name in a whole process,
    and runs differ in their signals.
    """

    array: pa.Array

    def as_arrow_array(self) -> pa.Array:
        """Return the array; Rerun calls this."""
        return self.array


class EncodedLayout(rrb.Blueprint):
    """Layout that is encoded once, for many recordings.

    Its rows have no clock times, which would be a quarter of its bytes, and no origins of views that are
    the viewer's default: a file has some 700 bytes for each component of each entity.
    """

    def __init__(self, *parts: rrb.BlueprintPart) -> None:
        super().__init__(*parts, auto_views=False, auto_layout=False)
        self._encoder = LogEncoder(rr.TimeColumn("blueprint", sequence=[0]))
        # The method asks for a `RecordingStream`; it uses only the methods that `LogEncoder` has.
        super()._log_to_stream(self._encoder)  # type: ignore[arg-type]
        self._encoder.drop("ViewBlueprint:space_origin", "/")
        self._chunks = self._encoder.chunks()

    def changed(self, values: Mapping[str, Any]) -> EncodedLayout:
        """Return the layout with new values at some paths."""
        layout = copy(self)
        layout._chunks = self._chunks | self._encoder.changed(values)
        return layout

    def _log_to_stream(self, stream: rr.RecordingStream) -> None:
        stream.send_chunks(self._chunks.values())


PROGRAM = Path(rerun_cli.__file__).with_name("rerun.exe" if sys.platform == "win32" else "rerun")

# Lower codes are errors that the reader finds too and reports in one line.
_PANICS = 100


def check_readable(path: Path, named: Path) -> None:
    """Let a separate process read a recording first; 10 MB take 30 ms.

    Parameters
    ----------
    path : Path
        File to read.
    named : Path
        File that a message names.

    Raises
    ------
    InputError
        The process did not survive it.
    SpheretwinError
        Rerun's program cannot be started.
    """
    command = [str(PROGRAM), "rrd", "verify", "--check-footers=false", str(path)]
    try:
        ended = subprocess.run(
            command,
            stdin=subprocess.DEVNULL,
            stdout=subprocess.DEVNULL,
            stderr=subprocess.DEVNULL,
            check=False,
        ).returncode
    except OSError as error:
        raise SpheretwinError(
            f"recording {named}: expected Rerun at {PROGRAM}, {without_breaks(error)}"
        ) from None
    if ended < 0 or ended >= _PANICS:
        raise InputError(
            f"recording {named}: expected one of a run, received one so damaged that Rerun crashes"
        )


HOST = "127.0.0.1"
INDEX = "/index.html"
FILES = (INDEX, "/re_viewer.js", "/re_viewer_bg.wasm", "/favicon.ico", "/apple-touch-icon.png")

# The program is large, and has to be read from the disk first if the machine's cache is empty.
_PATIENCE_S = 60.0

# Without this, the viewer asks Rerun's server for the latest release, and reports what is opened.
_GUARD = """<script>
      const ask = window.fetch;
      window.fetch = (what, options) =>
        new URL(what.url ?? what, location).host === location.host
          ? ask(what, options)
          : Promise.resolve(new Response(null, { status: 204 }));
    </script>
    """
_OUTSIDE = re.compile(r"<link\b[^>]*https://[^>]*>\s*")

# Ends the program as soon as the process that needs its files ends, even by SIGKILL: its input ends then.
_SUPERVISED = """
import os, subprocess, sys, threading
program = subprocess.Popen(sys.argv[1:], stdin=subprocess.DEVNULL)
threading.Thread(target=lambda: (os.read(0, 1), program.kill()), daemon=True).start()
os._exit(program.wait() != 0)
"""


class Asset(NamedTuple):
    """A file of the viewer."""

    kind: str
    """Its media type."""
    content: bytes


def read_assets() -> dict[str, Asset]:
    """Return the files of the viewer by their paths; the program that contains them runs meanwhile.

    Raises
    ------
    SpheretwinError
        The program is missing or does not serve them.
    """
    if not PROGRAM.is_file():
        raise SpheretwinError(f"viewer: expected Rerun's viewer at {PROGRAM}, received none")
    port = _free_port()
    # Without an address of data it would serve some itself.
    options = ["--serve-web", "--bind", HOST, "--web-viewer-port", str(port), f"rerun+http://{HOST}:1/proxy"]
    try:
        with subprocess.Popen(
            [sys.executable, "-I", "-S", "-c", _SUPERVISED, str(PROGRAM), *options],
            env={**os.environ, "CI": "1", "RUST_LOG": "off"},  # in a CI it collects no statistics
            stdin=subprocess.PIPE,
            stdout=subprocess.DEVNULL,
            stderr=subprocess.DEVNULL,
        ) as process:
            assets = {path: _read(port, path, process) for path in FILES}
            # mypy does not know that `stdin=PIPE` above makes it a stream.
            process.stdin.close()  # type: ignore[union-attr]
    except OSError as error:
        raise SpheretwinError(
            f"viewer: expected the files of Rerun's viewer, {without_breaks(error)}"
        ) from None
    return {**assets, INDEX: _without_requests(assets[INDEX])}


def _read(port: int, path: str, process: subprocess.Popen[bytes]) -> Asset:
    """A file, as soon as the program answers."""
    until = time.monotonic() + _PATIENCE_S
    while True:
        try:
            with urllib.request.urlopen(f"http://{HOST}:{port}{path}", timeout=_PATIENCE_S) as answer:
                return Asset(answer.headers["Content-Type"], answer.read())
        except urllib.error.HTTPError as error:
            raise OSError(f"{path}: {error}") from None
        except OSError:
            if process.poll() is not None or time.monotonic() > until:
                raise
            time.sleep(0.01)


def _without_requests(index: Asset) -> Asset:
    """Return the page without fonts of other hosts, and with requests to this host only."""
    text = _OUTSIDE.sub("", index.content.decode())
    return index._replace(content=text.replace("<script>", f"{_GUARD}<script>", 1).encode())


def _free_port() -> int:
    with socket.socket() as probe:
        probe.bind((HOST, 0))
        return int(probe.getsockname()[1])
