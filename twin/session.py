"""A twin that runs for as long as it is asked to: advanced in chunks, changed between them, restored."""

from __future__ import annotations

import json
import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager
from types import TracebackType
from typing import Any

import numpy as np
from numpy.typing import NDArray

from spheretwin import active_config
from spheretwin import loop as loops
from spheretwin.active_config import initial_config
from spheretwin.control.law import Law
from spheretwin.control.supervision.watchdog import Reason
from spheretwin.control.user_law import reference_of
from spheretwin.inputs import InputGenerator
from spheretwin.models.actuator import Actuator
from spheretwin.models.base.errors import InputError, LawError, SpheretwinError, shown
from spheretwin.models.telemetry.run_record import Change
from spheretwin.models.telemetry.signals import Signal, with_more
from spheretwin.models.telemetry.status import BY_CODE, Status
from spheretwin.models.telemetry.table import Table, allocated, check_rows
from spheretwin.runtime import Runtime
from spheretwin.scenario import files as scenario_files
from spheretwin.scenario.changes import from_now_on, is_fixed, scheduled_changes
from spheretwin.scenario.files import Files
from spheretwin.scenario.reading import as_plain, is_dotted
from spheretwin.scenario.sections import ResolvedScenario, Scenario, UserPath
from spheretwin.snapshot import Snapshot, UserLaws
from spheretwin.trajectories.trajectory import Sampled


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
    files : Files, optional
        What the files of this scenario say, from `twin.scenario.files.files_of`; read anew unless given.

    Attributes
    ----------
    begun_as : ResolvedScenario
        The scenario at tick 0; with the journal it says all that has happened.
    law_reference : str or None
        ``FILE.py:NAME`` of the law that was given at the start, if a file holds it.
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

    def __init__(
        self,
        scenario: Scenario,
        law: Law | None = None,
        trajectory: Sampled | None = None,
        *,
        files: Files | None = None,
    ) -> None:
        self._busy = threading.Lock()
        self._closed = False
        self._own_laws = UserLaws().with_law(law)
        self.tick, self.loop_s = 0, 0.0
        self.journal: tuple[Change, ...] = ()
        self.events: tuple[Change, ...] = ()
        self._status = Status.RUNNING
        self._config = initial_config(scenario, law, trajectory, files)
        self.begun_as = self.scenario
        self.law_reference = reference_of(law)
        self._planned = scheduled_changes(self.begun_as)
        self._inputs = self._outside()
        self._runtime = Runtime(self.scenario, self._config.files, self._config.law)
        self._seen = with_more({}, self.signals)
        self._check_plan()
        self._make_planned()

    @property
    def actuator(self) -> Actuator:
        """What is simulated."""
        return self._config.files.actuator

    @property
    def scenario(self) -> ResolvedScenario:
        """In force now: what was left open is filled in from the model and the trajectory."""
        return self._config.scenario

    @property
    def status(self) -> Status:
        """Status of the run: ``running``, ``failsafe`` from the tick of a trip on, or how the run ended."""
        return Status.FAILSAFE if self.reason else self._status

    @property
    def ended(self) -> bool:
        """True if no further tick can be run; after a trip the rundown is still to come."""
        return self._status != Status.RUNNING

    @property
    def reason(self) -> Reason:
        """Why the currents were taken away, by a watchdog or a coil that is too hot, if they were."""
        return self._runtime.reason

    @property
    def law_error(self) -> LawError | None:
        """Exception of a compiled law, which ended the run; one of a law in plain Python is raised."""
        return self._runtime.law_error

    @property
    def t_s(self) -> float:
        """Simulated time, s."""
        return self.tick * self.scenario.controller.period_s

    @property
    def q_rad(self) -> NDArray[np.float64]:
        """Hinge angles now, (3,) in rad."""
        return self._runtime.q_rad

    @property
    def qdot_rad_s(self) -> NDArray[np.float64]:
        """Hinge rates now, (3,) in rad/s."""
        return self._runtime.qdot_rad_s

    @property
    def signals(self) -> tuple[Signal, ...]:
        """Columns of the telemetry: the common ones, those of its stages, then the law's own."""
        return self._runtime.signals

    @property
    def law(self) -> Law:
        """In force now."""
        return self._runtime.law

    def advance(self, ticks: int) -> Table:
        """Run some control ticks.

        Parameters
        ----------
        ticks : int
            How many at most; fewer are run where the run ends, or where an event of the scenario changes the
            columns.

        Returns
        -------
        Table
            One row for each tick.
        """
        if not isinstance(ticks, int | np.integer) or ticks < 0:
            raise InputError(f"session: expected a number of ticks from 0 on, received {shown(ticks)}")
        with self._alone():
            self._make_planned()
            log = allocated(int(ticks), self._runtime.row_width)
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
            check_rows(log, self._runtime.row_width)
            return self._advance(log)

    def check_horizon(self, ticks: int) -> None:
        """Find out whether reference and disturbance are numbers up to a tick to come, or to an event.

        Raises
        ------
        InputError
            They are not.
        """
        waiting = [change.tick for change in self._waiting()[:1]]
        self._inputs.check_horizon(max(min([ticks, *waiting]) - 1, self.tick))

    def set(self, name: str, value: Any) -> None:
        """Change a field of the scenario from the next tick on, or the law itself.

        What a scenario leaves open was filled in at the start: it does not follow (as the limit that the
        allocation keeps to does not follow the drive's, unless it is set too).

        Parameters
        ----------
        name : str
            Dotted, as ``disturbance.load``; ``fault`` with a mapping adds a fault, from now on unless it says
            when.
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
            if isinstance(value, Law) and name != "controller.law":
                raise InputError(f"session: expected a law for controller.law, received one for {name}")
            value = from_now_on(name, value, self.t_s)
            with self._all_or_nothing():
                self._change(name, value)
            self.journal += (Change(self.tick, name, _recorded(value)),)

    def snapshot(self) -> Snapshot:
        """All that this session goes on from."""
        with self._alone():
            return Snapshot(
                self.scenario,
                self.begun_as,
                self._own_laws.key_of(self._config.user_law),
                scenario_files.digest(self._config.files),
                self.scenario.controller.source,
                self.tick,
                self._status,
                self._runtime.state(),
                self._inputs.state(),
                self.journal,
                self.events,
            )

    def restore(self, snapshot: Snapshot) -> None:
        """Go on from a snapshot, bit for bit as the session that it was taken of.

        Raises
        ------
        InputError
            It is no snapshot, or was taken under a law of the user's that this session does not have, or on
            another model.
        """
        with self._alone(), self._all_or_nothing():
            if not isinstance(snapshot, Snapshot):
                raise InputError(f"session: expected a snapshot of a session, received {shown(snapshot)}")
            user_law = self._own_laws.under(snapshot.user_law)
            if isinstance(snapshot.scenario.trajectory, UserPath) != bool(self._config.user_trajectory):
                raise InputError(
                    "session: expected a snapshot along the trajectory that it follows itself,"
                    f" received one along {snapshot.scenario.trajectory.shape}"
                )
            self._restore(snapshot, user_law)

    def close(self) -> None:
        """End the session: to advance, set, keep or restore it is refused from then on."""
        self._closed = True

    def __repr__(self) -> str:
        scenario = self.scenario
        return f"Session({scenario.name} under {scenario.controller.law}: {self.status} at {self.t_s:g} s)"

    def __enter__(self) -> Session:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()

    def warnings(self) -> list[str]:
        """What a user should know of model and scenario before believing the figures; one line each."""
        return active_config.warnings_of(self.scenario, self._config.files)

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
                until = self._runtime.apply_faults(self.tick)
                most = min(self._most(len(log) - done), until - self.tick)
                inputs = self._inputs.rows(self.tick, most)
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

    def _outside(self) -> InputGenerator:
        return InputGenerator(self.scenario, self._config.user_trajectory, len(self.actuator.groups))

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
                    self._change(change.name, change.value)
                except InputError as error:
                    raise InputError(f"{error}, as the event at {self.t_s:g} s sets it") from None
                self.events += (change,)

    def _run(self, inputs: loops.Inputs, log: NDArray[np.float64]) -> int:
        started = time.perf_counter()
        try:
            ticks, code = self._runtime.run(inputs, log)
        except BaseException as error:  # a law in plain Python: the state is somewhere within a tick
            self._status = Status.DIVERGED
            if isinstance(error, Exception | KeyboardInterrupt):
                raise
            raise LawError.of(self.law.name, self.t_s, error) from error  # it would end the process
        self.loop_s += time.perf_counter() - started
        self.tick += ticks
        self._status = BY_CODE[code]
        return ticks

    def _change(self, name: str, value: Any) -> None:
        before, self._config = self._config, self._config.with_change(name, value)
        scenario, user_law = self.scenario, self._config.user_law
        # What comes from outside is no part of the machine.
        outside = {"trajectory": scenario.trajectory, "disturbance": scenario.disturbance}
        built = before._replace(scenario=before.scenario.model_copy(update=outside))
        if built != self._config or user_law not in (None, self.law):
            self._runtime = self._runtime.transfer_to(scenario, self._config.files, user_law)
            self._seen = with_more(self._seen, self.signals)
        self._own_laws = self._own_laws.with_law(user_law)
        self._inputs.scenario = scenario  # last: it is altered, and what fails must have changed nothing

    def _check_plan(self) -> None:
        """Find out before the first tick what an event would only be refused for at its own.

        Raises
        ------
        InputError
            An event sets what cannot be set under this law, along this trajectory, with these files.
        """
        seen, made = self._seen, 0
        try:
            for in_force in self._config.with_changes(self._planned):
                seen, made = with_more(seen, in_force.signals), made + 1
        except InputError as error:
            at_s = self._planned[made].tick * self.scenario.controller.period_s
            raise InputError(f"{error}, as the event at {at_s:g} s sets it") from None

    def _restore(self, snapshot: Snapshot, user_law: Law | None) -> None:
        files = scenario_files.reload_files(self._config.files, self.scenario, snapshot.scenario)
        snapshot.check_fits(files)
        self._config = self._config._replace(scenario=snapshot.scenario, files=files, user_law=user_law)
        self._runtime = Runtime(self.scenario, files, self._config.law)
        self._runtime.restore(snapshot.runtime)
        self._seen = with_more(self._seen, self.signals)
        self.begun_as, self._planned = snapshot.begun_as, scheduled_changes(snapshot.begun_as)
        self.tick, self._status = snapshot.tick, snapshot.status
        self.journal, self.events = snapshot.journal, snapshot.events
        self._inputs = self._outside()
        self._inputs.restore(snapshot.inputs)


def _recorded(value: Any) -> Any:
    """A value as JSON holds it, and as a scenario takes it: nothing of the caller's own, which may change."""
    if isinstance(value, Law):
        return active_config.name_of_user_object(value.name)
    return json.loads(json.dumps(value, default=as_plain))
