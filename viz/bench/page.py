"""Page of the bench: every button sends one command; everything shown is the latest status."""

from __future__ import annotations

import json
import socket
import time
from collections.abc import Callable
from typing import Any

import numpy as np
import viser

from spheretwin.viz.bench import server
from spheretwin.viz.bench.access import Access
from spheretwin.viz.bench.event_handlers import Event, EventHandlers, client_name
from spheretwin.viz.bench.feed import Feed
from spheretwin.viz.bench.modes_tab import ModesTab
from spheretwin.viz.bench.protocols import NO_REFERENCE, BenchProtocol, Choices
from spheretwin.viz.bench.scene import Scene
from spheretwin.viz.bench.settings_tab import SettingsTab
from spheretwin.viz.bench.status_panel import status_html
from spheretwin.viz.bench.tabs import FaultsTab, FilesTab
from spheretwin.viz.bench.viser_internals import guard_values

FRAME_S = 1 / 30
"""Period of the scene; the controls follow every few frames, values of fields rarely."""

FRAMES_A_STATUS = 3
FRAMES_A_SETTING = 30

# Width of the panel in letters of its text, which has the size that fits the window.
WIDTH_EM = 20.5
WIDTHS_PX = (235, 480)

TITLE = "bench"

# A page that is reloaded may connect before the disconnection is known. It operates again; a watching page
# does not.
FRESH_S = 5.0

# A page that is being loaded has no heartbeat yet.
LOADING_S = 10.0


