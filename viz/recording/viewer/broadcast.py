"""A recording that grows, for any number of readers, none of which is waited for."""

from __future__ import annotations

from collections import deque
from collections.abc import Iterator
from threading import Condition

# Kept for viewers that come late; the oldest make room first.
KEPT_BYTES = 200 << 20

# A reader that is farther behind goes on with the newest: what it shows is to be of now.
BEHIND_BYTES = 8 << 20


class Broadcast:
    """Pieces of a recording, each of whole messages, in memory that is bounded.

    Parameters
    ----------
    kept_bytes : int
        Of pieces, beside what every reader needs; at least the newest is kept.
    behind_bytes : int
        How far a reader may be behind.
    """

    def __init__(self, kept_bytes: int = KEPT_BYTES, behind_bytes: int = BEHIND_BYTES) -> None:
        self._kept_bytes, self._behind_bytes = kept_bytes, behind_bytes
        self._first: bytes | None = None
        self._pieces: deque[tuple[int, bytes]] = deque()  # each with the bytes that were sent before it
        self._dropped, self._sent_bytes = 0, 0
        self._ended = False
        self._changed = Condition()

    def begin(self, first: bytes) -> None:
        """Give what every reader needs."""
        with self._changed:
            self._first = first
            self._changed.notify_all()

    def send(self, piece: bytes) -> None:
        """Give what comes next."""
        with self._changed:
            self._pieces.append((self._sent_bytes, piece))
            self._sent_bytes += len(piece)
            while self._sent_bytes - self._pieces[0][0] > self._kept_bytes and len(self._pieces) > 1:
                self._pieces.popleft()
                self._dropped += 1
            self._changed.notify_all()

    def end(self) -> None:
        """Nothing more comes."""
        with self._changed:
            self._ended = True
            self._changed.notify_all()

    def read(self) -> Iterator[bytes]:
        """What every reader needs, what is kept, and then what comes, to the end.

        A reader that falls behind after it has caught up with what was kept lacks what is between.
        """
        with self._changed:
            self._changed.wait_for(lambda: self._first is not None or self._ended)
            first, place, late = self._first, self._dropped, self._count
        if first is not None:
            yield first
        while (found := self._next(place, late)) is not None:
            place, piece = found
            yield piece

    @property
    def _count(self) -> int:
        """Pieces that were ever sent."""
        return self._dropped + len(self._pieces)

    def _next(self, place: int, late: int) -> tuple[int, bytes] | None:
        """The piece at a place, or a newer one, and the place behind it; None where nothing more comes."""
        with self._changed:
            self._changed.wait_for(lambda: place < self._count or self._ended)
            if place == self._count:
                return None
            place = max(place, self._dropped)
            before, piece = self._pieces[place - self._dropped]
            if place >= late and self._sent_bytes - before > self._behind_bytes:
                place, (_, piece) = self._count - 1, self._pieces[-1]
            return place + 1, piece
