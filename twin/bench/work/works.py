"""The parts of one bench: what commands act on, what is run, and what is shown."""

from __future__ import annotations

from collections.abc import Callable

from spheretwin.models.base.errors import InputError
from spheretwin.twin.bench.desk import Desk
from spheretwin.twin.bench.history import History
from spheretwin.twin.bench.operators import Operators
from spheretwin.twin.bench.pace import Pace
from spheretwin.twin.bench.player import Player
from spheretwin.twin.bench.queue import Queue
from spheretwin.twin.bench.work.recording import Recording
from spheretwin.twin.scenario.sections import Scenario
from spheretwin.twin.session import Session


class Works:
    """Parts of a bench that begins paused.

    Parameters
    ----------
    scenario : Scenario
    operators : Operators

    Attributes
    ----------
    desk : Desk
    operators : Operators
    pace : Pace
    queue : Queue
    recording : Recording
    history : History
        Of the twin; a player has its own.
    player : Player or None
        What is shown instead of the twin.
    running : bool
        Whether time goes on.
    steps : int
        Ticks to be run while it does not.
    note, refused : str or None
        What happened last that nobody commanded; the last command that was refused, and why.
    tried : set
        Fields and values that were tried out beside the loop.
    """

    def __init__(self, scenario: Scenario, operators: Operators) -> None:
        self.desk, self.operators = Desk(scenario, Session(scenario)), operators
        self.pace, self.queue, self.recording = Pace(), Queue(), Recording(self.take_note)
        self.player: Player | None = None
        self.running, self.steps = False, 0
        self.note: str | None = None
        self.refused: str | None = None
        self.tried: set[tuple[str, object]] = set()
        self.history = self._new_history()

    @property
    def moves(self) -> bool:
        """Whether there are ticks to run."""
        return self.running or self.steps > 0

    @property
    def period_s(self) -> float:
        """From row to row of what is shown."""
        return self.player.period_s if self.player else self.desk.session.scenario.controller.period_s

    @property
    def t_s(self) -> float:
        """Simulated time of what is shown."""
        return float(self.player.row["t_s"][0]) if self.player else self.desk.session.t_s

    def take_note(self, text: str | None) -> None:
        """Remember what happened last that nobody commanded."""
        self.note = text

    def pause(self) -> None:
        """Let time stand still."""
        self.running, self.steps = False, 0

    def check_going(self, name: str) -> None:
        """Find out whether what is shown can go on.

        Raises
        ------
        InputError
            It cannot, and `name` asks for it.
        """
        if self.player is None and self.desk.reason is not None:
            raise InputError(f"bench: expected reset, as the run has ended, received {name}")

    def begin(self, settings: Scenario, session: Session) -> None:
        """Begin anew with a session at tick 0, paused."""
        self.desk.begin(settings, session)
        self.player = None
        self.pause()
        self.history = self._new_history()
        self.recording.begin_anew()
        self.pace.clear()

    def went_back(self, end: Callable[..., None] | None) -> None:
        """Go on from where the session is now, after it went back; `end` completes what was recorded."""
        session = self.desk.session
        self.recording.end(session, "the recording has ended: time went back", end)
        self.recording.go_on_from(session)
        self.player, self.history = None, self._new_history()

    def _new_history(self) -> History:
        session = self.desk.session
        return History(len(session.actuator.groups), session.scenario.controller.period_s)
