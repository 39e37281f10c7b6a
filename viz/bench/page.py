"""Page of the bench: every button sends one command; everything shown is the latest status."""

from __future__ import annotations

import contextlib
import socket
import time
from collections.abc import Callable
from typing import Any

import numpy as np
import viser

from spheretwin.viz.bench import server
from spheretwin.viz.bench.event_handlers import Event, EventHandlers, client_name, on_press
from spheretwin.viz.bench.modes_tab import ModesTab
from spheretwin.viz.bench.protocols import BenchProtocol, Choices
from spheretwin.viz.bench.scene import Scene
from spheretwin.viz.bench.settings_tab import SettingsTab
from spheretwin.viz.bench.status_panel import TAKE_OVER, currents_html, scale_html, status_html
from spheretwin.viz.bench.tabs import CurvesPanel, FaultsTab, FilesTab

FRAME_S = 1 / 30
"""Period of the scene; text and curves follow every few frames, values of fields rarely."""

FRAMES_A_STATUS = 3
FRAMES_A_SETTING = 30

LEFT_WIDTH, RIGHT_WIDTH = 255, 290
STATUS_HEIGHT = 430

SPEEDS = {"0.1×": 0.1, "0.2×": 0.2, "0.5×": 0.5, "1×": 1.0, "2×": 2.0, "5×": 5.0, "10×": 10.0}
SPEEDS["as fast as possible"] = 1e6

TITLE = "bench"

ASK = "Ask to operate"

# A page that is reloaded may connect before the disconnection is known. It operates again; a watching page
# does not.
FRESH_S = 5.0


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
        self._server = server.serve(listening, TITLE)
        self._watching: dict[int, Any] = {}
        self._frame, self._shown_s = 0, -1.0
        self._server.gui.configure_theme(dark_mode=True, show_logo=False, show_share_button=False)
        self._server.gui.set_panel_label(TITLE)
        _set_camera(self._server)
        self._build()
        self._pages()

    @property
    def address(self) -> str:
        """Address to open in a browser."""
        return server.address(self._server)

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
        self._twin_panel(gui)
        self._curves_panel(gui)
        self._controls(gui, self._choices)

    def _twin_panel(self, gui: viser.GuiApi) -> None:
        panel = gui.add_panel()
        with panel.add_tab("status"):
            # On top: it stays in view at any scroll position.
            self._handlers.button(gui, "STOP (space)", "stop", color="red")
            self._status = gui.add_html("")
            running = gui.add_button_group("run", ("start", "pause", "step", "reset"))
            on_press(running, self._handlers.send_selected)
            speed = gui.add_dropdown("speed", list(SPEEDS), initial_value="1×")
            self._handlers.on_change(
                speed,
                lambda event: self._handlers.send(event, "speed", factor=SPEEDS.get(event.target.value, 1.0)),
            )
        panel.dock_left()
        panel.set_width(LEFT_WIDTH)
        panel.set_height(STATUS_HEIGHT)
        self._panel = panel
        stop = gui.add_command("STOP", hotkey="space")

        @stop.on_trigger
        async def _(event: Event) -> None:
            self._handlers.send(event, "stop")

    def _curves_panel(self, gui: viser.GuiApi) -> None:
        panel = gui.add_panel()
        with panel.add_tab("curves"):
            self._currents = gui.add_html("")
            gui.add_html(scale_html(self._bench.state().current_limit_A))
            self._plots = CurvesPanel(gui)
        panel.dock_below(self._panel)

    def _controls(self, gui: viser.GuiApi, choices: Choices) -> None:
        tabs = gui.add_tab_group()
        with tabs.add_tab("move"):
            self._modes_tab = ModesTab(gui, self._handlers, self._bench, choices, self._scene)
        law, twin = tabs.add_tab("law"), tabs.add_tab("twin")
        self._settings = SettingsTab(gui, self._handlers, choices, law, twin)
        with tabs.add_tab("faults"):
            self._faults_tab = FaultsTab(gui, self._handlers, choices)
        with tabs.add_tab("keep"):
            self._files_tab = FilesTab(gui, self._handlers, self._bench, choices)
        gui.main_panel.dock_right()
        gui.main_panel.set_width(RIGHT_WIDTH)

    def _pages(self) -> None:
        """Register clients that connect or disconnect; add to each page its own buttons."""

        @self._server.on_client_connect
        async def _(client: viser.ClientHandle) -> None:
            self._bench.command("hello", client=client_name(client.client_id))
            ask = client.gui.add_button(ASK, visible=False, order=-1e6)
            on_press(ask, lambda event: self._handlers.send(event, "ask"))
            give = client.gui.add_button("", visible=False, order=-1e6, color="orange")

            def grant(event: Event) -> None:
                for name in self._bench.state().asking[:1]:
                    self._handlers.send(event, "grant", to=name)

            on_press(give, grant)
            self._watching[client.client_id] = (time.monotonic(), ask, give)

        @self._server.on_client_disconnect
        async def _(client: viser.ClientHandle) -> None:
            self._watching.pop(client.client_id, None)
            self._bench.command("leave", client=client_name(client.client_id))

    def _show_status(self, state: Any) -> None:
        _renewed(self._status, status_html(state, self._handlers.refused, self._handlers.waiting_command))
        _renewed(self._currents, currents_html(state.current_A, state.current_limit_A, state.temperature_C))
        if state.t_s < self._shown_s:  # another run
            self._scene.forget()
        if state.t_s != self._shown_s:
            self._shown_s = state.t_s
            self._scene.trail(np.array(state.q_rad))
            self._plots.show(*self._bench.bounds())
            self._plots.warm(state.t_s, state.temperature_C)
        self._modes_tab.show(state)
        self._faults_tab.show(state)
        self._files_tab.show(state)

    def _renew(self, state: Any) -> None:
        self._settings.show()
        for number, (came_s, ask, give) in list(self._watching.items()):
            name = client_name(number)
            self._bench.command("beat", client=name)
            fresh = time.monotonic() - came_s < FRESH_S
            if state.operator is None and fresh and len(self._watching) == 1:
                self._bench.command("ask", client=name)
            with contextlib.suppress(RuntimeError):  # the page may be closed meanwhile
                ask.visible = state.operator != name and name not in state.asking
                ask.label = ASK if state.operator else TAKE_OVER
                give.visible = state.operator == name and bool(state.asking)
                if give.visible:
                    give.label = f"Grant control to {state.asking[0]}"


def _desired(state: Any) -> Any:
    return None if state.mode in ("off", "manual", "fault") else np.array(state.q_ref_rad)


def _renewed(html: Any, content: str) -> None:
    if html.content != content:
        html.content = content


def _set_camera(server: viser.ViserServer) -> None:
    """Place the camera so that the shaft, all rows of coils and the ball between them are visible."""
    camera = server.initial_camera
    camera.position, camera.look_at, camera.near = (0.15, -0.22, 0.15), (0.0, 0.0, 0.02), 0.01
