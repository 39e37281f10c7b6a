"""Driver of a bench's twin: its session, its mode and its settings. One thread uses it."""

from __future__ import annotations

import json
from typing import Any, NamedTuple

from spheretwin.bench import modes
from spheretwin.bench.command_queue import Current, Place, Text
from spheretwin.bench.modes import Limits
from spheretwin.models.base.arrays import Array
from spheretwin.models.base.errors import InputError, exception_text
from spheretwin.models.telemetry.run_record import RunRecord
from spheretwin.models.telemetry.table import Table
from spheretwin.records.provenance import record_of
from spheretwin.scenario.changes import FAULT, is_fixed, with_change
from spheretwin.scenario.fields import flat
from spheretwin.scenario.hardware import hardware_fields
from spheretwin.scenario.reading import override, validated
from spheretwin.scenario.sections import Scenario
from spheretwin.session import Session
from spheretwin.snapshot import Snapshot
from spheretwin.trajectories.rounding import Triple
from spheretwin.trajectories.trajectory import Shape

FIELDS_OF_MODES = ("trajectory.approach", "manual")
"""Fields that modes set."""


def with_field(settings: Scenario, name: str, value: Any) -> Scenario:
    """Return the settings with another value of one field, checked as a whole.

    A named set of hardware gives its fields their values, as in a file that does not state them; the fields
    of the set before get their defaults.

    Raises
    ------
    InputError
        A field that is unknown, of the wrong type or out of range, or one that a mode sets.
    """
    if any(name == own or name.startswith(f"{own}.") for own in FIELDS_OF_MODES):
        raise InputError(f"bench: expected a mode instead of {name}, as manual or hold")
    if name == "trajectory" and isinstance(value, dict) and value.get("approach") is not None:
        raise InputError("bench: expected a trajectory without approach, which the bench makes")
    after = with_change(settings, name, value)
    return after if name != "hardware" else _with_hardware(settings, after.hardware)


def _with_hardware(settings: Scenario, hardware: str) -> Scenario:
    fields = settings.model_dump(mode="json")
    fields["hardware"] = hardware
    untouched = flat(Scenario(trajectory=settings.trajectory).model_dump(mode="json"))
    knows_truth = settings.nominal.equals_truth
    plain = {dotted: untouched[dotted] for dotted in hardware_fields(settings.hardware, knows_truth)}
    for dotted, value in (plain | hardware_fields(hardware, knows_truth)).items():
        if dotted == "estimator.kind":  # another member of a family has other fields
            fields["estimator"] = {}
        override(fields, dotted, value)
    return validated(fields, settings.name)


CURRENTS = "manual.currents_A"

MOST_SNAPSHOTS = 16

HELD_s = 1.0
"""Time at rest after a STOP that holds, until the currents are off."""


class DriverSnapshot(NamedTuple):
    """Snapshot of a driver."""

    session: Snapshot
    settings: Scenario
    pending: dict[str, Any]
    mode: str
    row: Table | None
    record: RunRecord


def compiled_session(scenario: Scenario) -> Session:
    """Return a session whose first tick does not wait for the compiler.

    Raises
    ------
    InputError
        The scenario cannot be used, or has a file of currents, which no mode of the bench applies.
    """
    if scenario.manual.file is not None:
        raise InputError("bench: expected manual.currents_A or none, received manual.file")
    session = Session(scenario)
    session.compile()
    return session


def with_end_stops(scenario: Scenario) -> Scenario:
    """Return a scenario with end stops, unless it states whether it has them."""
    plant = scenario.plant
    if plant.end_stops.on is not None:
        return scenario
    stops = plant.end_stops.model_copy(update={"on": True})
    return scenario.model_copy(update={"plant": plant.model_copy(update={"end_stops": stops})})


class Trial(NamedTuple):
    """Settings with a changed field, and a session of them, both made outside the loop."""

    value: Any
    """New value of the field, with complete paths."""
    before: Scenario
    after: Scenario
    session: Session


