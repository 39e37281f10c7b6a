"""Internals of viser: creation of its server, form of its messages, content of its page.

viser has no options for what the bench needs here, and each of these may change with a release:

- `websockets.asyncio.server.serve` is replaced while viser creates its server, as viser accepts every client.
  After a change the bench does not start: `with_guard` reports it.
- The messages of a page are compared with copies of their forms, as viser decodes any message, and some of
  them open a tunnel to another host. A message that has changed is ignored: its control has no effect.
- The subprotocol contains the version of viser. After a change no page is admitted.
- Title, head and class names of the page set its title, its keys and the place of notifications. After a
  change the page has the title and the keys of viser.

`pyproject.toml` bounds the versions; `tests/viz/bench/test_viser_internals.py` names what has changed.
"""

from __future__ import annotations

import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Annotated, Any, NamedTuple, Union

import msgspec
import viser
import websockets.asyncio.server as servers

from spheretwin.models.base.errors import SpheretwinError

SUBPROTOCOL = f"viser-v{viser.__version__}"
"""Subprotocol of the sockets of a page."""


class ServerArguments(NamedTuple):
    """Arguments with which viser creates its server."""

    handler: Any
    process_request: Any
    """Returns the files of the page."""
    subprotocols: Any
    select_subprotocol: Any


_server_lock = threading.Lock()


@contextmanager
def with_guard(guard: Callable[[ServerArguments], servers.serve]) -> Iterator[None]:
    """Make viser create its server with a connection guard.

    Raises
    ------
    SpheretwinError
        viser has created its server in another way, without the guard.
    """
    guarded = threading.Event()

    def create(handler: Any, host: str, port: int, *, process_request: Any, **options: Any) -> servers.serve:
        guarded.set()
        return guard(
            ServerArguments(handler, process_request, options["subprotocols"], options["select_subprotocol"])
        )

    with _server_lock:
        # mypy refuses to replace a class by a function; viser only calls it, with these arguments.
        plain, servers.serve = servers.serve, create  # type: ignore[misc, assignment]
        try:
            yield
        finally:
            # mypy refuses any assignment to a class of a module; this restores the original.
            servers.serve = plain  # type: ignore[misc]
    if not guarded.is_set():
        raise SpheretwinError(
            f"bench: expected viser to create its server with websockets.asyncio.server.serve; viser"
            f" {viser.__version__} does not, and the page would accept foreign clients"
        )


TITLE = b"<title>Viser</title>"
"""Title of the page, as viser serves it."""


def with_head(page: bytes, title: str) -> bytes:
    """Return the page with another title and with the style and the script of `page_head.html`.

    A key that is let go over a button would press it, and the space bar is STOP wherever it is pressed.
    viser's camera listens to keys too, at the document, after its commands: an arrow moves the twin only.
    Notifications are at the bottom, where they hide nothing.
    """
    added = Path(__file__).with_name("page_head.html").read_text(encoding="utf-8").rstrip()
    head = f"<head><title>{title}</title>{added}".encode()
    return page.replace(TITLE, b"").replace(b"<head>", head, 1)


Name = Annotated[str, msgspec.Meta(max_length=256)]
# Numbers of a page are finite.
Number = Annotated[float, msgspec.Meta(ge=-1e9, le=1e9)]
Two = tuple[Number, Number]
Three = tuple[Number, Number, Number]
Four = tuple[Number, Number, Number, Number]


class _Message(msgspec.Struct, tag_field="type", forbid_unknown_fields=True):
    pass


class _Camera(_Message, tag="ViewerCameraMessage"):
    wxyz: Four
    position: Three
    fov: Number
    near: Number
    far: Number
    image_height: int
    image_width: int
    look_at: Three
    up_direction: Three


class _Value(msgspec.Struct, forbid_unknown_fields=True):
    value: (
        bool
        | Number
        | Annotated[str, msgspec.Meta(max_length=4096)]
        | Annotated[list[Number], msgspec.Meta(max_length=3)]
    )


class _Update(_Message, tag="GuiUpdateMessage"):
    uuid: Name
    updates: _Value


class _Command(_Message, tag="CommandTriggerMessage"):
    uuid: Name


class _Submission(_Message, tag="GuiFormSubmitMessage"):
    uuid: Name


class _Edit(_Message, tag="GuiFormDirtyMessage"):
    uuid: Name


class _Click(_Message, tag="SceneNodeClickMessage"):
    name: Name
    instance_index: int | None
    ray_origin: Three
    ray_direction: Three
    screen_pos: Two
    modifier: Name | None
    owner: Name = ""


class _Drag(_Message, tag="SceneNodeDragMessage"):
    phase: Name
    name: Name
    instance_index: int | None
    start_position: Three
    start_screen_pos: Two
    end_position: Three
    end_screen_pos: Two
    button: Name
    modifier: Name | None
    owner: Name = ""


MESSAGES = (_Camera, _Update, _Command, _Submission, _Edit, _Click, _Drag)
"""Forms of the messages of a page."""

_PAGES: msgspec.msgpack.Decoder[Any] = msgspec.msgpack.Decoder(Union[MESSAGES])  # noqa: UP007


def is_page_message(raw: bytes) -> bool:
    """True if a message of a socket has the form of a page's message."""
    try:
        _PAGES.decode(raw)
    except (msgspec.MsgspecError, UnicodeDecodeError, RecursionError):
        return False
    return True
