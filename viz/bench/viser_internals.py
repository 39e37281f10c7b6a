"""Internals of viser: creation of its server, form of its messages, content of its page.

viser has no options for what the bench needs here, and each of these may change with a release:

- `websockets.asyncio.server.serve` is replaced while viser creates its server, as viser accepts every client.
  After a change the bench does not start: `with_guard` reports it.
- The messages of a page are compared with copies of their forms, as viser decodes any message, and some of
  them open a tunnel to another host. A message that has changed is ignored: its control has no effect.
- The subprotocol contains the version of viser. After a change no page is admitted.
- The handler of changed values is replaced: a page that does not operate must not change what another page
  sends. After a change the bench does not start.
- Title, head and class names of the page set its title, its keys and the place of notifications. After a
  change the page has the title and the keys of viser.
- The scripts of the bench send their commands with `__viserMutable.sendMessage` of the page, and place the
  marks of the coils by its `camera` and by the root of `__viserSceneTree`. After a change the buttons of the
  bar have no effect, or the coils have no marks and no menus.

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
import viser._messages as messages
import websockets.asyncio.server as servers
from viser.infra import ClientId

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


CLIENT_FILES = ("bench.css", "bar.js", "coils.js", "plots.js", "dock.js", "panel.js")
"""Style and scripts of the bar, the marks of the coils, the plots, their dock, and the panel."""


def with_head(page: bytes, title: str) -> bytes:
    """Return the page with another title, and with styles and scripts of the bench.

    The script is the first one of the page: it sees a key before any control does. Notifications are at the
    bottom, where they hide nothing.
    """
    style, *scripts = (Path(__file__).with_name(name).read_text(encoding="utf-8") for name in CLIENT_FILES)
    added = Path(__file__).with_name("page_head.html").read_text(encoding="utf-8").rstrip()
    added += f"<style>{style}</style>" + "".join(f"<script>{script}</script>" for script in scripts)
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


def moved_thing(raw: bytes) -> object | None:
    """Return a key of what a message moves, as a slider, the camera or the tip: a later one replaces it.

    A message that is no move has a key of its own. None unless it has the form of a page's message.
    """
    try:
        message = _PAGES.decode(raw)
    except (msgspec.MsgspecError, UnicodeDecodeError, RecursionError):
        return None
    match message:
        case _Camera():
            return _Camera
        case _Drag(phase="update", name=name):
            return _Drag, name
        case _Update(uuid=uuid, updates=_Value(value=float() | list())):
            return _Update, uuid
    return object()


def guard_values(server: viser.ViserServer, accepts: Callable[[viser.GuiEvent], bool]) -> None:
    """Let only some pages change the values of the controls; the others get the present value back.

    viser changes a value, and sends it to all pages, before any callback can refuse it, also for a socket
    that never becomes a page.

    Parameters
    ----------
    server : viser.ViserServer
    accepts : callable
        Takes the event of a change.
    """
    gui, interface = server.gui, server.gui._websock_interface

    async def handle(number: ClientId, message: messages.GuiUpdateMessage) -> None:
        control = gui._gui_input_handle_from_uuid.get(message.uuid)
        client = server.get_clients().get(number)
        if control is None or client is None:
            return
        if control._impl.is_button or accepts(viser.GuiEvent(client, number, control)):
            await gui._handle_gui_updates(number, message)
        else:
            client.gui._websock_interface.queue_message(
                messages.GuiUpdateMessage(message.uuid, {"value": control._impl.value})
            )

    interface.unregister_handler(messages.GuiUpdateMessage, gui._handle_gui_updates)
    interface.register_handler(messages.GuiUpdateMessage, handle)
