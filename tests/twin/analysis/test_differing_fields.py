"""Fields in which scenarios differ, with their values; conditions on which they agree."""

from dataclasses import replace

import pytest

from spheretwin.analysis.comparison import labels
from spheretwin.analysis.review import common_conditions, scenario_differences
from tests.twin.analysis.runs import made_of, named

SCENARIO = {
    "name": "tilt",
    "hardware": "ideal",
    "plant": {"modelling_error": 0.2, "payload_kg": 0.05},
    "disturbance": {"load": 0.0},
    "controller": {"law": "pd", "stiffness": [1.0, 2.0]},
    "sensors": {"adc": {"bits": 16}},
}


def but(**sections):
    return {
        name: {**value, **sections[name]} if isinstance(value, dict) and name in sections
        else sections.get(name, value)
        for name, value in SCENARIO.items()
    }  # fmt: skip


FAULTS = [{"target": "coil.07", "mode": "open", "start_s": 1.0}, {"target": "group.3", "mode": "stuck"}]


@pytest.mark.parametrize(
    ("first", "other", "expected"),
    [
        (SCENARIO, SCENARIO, []),
        # Variations of the paper have its names and come first.
        (
            SCENARIO,
            but(plant={"modelling_error": 0.0, "payload_kg": 0.1}, disturbance={"load": 2.0}),
            [("m", ["0.2", "0"]), ("L", ["0", "2"]), ("plant.payload_kg", ["0.05", "0.1"])],
        ),
        # Gains are listed for runs of one law only.
        (
            SCENARIO,
            but(controller={"stiffness": [3.0, 2.0]}),
            [("controller.stiffness", ["[1.0, 2.0]", "[3.0, 2.0]"])],
        ),
        (SCENARIO, but(controller={"law": "pid", "kp": 1.0}), [("law", ["pd", "pid"])]),
        # Fields that the hardware implies are not listed.
        (
            SCENARIO,
            but(hardware="electronics", sensors={"adc": {"bits": 12}}),
            [("hardware", ["ideal", "electronics"])],
        ),
        (SCENARIO, {**SCENARIO, "watch": 1}, [("watch", ["none", "1"])]),
        ({"fault": FAULTS}, {"fault": []}, [("fault", ["coil.07 open + group.3 stuck", "none"])]),
    ],
)
def test_fields_that_differ_are_listed_with_their_values(first, other, expected):
    assert scenario_differences([first, other]) == expected


def test_common_conditions_are_those_of_every_scenario():
    assert common_conditions([SCENARIO]) == "scenario tilt, L 0, m 0.2, hardware ideal"
    other = but(disturbance={"load": 2.0}, hardware="electronics")
    assert common_conditions([SCENARIO, other]) == "scenario tilt, m 0.2"
    assert common_conditions([{"name": "a"}, {"name": "b"}]) == ""


def test_fields_implied_by_name_and_modelling_error_are_not_listed():
    own = {"description": "a", "duration": 1.0, "trajectory": {"shape": "hold"}}
    other = {"description": "b", "duration": 2.0, "trajectory": {"shape": "sine"}}
    assert scenario_differences([{"name": "x", **own}, {"name": "y", **other}]) == [("scenario", ["x", "y"])]
    assert scenario_differences([{"name": "x", **own}, {"name": "x", **other}]) == [
        ("description", ["a", "b"]),
        ("duration", ["1", "2"]),
        ("trajectory.shape", ["hold", "sine"]),
    ]
    plants = [{"plant": {"modelling_error": m, "modelling_torque_Nm": m}} for m in (0.0, 0.2)]
    assert scenario_differences(plants) == [("m", ["0", "0.2"])]


def test_values_have_all_digits_and_words_as_they_are():
    values = [0.100000001, 1e-7, 3.0, True, None, "pd", [], [1, 2]]
    texts = ["0.100000001", "1e-07", "3", "true", "null", "pd", "none", "[1, 2]"]
    pairs = [scenario_differences([{"x": value}, {"x": "other"}]) for value in values]
    assert pairs == [[("x", [text, "other"])] for text in texts]


def test_labels_name_a_law_in_a_file_by_file_and_class(tmp_path):
    run = made_of([[0.0, 0.0]])
    runs = [
        replace(
            named(run, tmp_path / f"{name}.parquet"),
            record=replace(run.record, scenario=but(controller={"law": law})),
        )
        for name, law in (
            ("pd", "pd"), ("first", "./laws/mine.py:Mine"), ("second", f"{tmp_path}/new/mine.py:Mine"),
        )
    ]  # fmt: skip
    assert labels(runs) == ["1 pd", "2 first: laws/mine.py:Mine", "3 second: new/mine.py:Mine"]
    assert labels(runs[:2])[1] == "2 first: mine.py:Mine"