class Page:
    """Page of one bench, for this machine only.

    ``with Page(bench, choices, server.listen(port)) as page: page.show(until)``

    Parameters
    ----------
    bench : BenchProtocol
        Bench that is shown and driven.
    choices : Choices
        Choices of the controls.
    listening : socket.socket
        Socket of the server, from `server.listen`.
    """

    def __init__(self, bench: BenchProtocol, choices: Choices, listening: socket.socket) -> None:
        self._bench, self._choices, self._handlers = bench, choices, EventHandlers(bench)
        self._access = Access(listening.getsockname()[1])
        self._watching: dict[int, float] = {}
        self._beating: set[int] = set()
        self._light: set[int] = set()
        self._frame = 0
        self._header: dict[str, Any] = {}
        self._feed = Feed(bench, lambda: dict(self._header))
        self._server = server.serve(listening, TITLE, self._access, self._on_control, self._feed.answers)
        guard_values(self._server, self._handlers.accepts)
        self._server.gui.configure_theme(dark_mode=True, show_logo=False, show_share_button=False)
        self._server.gui.set_panel_label(TITLE)
        _set_camera(self._server)
        self._build()
        self._pages()

    @property
    def address(self) -> str:
        """Address to open in a browser; it works once, and then there is another one."""
        return server.address(self._server, self._access)

    def show(self, ended: Callable[[], bool]) -> None:
        """Follow the bench until `ended` is true."""
        due = time.monotonic()
        while not ended():
            self.draw()
            due = max(due + FRAME_S, time.monotonic())  # late: skip, never catch up
            time.sleep(max(0.0, due - time.monotonic()))

    def draw(self) -> None:
        """Show the latest status once."""
        if self._bench.actuator is not self._actuator:  # another model was loaded
            self._server.scene.reset()
            self._server.gui.reset()
            self._build()
        state = self._bench.state()
        self._handlers.flush()
        self._handlers.settle()
        with self._server.atomic():
            self._scene.move(
                np.array(state.q_rad), _desired(state), np.array(state.current_A), state.current_limit_A
            )
            if self._frame % FRAMES_A_STATUS == 0:
                self._show_status(state)
            if self._frame % FRAMES_A_SETTING == 0:
                self._renew(state)
        self._frame += 1

    def close(self) -> None:
        """End the server."""
        server.stop(self._server)

    def __enter__(self) -> Page:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def _build(self) -> None:
        """Make all controls that the pages share."""
        gui = self._server.gui
        self._actuator = self._bench.actuator
        self._scene = Scene(self._server.scene, self._actuator)
        self._controls(gui, self._choices)
        # The bar, the plots and the menus of the coils send their commands as values of these buttons.
        self._remote = gui.add_button_group("remote", ("",), visible=False)
        self._remote.on_click(self._on_remote)

    def _controls(self, gui: viser.GuiApi, choices: Choices) -> None:
        tabs = gui.add_tab_group()
        with tabs.add_tab("move"):
            self._modes_tab = ModesTab(gui, self._handlers, self._bench, choices, self._scene)
        law, twin = tabs.add_tab("law"), tabs.add_tab("twin")
        self._settings = SettingsTab(gui, self._handlers, self._bench, choices, law, twin)
        with tabs.add_tab("faults"):
            self._faults_tab = FaultsTab(gui, self._handlers, choices)
        with tabs.add_tab("files"):
            self._files_tab = FilesTab(gui, self._handlers, self._bench, choices)
        gui.main_panel.dock_right()

    async def _on_remote(self, event: Event) -> None:
        """Execute a command of the page's script: a command of the bench, or one of the page itself."""
        if event.client_id is None:
            return
        try:
            name, given = json.loads(event.target.value)
            own: dict[str, Callable[..., None]] = {
                "enter": self._modes_tab.enter,
                "theme": self._change_theme,
                "resized": self._resize,
            }
            if act := own.get(name):
                act(event, **given)
            else:
                self._handlers.send(event, name, **given)
        except (ValueError, TypeError):  # no page of the bench sends such a value
            return

    def _change_theme(self, event: Event) -> None:
        """Change a page between dark and light."""
        self._light ^= {event.client_id}
        event.client.gui.configure_theme(
            dark_mode=event.client_id not in self._light, show_logo=False, show_share_button=False
        )

    def _resize(self, event: Event, width: float, font: float) -> None:
        """Fit the panel of a page to its window, in pixels, and to the size of its text."""
        least, most = WIDTHS_PX
        event.client.gui.main_panel.set_width(float(np.clip(WIDTH_EM * font, least, min(most, 0.42 * width))))

    def _pages(self) -> None:
        """Register clients that connect or disconnect."""

        @self._server.on_client_connect
        async def _(client: viser.ClientHandle) -> None:
            self._bench.command("hello", client=client_name(client.client_id))
            # The page's scripts read its number here.
            client.gui.add_html(f'<span data-page="{client.client_id}"></span>')
            self._watching[client.client_id] = time.monotonic()

        @self._server.on_client_disconnect
        async def _(client: viser.ClientHandle) -> None:
            self._watching.pop(client.client_id, None)
            self._light.discard(client.client_id)
            self._beating.discard(client.client_id)
            self._bench.command("leave", client=client_name(client.client_id))

    def _on_control(self, word: str, number: int | None) -> None:
        """Pass STOP or a heartbeat of a page to the bench."""
        if word == "stop":
            self._bench.command("stop")
        elif number is not None:
            self._beating.add(number)
            self._bench.command("beat", client=client_name(number))

    def _show_status(self, state: Any) -> None:
        self._header = {
            "remote": self._remote._impl.uuid,
            "status": status_html(state, self._handlers.refused, self._handlers.waiting_command),
            "mode": state.mode,
            "stop_mode": state.stop_mode,
            "running": state.running,
            "speed": min(state.speed, 1e6),
            "operator": state.operator,
            "asking": state.asking,
            "current_A": state.current_A,
            "limit_A": state.current_limit_A,
            "temperature_C": state.temperature_C,
            "failed": state.failed_groups,
            "capture": [state.capture, state.capture_t_s],
        }
        self._scene.trail(self._bench.bins(self._scene.trail_after))
        self._modes_tab.show(state)
        self._faults_tab.show(state)
        self._files_tab.show(state)

    def _renew(self, state: Any) -> None:
        self._settings.show()
        self._modes_tab.renew(state)
        self._files_tab.renew()
        for number, came_s in list(self._watching.items()):
            name = client_name(number)
            fresh = time.monotonic() - came_s < FRESH_S
            if number not in self._beating and time.monotonic() - came_s < LOADING_S:
                self._bench.command("beat", client=name)
            if state.operator is None and fresh and len(self._watching) == 1:
                self._bench.command("ask", client=name)


def _desired(state: Any) -> Any:
    return None if state.mode in NO_REFERENCE else np.array(state.q_ref_rad)


def _set_camera(server: viser.ViserServer) -> None:
    """Place the camera so that the shaft, all rows of coils and the ball between them are visible."""
    camera = server.initial_camera
    camera.position, camera.look_at, camera.near = (0.11, -0.16, 0.12), (0.0, 0.0, 0.02), 0.01
