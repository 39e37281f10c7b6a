"""Admission of frames: which ones belong to the session of two peers, and the key that authenticates them.

A controller sends `Flags.HELLO` with a random key of its own. The machine answers with a random number that
it has drawn for this key; all later frames of both sides have that number. Frames of an earlier session have
another one, whoever sends them again, also after its HELLO.
"""

from __future__ import annotations

import secrets
from collections.abc import Callable
from enum import Enum
from pathlib import Path

from spheretwin.machine.link.codec import Values
from spheretwin.machine.link.frame_format import Flags
from spheretwin.models.base.errors import InputError, without_breaks

SILENCE_s = 1.0
"""Time without commands after which another controller may begin a session."""

REQUESTS = 8
"""Keys of controllers that the machine has answered and that have sent no command yet."""

LEAST_KEY_BYTES = 16


class Admission(Enum):
    """Place of a frame in a session."""

    REFUSED = "of no session, or of another one"
    IN_ORDER = "of the session"
    FIRST = "the first of a session: its sequence number may be any"
    REQUEST = "a request, independent of the order"


def new_session() -> int:
    """Return a random number of a session; 0 is for controllers that take no part."""
    return secrets.randbelow(2**32 - 1) + 1


class MachineAdmission:
    """Sessions of the controllers of a machine, one at a time.

    A command begins a session if the last one has been silent for `SILENCE_s`. Frames without the field
    `session`, and those in which it is 0, are told apart only by the sequence numbers that their HELLO
    restarts after a silence.

    Parameters
    ----------
    now : callable
        Clock, s.
    authenticated : bool
        Frames without a session are refused.

    Attributes
    ----------
    session : int
        Number of the session; 0 before the first one.
    """

    def __init__(self, now: Callable[[], float], *, authenticated: bool) -> None:
        self.session = 0
        self._now, self._authenticated = now, authenticated
        self._heard_s: float | None = None
        self._requests: dict[int, int] = {}

    def answer_to(self, request: Values) -> int:
        """Return the session that a HELLO is offered."""
        return self._requests.get(request.get("session", 0), 0)

    def __call__(self, frame: Values) -> Admission:
        """Return the place of a frame."""
        number, is_silent = frame.get("session", 0), self._is_silent()
        if number == 0 and self._authenticated:
            return Admission.REFUSED
        if frame.get("flags", 0) & Flags.HELLO:
            return self._request(number, is_silent)
        if is_silent and number in self._requests.values() and (number == 0 or number != self.session):
            self.session, self._heard_s = number, self._now()
            # Sessions that were offered before begin no more.
            self._requests = {key: offer for key, offer in self._requests.items() if offer == number != 0}
            return Admission.FIRST
        if number != self.session:
            return Admission.REFUSED
        self._heard_s = self._now()
        return Admission.IN_ORDER

    def _request(self, key: int, is_silent: bool) -> Admission:
        if key not in self._requests:
            if not is_silent:
                return Admission.REFUSED
            self._requests[key] = new_session() if key else 0
            if len(self._requests) > REQUESTS:
                del self._requests[next(iter(self._requests))]
        return Admission.REQUEST

    def _is_silent(self) -> bool:
        return self._heard_s is None or self._now() - self._heard_s > SILENCE_s


class ControllerAdmission:
    """Session of a controller: that of the answer to its HELLO.

    Attributes
    ----------
    key : int
        Session of a HELLO.
    session : int or None
        Session of the commands; None before the answer.
    """

    def __init__(self) -> None:
        self.key = new_session()
        self.session: int | None = None
        self._requests: set[int] = set()

    def request(self, sequence: int) -> None:
        """Expect the answer to the HELLO with a sequence number, which is random at the start."""
        self._requests.add(sequence)

    def __call__(self, frame: Values) -> Admission:
        """Return the place of a frame."""
        number = frame.get("session")
        if number is None or number == self.session:
            return Admission.IN_ORDER
        if self.session is None and ("echo" not in frame or frame["echo"] in self._requests):
            self.session = number
            return Admission.IN_ORDER
        return Admission.REFUSED


class StreamAdmission:
    """Session of a listener: that of the first frame, so that frames of an earlier one are refused later."""

    def __init__(self) -> None:
        self._session: int | None = None

    def __call__(self, frame: Values) -> Admission:
        """Return the place of a frame."""
        if self._session is None:
            self._session = frame["session"]
        return Admission.IN_ORDER if frame["session"] == self._session else Admission.REFUSED


def read_key(path: Path | None) -> bytes:
    """Return the key in a file, without the line break at its end; no bytes without a file.

    Raises
    ------
    InputError
        The file cannot be read, or the key is too short.
    """
    if path is None:
        return b""
    try:
        key = path.read_bytes().strip()
    except OSError as error:
        raise InputError(
            f"link: expected a file with a key, received {path}, {without_breaks(error)}"
        ) from None
    if len(key) < LEAST_KEY_BYTES:
        raise InputError(
            f"link: expected a key of at least {LEAST_KEY_BYTES} bytes in {path}, received {len(key)}"
        )
    return key
