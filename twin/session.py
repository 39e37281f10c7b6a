"""Session: a twin that is advanced in chunks, changed between them, saved and restored."""

from __future__ import annotations

import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager
from types import TracebackType
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray
from pydantic import ValidationError

from spheretwin.config import active_config
from spheretwin.config.active_config import initial_config
from spheretwin.config.config_warnings import warnings_of
from spheretwin.control.law import Law
from spheretwin.control.supervision.watchdog import Reason
from spheretwin.control.user_law import reference_of
from spheretwin.loop import closed_loop as loops
from spheretwin.loop.external import ExternalController, ExternalPlant, name_of
from spheretwin.loop.inputs import InputGenerator
from spheretwin.loop.runtime import Runtime
from spheretwin.models.actuator import Actuator
from spheretwin.models.base.arrays import real_array
from spheretwin.models.base.errors import InputError, LawError, SpheretwinError, shown
from spheretwin.models.telemetry.run_record import Change
from spheretwin.models.telemetry.signals import Signal, with_more
from spheretwin.models.telemetry.status import BY_CODE, Status
from spheretwin.models.telemetry.table import Table, allocated, check_rows
from spheretwin.scenario import files as scenario_files
from spheretwin.scenario.changes import EXTERNAL, STATE, StateChange, from_now_on, is_fixed, scheduled_changes
from spheretwin.scenario.fields import explain
from spheretwin.scenario.files import Files
from spheretwin.scenario.reading import is_dotted
from spheretwin.scenario.sections import ResolvedScenario, Scenario, UserPath
from spheretwin.snapshot import Snapshot, UserLaws
from spheretwin.trajectories.trajectory import Sampled


