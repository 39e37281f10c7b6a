"""One turn of a bench: take commands, run a chunk, look around, and show what came of it."""

from __future__ import annotations

from dataclasses import replace

from spheretwin.twin.bench.state import State
from spheretwin.twin.bench.work import chunk
from spheretwin.twin.bench.work.picture import picture
from spheretwin.twin.bench.work.taking import Taking, told
from spheretwin.twin.bench.work.works import Works


class Turning:
    """Turns of one bench.

    Parameters
    ----------
    works : Works
    taking : Taking
        Of its commands.

    Attributes
    ----------
    state : State
        The latest picture.
    """

    def __init__(self, works: Works, taking: Taking) -> None:
        self._works, self._taking = works, taking
        self.state: State = picture(works)

    def turn(self, ticks: int, waits: bool) -> int:
        """Take what waits, then run some ticks; returns how many were run.

        Whatever goes wrong is the run's end, not the bench's.

        Parameters
        ----------
        ticks : int
        waits : bool
            Whether to wait for what commands need.
        """
        done = 0
        try:
            self._taking.take(waits)
            self._settle()
            done = chunk.run(self._works, ticks)
            self._look_around()
        except Exception as error:  # of whatever kind, else the thread would end and STOP with it
            self._works.desk.fail(error)
            self._works.pause()
        self._settle()
        self._show()
        return done

    def _show(self) -> None:
        """Make the next picture; where it cannot be made, the last one says so."""
        try:
            self.state = picture(self._works)
        except Exception as error:  # a page must never show an old state as the present one
            self.state = replace(self.state, mode="fault", reason=told(error))

    def _settle(self) -> None:
        """Say what became of the commands, once it can be seen."""
        taking = self._taking
        if not taking.outcomes:
            return
        self._show()
        outcomes, taking.outcomes = taking.outcomes, []
        for ticket, refused in outcomes:
            ticket.settle(refused)

    def _look_around(self) -> None:
        """Hold the rotor where its operator is gone."""
        works = self._works
        if not works.operators.look():
            return
        works.note = "the operator is gone"
        if works.player is None and works.desk.moves:
            works.desk.hold()
            works.note = "the operator is gone: the twin holds"
