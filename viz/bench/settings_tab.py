"""Forms of settings: a line for each field, applied by a button, refused next to the field."""

from __future__ import annotations

import threading
from collections.abc import Callable
from typing import Any

import viser

from spheretwin.models.base.errors import InputError
from spheretwin.viz.bench.event_handlers import Event, EventHandlers, Note, on_change, on_press
from spheretwin.viz.bench.gains import GainHistory, GainSliders
from spheretwin.viz.bench.protocols import BenchProtocol, Choices, FieldSetting

ApplyFields = Callable[[Event, dict[str, str]], None]


class Form:
    """Form with a line for each setting.

    Parameters
    ----------
    gui : viser.GuiApi
        GUI of the container.
    label : str
        Label of its button.
    act : callable
        Receives the fields: texts by name.
    whole : bool
        Whether all of the fields are sent, or only the changed ones.

    Attributes
    ----------
    note : Note
        Under all of them.
    """

    def __init__(self, gui: viser.GuiApi, label: str, act: ApplyFields, whole: bool = False) -> None:
        self._gui, self._act, self._whole = gui, act, whole
        self._settings: list[FieldSetting] = []
        self._lines: dict[str, Any] = {}
        self._notes: dict[str, Note] = {}
        self._form = gui.add_form(None)
        with self._form:
            self._button = gui.add_button(label, order=1e9)
            self.note = Note(gui, 2e9)

        @self._form.on_submit
        async def _(event: Event) -> None:
            if event.client_id is not None:
                self._apply(event)

        @self._button.on_click
        async def _(event: Event) -> None:
            self._apply(event)
            self._form.submit()  # no line is marked as changed any more

    def note_of(self, name: str) -> Note:
        """Return the line under a field."""
        return self._notes.get(name, self.note)

    def show(self, settings: list[FieldSetting]) -> None:
        """Show these fields; a change in progress remains."""
        names = [(setting.name, setting.choices) for setting in settings]
        if names == [(setting.name, setting.choices) for setting in self._settings]:
            self._refresh(settings)
        else:
            self._make(settings)
        self._settings = settings

    def _apply(self, event: Event) -> None:
        changed = {
            setting.name: _written(line)
            for setting, line in zip(self._settings, self._lines.values(), strict=True)
            if self._whole or _written(line) != setting.text
        }
        for note in self._notes.values():
            note.say(None)
        self._act(event, changed)

    def _refresh(self, settings: list[FieldSetting]) -> None:
        for before, now, line in zip(self._settings, settings, self._lines.values(), strict=True):
            if now.text != before.text and _written(line) == before.text:
                line.value = now.text == "true" if isinstance(line.value, bool) else now.text

    def _make(self, settings: list[FieldSetting]) -> None:
        for line in self._lines.values():
            line.remove()
        for note in self._notes.values():
            note.remove()
        with self._form:
            self._lines = {setting.name: self._line(setting) for setting in settings}
            self._notes = {name: Note(self._gui, line.order + 0.5) for name, line in self._lines.items()}

    def _line(self, setting: FieldSetting) -> Any:
        label = setting.name.partition(".")[2] or setting.name
        hint = setting.meaning
        if setting.default is not None:
            hint += f"; {setting.default or 'none'} unless set"
        if setting.choices:
            options = list(dict.fromkeys([*setting.choices, setting.text]))
            return self._gui.add_dropdown(label, options, initial_value=setting.text, hint=hint)
        if setting.text in ("true", "false"):
            return self._gui.add_checkbox(label, setting.text == "true", hint=hint)
        return self._gui.add_text(label, setting.text, hint=hint)


