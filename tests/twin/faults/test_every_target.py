"""What every kind of part that can fail owes: its modes and no others, in their ranges.

What each mode does is held against a copy in tests/twin/electronics/test_prototype.py.
"""

import numpy as np
import pytest

from spheretwin import scenario as scenarios
from spheretwin.faults.fault import MODES
from spheretwin.faults.targets import TARGETS
from spheretwin.models.base.errors import InputError
from spheretwin.session import Session

GROUPS = 18
EACH = pytest.mark.parametrize("name", list(TARGETS))


def planned(*faults, **changes):
    return scenarios.load("nutation", {"hardware": "electronics", "fault": list(faults), **changes})


def fault(name, mode, **more):
    """One of the last part of a kind, with a value where the mode needs one."""
    value = TARGETS[name].modes[mode].value if mode in TARGETS[name].modes else None
    needed = {"value": max(value.least, min(value.largest, 0.01))} if value and value.default is None else {}
    return {"target": TARGETS[name].names(GROUPS)[-1], "mode": mode, **needed, **more}


def refused(*faults):
    with pytest.raises(InputError) as refusal:
        planned(*faults)
    message = str(refusal.value)
    assert "\n" not in message
    return message


@EACH
def test_its_modes_are_taken_and_all_others_refused_by_name(name):
    for mode in MODES:
        if mode in TARGETS[name].modes:
            assert planned(fault(name, mode)).fault[0].mode == mode
        else:
            message = refused(fault(name, mode))
            assert f"expected one of {', '.join(TARGETS[name].modes)} for {name}" in message
            assert f"received mode {mode}" in message
    assert "mode" in refused({**fault(name, MODES[0]), "mode": "bored"})


@EACH
def test_values_are_those_of_the_mode(name):
    for mode, what in TARGETS[name].modes.items():
        if what.value is None:
            assert f"expected no value for {mode}" in refused(fault(name, mode, value=1.0))
            continue
        least, largest, meaning = what.value.least, what.value.largest, what.value.meaning
        if mode != "delay":  # which must be whole periods besides
            for value in (least, largest, np.nextafter((least + largest) / 2, largest)):
                assert planned(fault(name, mode, value=float(value))).fault[0].effective_value == value
        for value in (np.nextafter(least, -np.inf), np.nextafter(largest, np.inf), -1e300, 1e300):
            message = refused(fault(name, mode, value=float(value)))
            assert f"expected a value from {least:g} to {largest:g} for {mode}" in message
            assert meaning in message
        for value in (np.nan, np.inf, -np.inf, "much"):
            refused(fault(name, mode, value=value))
        without = {key: given for key, given in fault(name, mode).items() if key != "value"}
        if what.value.default is None:
            assert "received none" in refused(without)
        else:
            assert planned(without).fault[0].effective_value == what.value.default


@EACH
def test_no_time_before_it_and_no_end_before_its_start(name):
    mode = next(iter(TARGETS[name].modes))
    for times in ({"start_s": -1e-9}, {"end_s": -1.0}, {"start_s": np.nan}, {"start_s": 1.0, "end_s": 1.0}):
        refused(fault(name, mode, **times))


@EACH
def test_only_of_groups_may_the_controller_know_and_only_of_those_that_there_are(name):
    mode, target = next(iter(TARGETS[name].modes)), TARGETS[name]
    for field in ("reported_to_controller", "detection"):
        if target.each_group:
            planned(fault(name, mode, **{field: True}))
        else:
            assert f"expected {field} for a fault of" in refused(fault(name, mode, **{field: True}))
    none_such = [f"{name}.nowhere", f"{name}.", f"{name}.-1", f"{name} ", f"{name}.1.2"]
    none_such += [name] if target.each_group or target.places else [f"{name}.0"]
    for part in none_such:
        assert "target" in refused({**fault(name, mode), "target": part})
    if target.each_group:
        with pytest.raises(InputError, match="expected a fault of a group from 0 to 17"):
            Session(planned({**fault(name, mode), "target": f"{name}.18"}))


@EACH
def test_without_a_supply_it_is_refused_where_it_needs_one(name):
    mode = next(iter(TARGETS[name].modes))
    given = {"hardware": "ideal"}
    if TARGETS[name].needs_supply:
        with pytest.raises(InputError, match=r"fault\.0: expected drive\.supply_V"):
            planned(fault(name, mode), **given)
    else:
        planned(fault(name, mode), **given)


def test_faults_of_shipped_sensors_alone_change_what_the_controller_measures():
    """The flag decides whether the controller receives the true angles."""
    kinds = {name: planned(fault(name, next(iter(TARGETS[name].modes)))).fault[0].kind for name in TARGETS}
    assert {name for name, kind in kinds.items() if kind.measured} == {"pot", "encoder", "adc"}