class Session:
    """Digital twin with an open end, ready to be advanced.

    Parameters
    ----------
    scenario : Scenario
        From `scenario.load`; its duration is not used.
    law : Law, optional
        Replaces the law of the scenario.
    trajectory : object with ``sample(t)``, optional
        Replaces the trajectory of the scenario, to the end.
    files : Files, optional
        Content of the files of this scenario, from `scenario.files.files_of`; default: read now.
    external : ExternalController or ExternalPlant, optional
        Part outside of this process, which replaces the controller or the plant of the scenario. The run
        cannot be replayed.

    Attributes
    ----------
    initial_scenario : ResolvedScenario
        Scenario at tick 0; with the journal it describes the complete run.
    law_reference : str or None
        ``FILE.py:NAME`` of the law that was given at the start, if a file holds it.
    signals : tuple of Signal
        Columns of the telemetry; a change of law, friction or sensors may change them.
    journal : tuple of Change
        Changes by `set`.
    events : tuple of Change
        Changes by events of the scenario so far.
    tick : int
        Number of completed control ticks.
    loop_s : float
        Wall time of the loop alone, s.

    Raises
    ------
    InputError
        The model file, the torque curve, the law or a value of the scenario cannot be used.

    Notes
    -----
    One thread at a time can use a session: a call of a second thread during a call of the first is refused.
    """

    def __init__(
        self,
        scenario: Scenario,
        law: Law | None = None,
        trajectory: Sampled | None = None,
        *,
        files: Files | None = None,
        external: ExternalController | ExternalPlant | None = None,
    ) -> None:
        self._busy = threading.Lock()
        self._closed = False
        self.tick, self.loop_s = 0, 0.0
        self._external = external
        start = [] if external is None else [Change(0, EXTERNAL, name_of(external))]
        self.journal: tuple[Change, ...] = tuple(start)
        self.events: tuple[Change, ...] = ()
        self._status = Status.RUNNING
        own = law.for_a_run() if isinstance(law, Law) else law
        self._config = initial_config(scenario, own, trajectory, files)
        self._own_laws = UserLaws().with_law(own)
        self.initial_scenario = self.scenario
        self.law_reference = reference_of(law)
        self._planned = scheduled_changes(self.initial_scenario)
        self._inputs = self._input_generator()
        self._runtime = Runtime(self.scenario, self._config.files, self._config.law, None, external)
        self._logged = with_more({}, self.signals)
        self._config.check_changes(self._planned)
        self._apply_events()

    @property
    def actuator(self) -> Actuator:
        """Simulated actuator."""
        return self._config.files.actuator

    @property
    def scenario(self) -> ResolvedScenario:
        """Active scenario, with every default filled in from the model and the trajectory."""
        return self._config.scenario

    @property
    def status(self) -> Status:
        """Status of the run: ``running``, ``failsafe`` from the tick of a trip on, or the final status."""
        return Status.FAILSAFE if self.reason else self._status

    @property
    def ended(self) -> bool:
        """True if no further tick can be run; after a trip the rundown still runs."""
        return self._status != Status.RUNNING

    @property
    def reason(self) -> Reason:
        """Reason for which a watchdog or an overheated coil has switched off the currents, if so."""
        return self._runtime.reason

    @property
    def law_error(self) -> LawError | None:
        """Exception of the law, which ended the run."""
        return self._runtime.law_error

    @property
    def t_s(self) -> float:
        """Simulated time, s."""
        return self.tick * self.scenario.controller.period_s

    @property
    def q_rad(self) -> NDArray[np.float64]:
        """Present hinge angles, (3,) in rad."""
        return self._runtime.q_rad

    @property
    def qdot_rad_s(self) -> NDArray[np.float64]:
        """Present hinge rates, (3,) in rad/s."""
        return self._runtime.qdot_rad_s

    @property
    def signals(self) -> tuple[Signal, ...]:
        """Columns of the telemetry: common columns, columns of the stages, signals of the law."""
        return self._runtime.signals

    @property
    def law(self) -> Law:
        """Active law."""
        return self._runtime.law

    def compile(self) -> None:
        """Compile the loop of the active scenario; otherwise the next `advance` compiles it."""
        _ = self._runtime.loop

    def advance(self, ticks: int) -> Table:
        """Run control ticks.

        Parameters
        ----------
        ticks : int
            Largest number; fewer are run if the run ends or if an event of the scenario changes the columns.

        Returns
        -------
        Table
            One row for each tick.
        """
        if not isinstance(ticks, int | np.integer) or ticks < 0:
            raise InputError(f"session: expected a number of ticks from 0 on, received {shown(ticks)}")
        with self._alone():
            self._apply_events()
            log = allocated(int(ticks), self._runtime.row_width)
            return Table(self.signals, log[: self._advance(log)])

    def advance_into(self, log: NDArray[np.float64]) -> int:
        """Run a control tick for each row of an array of the caller; return the number of ticks.

        Raises
        ------
        InputError
            The rows of the array have another width than the telemetry.
        """
        with self._alone():
            self._apply_events()
            check_rows(log, self._runtime.row_width)
            return self._advance(log)

    def check_horizon(self, ticks: int) -> None:
        """Check that reference and disturbance are finite up to a future tick, or up to the next event.

        Raises
        ------
        InputError
            They are not finite.
        """
        next_event = [change.tick for change in self._pending()[:1]]
        self._inputs.check_horizon(max(min([ticks, *next_event]) - 1, self.tick))

    def set(self, name: str, value: Any, trial: Session | None = None) -> None:
        """Change a field of the scenario, or the law, from the next tick on.

        Defaults were filled in at the start and do not follow the change: the current limit of the allocation
        does not follow that of the drive.

        Parameters
        ----------
        name : str
            Dotted name, such as ``disturbance.load``; ``fault`` with a mapping adds a fault, which starts now
            unless it states a time.
        value : any
            Checked like a scenario; for ``controller.law`` also a `Law`. The same law with other gains keeps
            its memory if the size of the memory is the same.
        trial : Session, optional
            New session with the same change, which is not used otherwise: its law is taken, if it is that of
            the change, so that no code of the user runs now.

        Raises
        ------
        InputError
            The field is unknown or fixed for the run, or the value is out of range; nothing is changed.
        """
        with self._alone():
            if name == STATE:
                self._set_state(value)
            else:
                self._set_field(name, value, trial)

    def set_state(
        self,
        q_rad: ArrayLike | None = None,
        qdot_rad_s: ArrayLike | None = None,
        current_A: ArrayLike | None = None,
    ) -> None:
        """Set pose, rates and coil currents of the plant, from the next tick on.

        The change is an entry of the journal, as one of `set`, and is replayed. Controller, estimator, drive
        and friction keep their states.

        Parameters
        ----------
        q_rad, qdot_rad_s : (3,) array, optional
            Hinge angles and rates; default: unchanged.
        current_A : (n,) array, optional
            Of each group; default: unchanged.

        Raises
        ------
        InputError
            Another number of values, one that is not finite, or a pose beyond the workspace.
        """
        given = {"q_rad": q_rad, "qdot_rad_s": qdot_rad_s, "current_A": current_A}
        self.set(STATE, {name: _plain(values) for name, values in given.items() if values is not None})

    def snapshot(self) -> Snapshot:
        """Return the complete state of the session."""
        with self._alone():
            return Snapshot(
                self.scenario,
                self.initial_scenario,
                self._own_laws.key_of(self._config.user_law),
                scenario_files.digest(self._config.files),
                self.scenario.controller.source,
                self.tick,
                self._status,
                self._runtime.state(),
                self.journal,
                self.events,
            )

    def restore(self, snapshot: Snapshot) -> None:
        """Continue from a snapshot with the same bits as the session that it was taken from.

        Raises
        ------
        InputError
            It is not a snapshot, or it belongs to a user law that this session does not have or to another
            model.
        """
        with self._alone(), self._all_or_nothing():
            if not isinstance(snapshot, Snapshot):
                raise InputError(f"session: expected a snapshot of a session, received {shown(snapshot)}")
            user_law = self._own_laws.under(snapshot.user_law)
            if isinstance(snapshot.scenario.trajectory, UserPath) != bool(self._config.user_trajectory):
                raise InputError(
                    "session: expected a snapshot with the trajectory of this session,"
                    f" received one with {snapshot.scenario.trajectory.shape}"
                )
            self._restore(snapshot, user_law)

    def close(self) -> None:
        """End the session: later calls that advance, change, save or restore it are refused."""
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
        """Return warnings about model and scenario, one line each."""
        return warnings_of(self.scenario, self._config.files)

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
        """Restore the session if a change fails: a change replaces parts and does not alter them."""
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
                if done:  # return these rows first; the next call raises the error
                    break
                raise
            done += self._run(inputs, log[done : done + len(inputs.t)])
            before = self.signals
            try:
                self._apply_events()
            except SpheretwinError:  # the next call applies them again, and raises the error
                break
            if self.signals != before:
                break
        return done

    def _input_generator(self) -> InputGenerator:
        return InputGenerator(self.scenario, self._config.user_trajectory, len(self.actuator.groups))

    def _pending(self) -> tuple[Change, ...]:
        """Return the changes of the events that have not occurred yet."""
        return self._planned[len(self.events) :]

    def _most(self, ticks: int) -> int:
        """Return the number of ticks up to the next event, at most `ticks`."""
        return min([ticks, *(change.tick - self.tick for change in self._pending()[:1])])

    def _apply_events(self) -> None:
        """Apply the changes of all events that are due."""
        for change in self._pending():
            if change.tick > self.tick or self._status != Status.RUNNING:
                break
            with self._all_or_nothing():
                try:
                    self._change(change.name, change.value)
                except InputError as error:
                    raise InputError(f"{error}, as the event at {self.t_s:g} s sets it") from None
                self.events += (change,)

    def _run(self, inputs: loops.Inputs, log: NDArray[np.float64]) -> int:
        self.compile()
        started = time.perf_counter()
        try:
            ticks, code = self._runtime.run(inputs, log)
        except BaseException:  # an interruption of a law in plain Python: the tick is incomplete
            self._status = Status.DIVERGED
            raise
        self.loop_s += time.perf_counter() - started
        self.tick += ticks
        self._status = BY_CODE[code]
        return ticks

    def _set_field(self, name: str, value: Any, trial: Session | None) -> None:
        if not is_dotted(name):
            raise InputError(f"session: expected a field such as disturbance.load, received {shown(name)}")
        if is_fixed(name):
            raise InputError(f"session: expected a field that may change during a run, received {name}")
        if isinstance(value, Law) and name != "controller.law":
            raise InputError(f"session: expected a law for controller.law, received one for {name}")
        value = from_now_on(name, value, self.t_s)
        with self._all_or_nothing():
            self._change(name, value, trial)
        self.journal += (Change(self.tick, name, active_config.recorded_value(value)),)

    def _set_state(self, value: Any) -> None:
        try:
            change = StateChange.model_validate(value)
        except ValidationError as error:
            raise InputError(f"session: {explain(error, StateChange)}") from None
        groups = len(self.actuator.groups)
        if change.current_A is not None and len(change.current_A) != groups:
            raise InputError(
                f"session: expected current_A of {groups} groups, received {len(change.current_A)}"
            )
        if change.q_rad is not None:
            active_config.check_pose(change.q_rad, self.actuator)
        self._runtime.set_state(change)
        self.journal += (Change(self.tick, STATE, change.model_dump(mode="json", exclude_none=True)),)

    def _change(self, name: str, value: Any, trial: Session | None = None) -> None:
        before, self._config = self._config, self._config.with_change(name, value)
        scenario, user_law = self.scenario, self._config.user_law
        # Trajectory and disturbance are inputs: the runtime does not depend on them.
        inputs = {"trajectory": scenario.trajectory, "disturbance": scenario.disturbance}
        built = before._replace(scenario=before.scenario.model_copy(update=inputs))
        if built != self._config or user_law not in (None, self.law):
            self._runtime = self._runtime.transfer_to(
                scenario, self._config.files, user_law, trial._runtime if trial else None
            )
            self._logged = with_more(self._logged, self.signals)
        self._own_laws = self._own_laws.with_law(user_law)
        self._inputs.scenario = scenario  # last, because it is altered: a failure above changes nothing

    def _restore(self, snapshot: Snapshot, user_law: Law | None) -> None:
        files = scenario_files.reload_files(self._config.files, self.scenario, snapshot.scenario)
        snapshot.check_fits(files)
        self._config = self._config._replace(scenario=snapshot.scenario, files=files, user_law=user_law)
        self._runtime = Runtime(self.scenario, files, self._config.law, None, self._external)
        self._runtime.restore(snapshot.runtime)
        self._logged = with_more(self._logged, self.signals)
        self.initial_scenario = snapshot.initial_scenario
        self._planned = scheduled_changes(self.initial_scenario)
        self.tick, self._status = snapshot.tick, snapshot.status
        self.journal, self.events = snapshot.journal, snapshot.events
        self._inputs = self._input_generator()


def _plain(values: Any) -> Any:
    """Return an array as lists; anything else as it is, for the check."""
    array = real_array(values)
    return values if array is None else array.tolist()
