"""A twin that runs for as long as it is asked to: advanced in chunks, changed between them, restored."""

from __future__ import annotations

import json
import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from types import TracebackType
from typing import Any

import numpy as np
from numpy.typing import NDArray

from spheretwin.control.law import Law
from spheretwin.control.laws.registry import LAWS
from spheretwin.models.actuator import Actuator
from spheretwin.models.base.errors import InputError, SpheretwinError
from spheretwin.models.base.wording import shown
from spheretwin.models.telemetry.record import Change
from spheretwin.models.telemetry.signals import Signal
from spheretwin.models.telemetry.status import BY_CODE, Status
from spheretwin.models.telemetry.table import Table, allocated
from spheretwin.twin import assembly
from spheretwin.twin import loop as loops
from spheretwin.twin.assembly import Files
from spheretwin.twin.exogenous import Exogenous
from spheretwin.twin.machine import Machine, State
from spheretwin.twin.scenario.changing import changed, is_fixed
from spheretwin.twin.scenario.planned import planned
from spheretwin.twin.scenario.reading import as_plain, is_dotted
from spheretwin.twin.scenario.sections import OwnPath, Scenario
from spheretwin.twin.trajectories.trajectory import Sampled, checked


@dataclass(frozen=True)
class Snapshot:
    """All that a session goes on from; it can be pickled."""

    scenario: Scenario
    begun_as: Scenario
    own_law: str | None
    files: str
    """Digest of model and torque curves."""
    law_source: str
    """Digest of the file that the law is from, if it is one of the user's."""
    tick: int
    status: Status
    machine: State
    exogenous: dict[str, Any]
    journal: tuple[Change, ...]
    events: tuple[Change, ...]