class SettingsTab:
    """Tabs of the law and of all other sections of the scenario.

    Parameters
    ----------
    gui : viser.GuiApi
        GUI of the server.
    handlers : EventHandlers
        Handlers that send the commands.
    bench : BenchProtocol
        Bench whose error is compared.
    choices : Choices
        Fields and laws.
    law, twin : viser.GuiTabHandle
        The tabs.
    """

    def __init__(
        self,
        gui: viser.GuiApi,
        handlers: EventHandlers,
        bench: BenchProtocol,
        choices: Choices,
        law: viser.GuiTabHandle,
        twin: viser.GuiTabHandle,
    ) -> None:
        self._gui, self._handlers, self._choices = gui, handlers, choices
        self._showing = threading.Lock()
        self._known_law = ""
        self._laws: Any
        self._gains: Form
        with law:
            self._law(gui, bench)
        with twin:
            self._twin(gui)
        self.show()

    def show(self) -> None:
        """Show the active values; called by the page, and when a section is chosen."""
        with self._showing:
            self._show(self._choices.settings())

    def _show(self, settings: list[FieldSetting]) -> None:
        law = next(setting for setting in settings if setting.name == LAW)
        laws = list(dict.fromkeys([*self._choices.laws(), law.text]))
        if (self._known_law, list(self._laws.options)) != (law.text, laws):
            self._known_law = law.text
            self._laws.options = laws
            self._laws.value = law.text
        gains = [setting for setting in settings if _section(setting.name) == "controller"]
        self._sliders.show([setting for setting in gains if setting.range])
        self._history.show(gains)
        self._gains.show([setting for setting in gains if setting != law])
        self._often.show([setting for setting in settings if setting.name in OFTEN])
        section = self._sections.value
        self._fields.show(
            [
                setting
                for setting in settings
                if _section(setting.name) == section and setting.name not in OFTEN
            ]
        )

    def _law(self, gui: viser.GuiApi, bench: BenchProtocol) -> None:
        self._laws = gui.add_dropdown("law", self._choices.laws(), hint="of the package and of the folder")
        with gui.add_folder("load law from file", expand_by_default=False):
            own = gui.add_text("law file", "", hint="FILE.py:NAME, on this machine")
            take = gui.add_button("Load law from file")
        note = Note(gui)
        on_change(self._laws, lambda event: self._set_gain(event, LAW, event.target.value, note))
        on_press(take, lambda event: self._set_gain(event, LAW, own.value, note))
        self._history = GainHistory(gui, bench, self._set)
        self._sliders = GainSliders(gui, self._set_gain)
        with gui.add_folder("all fields of the controller", expand_by_default=False):
            self._gains = self._form(gui, "Set gains")
        defaults = gui.add_button("Reset gains to defaults")
        on_press(defaults, self._reset_gains)

    def _twin(self, gui: viser.GuiApi) -> None:
        self._often = self._form(gui, "Set")
        gui.add_divider()
        settings = self._choices.settings()
        sections = list(
            dict.fromkeys(_section(setting.name) for setting in settings if setting.name not in OFTEN)
        )
        sections = [setting for setting in sections if setting not in ELSEWHERE]
        self._sections = gui.add_dropdown("section", sections, initial_value=FIRST_SECTION)
        on_change(self._sections, lambda event: self.show())
        self._fields = self._form(gui, "Set these")

    def _form(self, gui: viser.GuiApi, apply: str) -> Form:
        def set_all(event: Event, fields: dict[str, str]) -> None:
            for name, text in fields.items():
                self._set_gain(event, name, text, form.note_of(name))

        form = Form(gui, apply, set_all)
        return form

    def _reset_gains(self, event: Event) -> None:
        for setting in self._choices.settings():
            if _section(setting.name) != "controller" or setting.name == LAW:
                continue
            if setting.default is not None and setting.text != setting.default:
                self._set_gain(event, setting.name, setting.default, self._gains.note_of(setting.name))

    def _set_gain(self, event: Event, name: str, text: str, note: Note | None = None) -> None:
        """Set a field so that the change can be undone, if it is one of the controller."""
        if _section(name) == "controller":
            self._history.note(name)
        self._set(event, name, text, note)

    def _set(self, event: Event, name: str, text: str, note: Note | None = None) -> None:
        try:
            value = self._choices.read(name, text)
        except InputError as error:
            self._handlers.show_refusal(str(error), note)
        else:
            self._handlers.send(event, "set", note, name=name, value=value)


LAW = "controller.law"

OFTEN = ("allocation", "disturbance.load", "plant.payload_kg", "plant.modelling_error", "hardware")

FIRST_SECTION = "plant"

# The law and its gains, the shape and the faults have their own tabs; the others are not settings.
ELSEWHERE = ("controller", "trajectory", "fault", "event", "manual", "name", "description")


def _section(name: str) -> str:
    return name.partition(".")[0]


def _written(line: Any) -> str:
    value = line.value
    return str(value).lower() if isinstance(value, bool) else str(value)
