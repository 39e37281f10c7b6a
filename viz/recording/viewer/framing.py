"""The messages of what Rerun's encoder gives at each reading, which is a whole recording every time."""

from __future__ import annotations

import struct

# Rerun's file format 2: magic, version and options, then messages, each with its kind and its length before
# it; the one that ends a file says where all others are.
HEADER_BYTES = 12
_MAGIC = b"RRF2"
_BEFORE_A_MESSAGE = struct.Struct("<QQ")
_END = 0


def messages(encoded: bytes) -> bytes:
    """The messages of what is encoded, without what is before the first and behind the last.

    Parameters
    ----------
    encoded : bytes
        A whole recording, or what comes behind the beginning of one.
    """
    first = place = HEADER_BYTES if encoded.startswith(_MAGIC) else 0
    while place + _BEFORE_A_MESSAGE.size <= len(encoded):
        kind, length = _BEFORE_A_MESSAGE.unpack_from(encoded, place)
        if kind == _END:
            break
        place += _BEFORE_A_MESSAGE.size + length
    return encoded[first:place]