class Session:
    """One twin, ready to be advanced; its horizon is open.

    Parameters
    ----------
    scenario : Scenario
        From `scenario.load`; its duration is of no concern here.
    law : Law, optional
        Runs instead of the law that the scenario names.
    trajectory : object with ``sample(t)``, optional
        Followed instead of the trajectory that the scenario names, to the end.

    Attributes
    ----------
    scenario : Scenario
        In force now: what was left open is filled in from the model and the trajectory.
    begun_as : Scenario
        The same at tick 0; with the journal it says all that has happened.
    signals : tuple of Signal
        Columns of the telemetry; a change of law, friction or sensors may change them.
    journal : tuple of Change
        What `set` did.
    events : tuple of Change
        What the events of the scenario did so far.
    tick : int
        Control ticks done.
    loop_s : float
        Wall time spent in the loop alone, s.

    Raises
    ------
    InputError
        The model file, the torque curve, the law or a value of the scenario cannot be used.

    Notes
    -----
    A session belongs to one thread at a time: calls from a second one while the first is at work are refused.
    """

    def __init__(self, scenario: Scenario, law: Law | None = None, trajectory: Sampled | None = None) -> None:
        self._busy = threading.Lock()
        self._closed = False
        self._own_law = law
        self._own_laws = {law.name: law} if law else {}
        self._seen: dict[str, Signal] = {}
        self._own_trajectory = None if trajectory is None else checked(trajectory)
        self.tick, self.loop_s = 0, 0.0
        self.journal: tuple[Change, ...] = ()
        self.events: tuple[Change, ...] = ()
        self._status = Status.RUNNING
        self._files = assembly.files_of(scenario)
        self.scenario = self.begun_as = assembly.resolved(scenario, self._files, law, self._own_trajectory)
        self._planned = planned(self.begun_as)
        self._exogenous = Exogenous(self.scenario, self._own_trajectory)
        self._machine = Machine(self.scenario, self._files, law or assembly.law_of(self.scenario))
        self._seen = self._with(self._machine.signals)
        self._check_plan()
        self._make_planned()

    @property
    def actuator(self) -> Actuator:
        """What is simulated."""
        return self._files.actuator

    @property
    def status(self) -> Status:
        """``running``, or why the run can go on no further, as ``left_workspace`` or ``diverged``."""
        return self._status

    @property
    def t_s(self) -> float:
        """Simulated time, s."""
        return self.tick * self.scenario.controller.period_s

    @property
    def q_rad(self) -> NDArray[np.float64]:
        """Hinge angles now, (3,) in rad."""
        return self._machine.q_rad

    @property
    def signals(self) -> tuple[Signal, ...]:
        """Columns of the telemetry: the common ones, those of its stages, then the law's own."""
        return self._machine.signals

    @property
    def law(self) -> Law:
        """In force now."""
        return self._machine.law

    def advance(self, ticks: int) -> Table:
        """Run some control ticks.

        Parameters
        ----------
        ticks : int
            How many at most; fewer are run where the status becomes other than ``running``, or where an event
            of the scenario changes the columns.

        Returns
        -------
        Table
            One row for each tick.
        """
        if not isinstance(ticks, int | np.integer) or ticks < 0:
            raise InputError(f"session: expected a number of ticks from 0 on, received {shown(ticks)}")
        with self._alone():
            self._make_planned()
            log = allocated(int(ticks), self._machine.columns)
            return Table(self.signals, log[: self._advance(log)])

    def advance_into(self, log: NDArray[np.float64]) -> int:
        """Run a control tick for each row of an array of the caller's; returns how many were run.

        Raises
        ------
        InputError
            Its rows are not those of the telemetry: compiled code would write beside them.
        """
        with self._alone():
            self._make_planned()
            _check_rows(log, self._machine.columns)
            return self._advance(log)

    def check_horizon(self, ticks: int) -> None:
        """Find out whether reference and disturbance are numbers up to a tick to come, or to an event.

        Raises
        ------
        InputError
            They are not.
        """
        waiting = [change.tick for change in self._waiting()[:1]]
        self._exogenous.check_horizon(max(min([ticks, *waiting]) - 1, self.tick))

    def set(self, name: str, value: Any) -> None:
        """Change a field of the scenario from the next tick on, or the law itself.

        What a scenario leaves open was filled in at the start: it does not follow (as the limit that the
        allocation keeps to does not follow the drive's, unless it is set too).

        Parameters
        ----------
        name : str
            Dotted, as ``disturbance.load``.
        value : any
            Checked as a scenario is; for ``controller.law`` also a `Law`. A law that stays keeps its memory,
            also with other gains, unless these make the memory longer or shorter: then it begins anew.

        Raises
        ------
        InputError
            A field that is unknown, fixed for the run, or a value out of range; nothing has changed then.
        """
        with self._alone():
            if not is_dotted(name):
                raise InputError(
                    f"session: expected a field such as disturbance.load, received {shown(name)}"
                )
            if is_fixed(name):
                raise InputError(f"session: expected a field that may change during a run, received {name}")
            own = value if isinstance(value, Law) else None
            if own and name != "controller.law":
                raise InputError(f"session: expected a law for controller.law, received one for {name}")
            with self._all_or_nothing():
                self._change(name, value, own)
            recorded = assembly.name_of_own(own.name) if own else _recorded(value)
            self.journal += (Change(self.tick, name, recorded),)

    def snapshot(self) -> Snapshot:
        """All that this session goes on from."""
        with self._alone():
            return Snapshot(
                self.scenario,
                self.begun_as,
                self._key_of_own(),
                assembly.digest(self._files),
                self.scenario.controller.source,
                self.tick,
                self._status,
                self._machine.state(),
                self._exogenous.state(),
                self.journal,
                self.events,
            )

    def restore(self, snapshot: Snapshot) -> None:
        """Go on from a snapshot, bit for bit as the session that it was taken of.

        Raises
        ------
        InputError
            It was taken under a law of the user's that this session does not have, or on another model.
        """
        with self._alone(), self._all_or_nothing():
            if snapshot.own_law is not None and snapshot.own_law not in self._own_laws:
                known = ", ".join([*LAWS, *self._own_laws])
                raise InputError(
                    f"session: expected a snapshot under one of the laws {known},"
                    f" received one under {snapshot.own_law}"
                )
            if isinstance(snapshot.scenario.trajectory, OwnPath) != (self._own_trajectory is not None):
                raise InputError(
                    "session: expected a snapshot along the trajectory that it follows itself,"
                    f" received one along {snapshot.scenario.trajectory.shape}"
                )
            self._own_law = self._own_laws[snapshot.own_law] if snapshot.own_law is not None else None
            self._restore(snapshot)

    def close(self) -> None:
        """End the session: to advance, set, keep or restore it is refused from then on."""
        self._closed = True

    def __enter__(self) -> Session:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()

    def warnings(self) -> list[str]:
        """What a user should know of model and scenario before believing the figures; one line each."""
        return assembly.warnings_of(self.scenario, self._files)

    @contextmanager
    def _alone(self) -> Iterator[None]:
        if not self._busy.acquire(blocking=False):
            raise SpheretwinError(
                "session: expected one thread at a time, received a second call while one is at work"
            )
        try:
            if self._closed:
                raise SpheretwinError("session: expected an open session, received a call to a closed one")
            yield
        finally:
            self._busy.release()

    @contextmanager
    def _all_or_nothing(self) -> Iterator[None]:
        """Leave the session as it was where a change cannot be made: its parts are replaced, not altered."""
        before = vars(self).copy()
        try:
            yield
        except BaseException:
            vars(self).update(before)
            raise

    def _advance(self, log: NDArray[np.float64]) -> int:
        done = 0
        while done < len(log) and self._status == Status.RUNNING:
            try:
                inputs = self._exogenous.rows(self.tick, self._most(len(log) - done))
            except InputError:
                if done:  # first hand over what there is; the next call will say it
                    break
                raise
            done += self._run(inputs, log[done : done + len(inputs.t)])
            before = self.signals
            try:
                self._make_planned()
            except SpheretwinError:  # the next call makes it again, and says it
                break
            if self.signals != before:
                break
        return done

    def _waiting(self) -> tuple[Change, ...]:
        return self._planned[len(self.events) :]

    def _most(self, ticks: int) -> int:
        """Ticks that can be run at once: an event ends them."""
        return min([ticks, *(change.tick - self.tick for change in self._waiting()[:1])])

    def _make_planned(self) -> None:
        """Make the changes of all events whose tick has come."""
        for change in self._waiting():
            if change.tick > self.tick or self._status != Status.RUNNING:
                break
            with self._all_or_nothing():
                try:
                    self._change(change.name, change.value, None)
                except InputError as error:
                    raise InputError(f"{error}, as the event at {self.t_s:g} s sets it") from None
                self.events += (change,)

    def _run(self, inputs: loops.Inputs, log: NDArray[np.float64]) -> int:
        started = time.perf_counter()
        try:
            ticks, code = self._machine.run(inputs, log)
        except BaseException:  # a law in plain Python: the state is somewhere within a tick
            self._status = Status.DIVERGED
            raise
        self.loop_s += time.perf_counter() - started
        self.tick += ticks
        self._status = BY_CODE[code]
        return ticks

    def _change(self, name: str, value: Any, own: Law | None) -> None:
        self._own_law = own or (None if name == "controller.law" else self._own_law)
        scenario, files = self._next(self.scenario, self._files, name, None if own else value)
        before = self.scenario.model_copy(
            update={"trajectory": scenario.trajectory, "disturbance": scenario.disturbance}
        )
        # What comes from outside is no part of the machine.
        if before != scenario or files != self._files or self._own_law not in (None, self.law):
            self._machine = self._machine.changed(scenario, files, self._own_law)
            self._seen = self._with(self._machine.signals)
        self.scenario, self._files = scenario, files
        if own and own not in self._own_laws.values():
            self._own_laws = {**self._own_laws, self._key_for(own): own}
        self._exogenous.scenario = scenario  # last: it is altered, and what fails must have changed nothing

    def _next(self, scenario: Scenario, files: Files, name: str, value: Any) -> tuple[Scenario, Files]:
        """Scenario with one more change, resolved, and its files; without a value the law alone changes."""
        if value is not None or name != "controller.law":
            if self._own_trajectory and name.split(".")[0] == "trajectory":
                raise InputError(
                    "session: expected no field of a scenario's trajectory, as"
                    f" {self._own_trajectory.name} is followed instead"
                )
            if self._own_law and name.startswith("controller."):
                raise InputError(
                    f"session: expected no field of a shipped law, as {self._own_law.name} is not one"
                )
            before, scenario = scenario, changed(scenario, name, value)
            files = assembly.files_again(files, before, scenario)
        return assembly.resolved(scenario, files, self._own_law, self._own_trajectory), files

    def _check_plan(self) -> None:
        """Find out before the first tick what an event would only be refused for at its own.

        Raises
        ------
        InputError
            An event sets what cannot be set under this law, along this trajectory, with these files.
        """
        scenario, files, own, seen = self.scenario, self._files, self._own_law, self._seen
        try:
            for change in self._planned:
                if change.name == "controller.law":
                    self._own_law = None
                scenario, files = self._next(scenario, files, change.name, change.value)
                law = self._own_law or assembly.law_of(scenario)
                self._seen = self._with(assembly.signals_of(scenario, files.actuator, law))
        except InputError as error:
            at_s = change.tick * self.scenario.controller.period_s
            raise InputError(f"{error}, as the event at {at_s:g} s sets it") from None
        finally:
            self._own_law, self._seen = own, seen

    def _with(self, signals: tuple[Signal, ...]) -> dict[str, Signal]:
        """All signals of the session so far by name: a name means one thing throughout.

        Raises
        ------
        InputError
            One of them has the name of another.
        """
        for signal in signals:
            known = self._seen.get(signal.name, signal)
            if known != signal:
                raise InputError(
                    f"session: expected the signal {signal.name} as it was before,"
                    f" {known.size} in {known.unit} ({known.meaning}),"
                    f" received {signal.size} in {signal.unit} ({signal.meaning})"
                )
        return self._seen | {signal.name: signal for signal in signals}

    def _key_for(self, law: Law) -> str:
        """Key under which a snapshot knows a law of the user's: its name, told apart from others' of it."""
        taken = [key for key in self._own_laws if key.split(" #")[0] == law.name]
        return law.name if not taken else f"{law.name} #{len(taken) + 1}"

    def _key_of_own(self) -> str | None:
        return next((key for key, law in self._own_laws.items() if law is self._own_law), None)

    def _restore(self, snapshot: Snapshot) -> None:
        files = assembly.files_again(self._files, self.scenario, snapshot.scenario)
        if snapshot.scenario.controller.source != snapshot.law_source:
            raise InputError(
                f"session: expected {snapshot.scenario.controller.law} as it was when the snapshot was taken,"
                " received a file that was changed since"
            )
        if assembly.digest(files) != snapshot.files:
            raise InputError(
                "session: expected a snapshot of the same model and torque curves, received one of others"
            )
        law = self._own_law or assembly.law_of(snapshot.scenario)
        self._machine = Machine(snapshot.scenario, files, law)
        self._seen = self._with(self._machine.signals)
        self._machine.restore(snapshot.machine)
        self._files, self.scenario, self.begun_as = files, snapshot.scenario, snapshot.begun_as
        self.tick, self._status, self.journal = snapshot.tick, snapshot.status, snapshot.journal
        self.events, self._planned = snapshot.events, planned(snapshot.begun_as)
        self._exogenous = Exogenous(self.scenario, self._own_trajectory)
        self._exogenous.restore(snapshot.exogenous)


def _recorded(value: Any) -> Any:
    """A value as JSON holds it, and as a scenario takes it: nothing of the caller's own, which may change."""
    return json.loads(json.dumps(value, default=as_plain))


def _check_rows(log: NDArray[np.float64], columns: int) -> None:
    if isinstance(log, np.ndarray):
        fits = log.shape[1:] == (columns,) and log.dtype == np.float64
        if fits and log.flags.c_contiguous and log.flags.writeable:
            return
    raise InputError(
        f"session: expected contiguous, writeable rows of {columns} float64, received"
        f" {getattr(log, 'dtype', type(log).__name__)} of shape {np.shape(log)}"
    )
