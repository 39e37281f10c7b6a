"""Labels of runs in a legend: only the differing fields."""

from spheretwin.analysis.comparison import differing_fields

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


def test_runs_of_one_scenario_differ_in_nothing():
    assert differing_fields([SCENARIO, SCENARIO]) == [[], []]


def test_what_the_paper_varies_has_its_names_and_comes_first():
    told = differing_fields(
        [SCENARIO, but(plant={"modelling_error": 0.0, "payload_kg": 0.1}, disturbance={"load": 2.0})]
    )
    assert told == [["m 0.2", "L 0", "plant.payload_kg 0.05"], ["m 0", "L 2", "plant.payload_kg 0.1"]]


def test_gains_are_labels_for_runs_of_one_law_only():
    other = but(controller={"stiffness": [3.0, 2.0]})
    assert differing_fields([SCENARIO, other])[1] == ["controller.stiffness [3.0, 2.0]"]
    assert differing_fields([SCENARIO, but(controller={"law": "pid", "kp": 1.0})]) == [[], []]


def test_fields_implied_by_the_hardware_are_not_listed():
    other = but(hardware="prototype", sensors={"adc": {"bits": 12}})
    assert differing_fields([SCENARIO, other]) == [["hardware ideal"], ["hardware prototype"]]


def test_a_field_that_one_lacks_is_none_there():
    assert differing_fields([SCENARIO, {**SCENARIO, "watch": 1}]) == [["watch none"], ["watch 1"]]


def test_faults_in_labels_have_their_targets():
    faults = [{"target": "coil.07", "mode": "open", "start_s": 1.0}, {"target": "group.3", "mode": "stuck"}]
    assert differing_fields([{**SCENARIO, "fault": faults}, {**SCENARIO, "fault": []}]) == [
        ["fault coil.07 ope…roup.3 stuck"],
        ["fault none"],
    ]