class Driver:
    """Driver of one twin; every change stands in the journal of its session.

    Parameters
    ----------
    settings : Scenario
        To begin with.
    session : Session
        Session with these settings, at tick 0.

    Attributes
    ----------
    settings : Scenario
        Settings of the next reset; the modes are no part of them.
    pending : dict
        Fields of it that are not in force as yet.
    mode : str
    stopped : bool
        Whether STOP is latched.
    reason : str or None
        Reason why the run cannot continue.
    limits : Limits
        Limits of the approach from mode to mode.
    row : Table or None
        The last row.
    snapshots : dict
        Snapshots by name.
    """

    def __init__(self, settings: Scenario, session: Session) -> None:
        self.limits = Limits()
        self.snapshots: dict[str, DriverSnapshot] = {}
        self.begin(settings, session, record_of(session))

    def begin(self, settings: Scenario, session: Session, record: RunRecord) -> None:
        """Begin with a session at tick 0 and its record."""
        self.settings, self.session, self.start_record = settings, session, record
        self.pending: dict[str, Any] = {}
        self.stopped = False
        self._release_s: float | None = None
        self.reason: str | None = None
        self.row: Table | None = None
        by_hand = session.scenario.manual.currents_A
        self.mode = "trajectory" if by_hand is None else "manual" if any(by_hand) else "off"

    def advance(self, ticks: int) -> Table | None:
        """Run some control ticks; fewer if the columns change, none once the run has ended."""
        if self.reason is not None:
            return None
        if self._release_s is not None and self.session.t_s >= self._release_s:
            self.off()
        try:
            rows = self.session.advance(ticks)
        except Exception as error:  # a law of the user's may raise anything: the run ends
            self.fail(error)
            return None
        if self.session.law_error:
            self.reason = f"{self.session.law_error}"
        elif self.session.ended:
            why = f", {self.session.reason.text}" if self.session.reason else ""
            self.reason = f"{self.session.status}: {self.session.status.text}{why}"
        if len(rows):
            self.row = rows.rows(len(rows) - 1, len(rows))
        return rows

    def fail(self, error: Exception) -> None:
        """End the run by an error."""
        self.reason = exception_text(error)

    def stall(self, what: str) -> None:
        """End the run, from another thread: work of the loop does not return."""
        self.stopped = True
        self.reason = f"LOOP STALLED: {what} has not returned in time"

    def stop(self, mode: str = "off") -> None:
        """Latch STOP until the next reset: currents off, or hold and then off; a second STOP: off at once."""
        again, self.stopped = self.stopped, True
        if self.reason is not None or (again and self.mode == "off"):
            return
        if mode == "hold" and not again and self.mode != "off":
            try:
                self.hold()
            except InputError:  # a trajectory of the user's gives no motion to begin with
                self.off()
        else:
            self.off()

    def off(self) -> None:
        """Switch the currents off; the rotor is free."""
        self._set_currents("off", [0.0] * len(self.session.actuator.groups))

    def manual(
        self,
        currents_A: tuple[Current, ...] | None = None,
        group: Place | None = None,
        current_A: Current = 1.0,
    ) -> None:
        """Apply stated currents, or the current of a single group."""
        groups = len(self.session.actuator.groups)
        if (currents_A is None) == (group is None):
            raise InputError("bench: manual: expected either currents_A or group, received both or none")
        if group is not None and group >= groups:
            raise InputError(f"bench: manual: expected a group from 0 to {groups - 1}, received {group}")
        one_group = [current_A if other == group else 0.0 for other in range(groups)]
        self._set_currents("manual", one_group if currents_A is None else list(currents_A))

    def hold(self) -> None:
        """Come to rest at the present pose; after STOP, switch the currents off then."""
        initial_motion = modes.current_motion(self.session)
        self._approach("hold", modes.hold_shape(initial_motion, self.limits, self._range))
        if self.stopped:
            approach = self.session.scenario.trajectory.approach
            self._release_s = self.session.t_s + (approach.lasts_s if approach else 0.0) + HELD_s

    def point(self, pose_rad: Triple) -> None:
        """Approach a pose and rest there."""
        self._approach("point", modes.point_shape(pose_rad, self._range))

    def jog(self, rates_rad_s: Triple) -> None:
        """Turn at steady rates."""
        initial_motion = modes.current_motion(self.session)
        self._approach("jog", modes.jog_shape(initial_motion, rates_rad_s, self.limits, self._range))

    def trajectory(self, fields: dict[str, Any] | None, trial: Trial | None = None) -> None:
        """Follow a shape from its beginning; default: the last one."""
        after = self.settings
        if fields is not None:
            after = self._after("trajectory", trial.value if trial else fields, trial)
        self._approach("trajectory", after.trajectory)
        self.settings = after

    def set(self, name: str, value: Any, trial: Trial | None = None) -> None:
        """Change a field: from the next tick on, or at the next reset where it is fixed for a run.

        Parameters
        ----------
        name : str
        value : any
            As JSON has it.
        trial : Trial, optional
            The same change, made before; its value replaces `value`.

        Raises
        ------
        InputError
            A field that is unknown, of the wrong type or out of range, or one that a mode sets.
        """
        if trial:
            value = trial.value
        after = self._after(name, value, trial)
        if self.reason is not None or is_fixed(name):
            self.pending[name] = value
        elif name.split(".")[0] == "trajectory":
            self._change_shape(name, after.trajectory)
        else:
            self.session.set(name, value, trial.session if trial else None)
        self.settings = after

    def clear_faults(self, place: Place | None = None, target: Text | None = None) -> None:
        """Clear all faults, one by its place, or those of a target."""
        planned = self.settings.model_dump(mode="json")[FAULT]
        if place is not None and place >= len(planned):
            raise InputError(f"bench: expected the place of a fault below {len(planned)}, received {place}")
        after = with_field(self.settings, FAULT, _without(planned, place, target))
        if self.reason is None:
            active = self.session.scenario.model_dump(mode="json")[FAULT]
            self.session.set(FAULT, _without(active, place, target))
        self.settings = after

    def snapshot(self, name: Text = "last") -> None:
        """Save the complete state of the twin."""
        if name not in self.snapshots and len(self.snapshots) >= MOST_SNAPSHOTS:
            raise InputError(f"bench: expected at most {MOST_SNAPSHOTS} snapshots, received one more")
        if self.reason is not None:
            raise InputError("bench: expected a run in progress, received one that has ended")
        state = self.session.snapshot()
        self.snapshots[name] = DriverSnapshot(
            state, self.settings, dict(self.pending), self.mode, self.row, self.start_record
        )

    def restore(self, name: str) -> None:
        """Go back to a snapshot.

        Raises
        ------
        InputError
            The name is unknown, the snapshot is of another model, or STOP is latched.
        """
        if self.stopped:
            self.check_available("restore")
        if name not in self.snapshots:
            raise InputError(
                f"bench: expected one of {', '.join(self.snapshots) or 'no snapshots'}, received {name}"
            )
        snapshot = self.snapshots[name]
        self.session.restore(snapshot.session)
        self.start_record = snapshot.record
        self.settings, self.pending, self.mode = snapshot.settings, dict(snapshot.pending), snapshot.mode
        self.row, self.reason, self._release_s = snapshot.row, None, None

    @property
    def may_move_rotor(self) -> bool:
        """True if the coils may move the rotor, other than to hold it."""
        return not self.stopped and self.reason is None and self.mode not in ("off", "hold")

    def pending_as_json(self) -> tuple[tuple[str, str], ...]:
        """Fields that wait for a reset, and their values as JSON."""
        return tuple((name, json.dumps(value, ensure_ascii=False)) for name, value in self.pending.items())

    @property
    def _range(self) -> Array:
        return self.session.actuator.hinge_range_rad

    def check_available(self, name: str) -> None:
        """Check that a mode can be entered.

        Raises
        ------
        InputError
            STOP is latched, or the run has ended; the message names the command `name`.
        """
        if self.stopped:
            raise InputError(f"bench: expected reset after STOP, received {name}")
        if self.reason is not None:
            raise InputError(f"bench: expected reset, as the run has ended, received {name}")

    def _after(self, name: str, value: Any, trial: Trial | None) -> Scenario:
        """Return the settings with another value of one field: those of the trial, if it began with these."""
        if trial and trial.before is self.settings:
            return trial.after
        return with_field(self.settings, name, value)

    def _set_currents(self, mode: str, currents_A: list[float]) -> None:
        self.session.set(CURRENTS, currents_A)
        self.mode, self._release_s = mode, None

    def _approach(self, mode: str, shape: Shape, shape_s: float = 0.0) -> None:
        """Approach a shape, at a time of the shape, from the present motion."""
        session, initial_motion = self.session, modes.current_motion(self.session)
        approach = modes.approach_fields(
            shape, initial_motion, session.t_s, shape_s, self.limits, self._range
        )
        session.set("trajectory", {**shape.model_dump(mode="json"), "approach": approach})
        if session.scenario.manual.on:
            session.set(CURRENTS, None)
        self.mode = mode

    def _change_shape(self, name: str, shape: Shape) -> None:
        """Follow a shape with another field from where it is; another shape from its beginning."""
        if self.mode != "trajectory":
            return
        present = self.session.scenario.trajectory
        own_s = self.session.t_s
        if present.approach:
            own_s += present.approach.shape_s - present.approach.start_s
        same = type(shape) is type(present) and name != "trajectory"
        self._approach("trajectory", shape, own_s if same else 0.0)


def _without(planned: list[Any], place: int | None, target: str | None) -> list[Any]:
    if target is not None:
        return [fault for fault in planned if fault["target"] != target]
    return [] if place is None else [fault for i, fault in enumerate(planned) if i != place]
