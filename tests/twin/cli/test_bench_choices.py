"""What a bench's page offers: each field as the command line has it, and what it may be."""

import json

import pytest

from spheretwin import scenario as scenarios
from spheretwin.bench import Bench
from spheretwin.cli.bench import read, settings_of, shape_settings
from spheretwin.models.base.errors import InputError
from spheretwin.scenario.reading import described_fields, shipped, value_text
from tests.control.test_user_law import FILE


@pytest.mark.parametrize("name", shipped())
@pytest.mark.parametrize("hardware", ["ideal", "electronics"])
def test_what_is_shown_of_a_field_is_read_as_what_it_is(name, hardware):
    scenario = scenarios.load(name, {"hardware": hardware})
    known = {dotted: value for dotted, value, _ in described_fields(scenario)}
    for each in settings_of(described_fields(scenario)):
        if each.name in ("name", "description"):  # words, which no form has
            continue
        value = json.loads(json.dumps(known[each.name]))
        if value not in ("", []):
            assert read(each.name, each.text) == value, each.name
        assert not each.choices or each.text in ("", *each.choices)


def test_the_gains_are_those_of_the_law_that_is_in_force():
    scenario = scenarios.load("hold", {"controller.law": "pid", "controller.integral": 3.0})
    results = {each.name: each for each in settings_of(described_fields(scenario))}
    assert "controller.surface_slope" not in results
    integral = results["controller.integral"]
    assert integral.text == "3 3 3" != integral.default


def test_a_name_of_any_alphabet_is_shown_as_it_is():
    assert value_text(({"file": "Wärme.csv"},)) == '[{"file": "Wärme.csv"}]'


def test_text_is_read_as_by_the_command_line():
    assert read("controller.stiffness", "1 2.5 -3") == [1, 2.5, -3]
    assert read("fault.0.reported_to_controller", "true") is True
    assert read("plant.mjcf", "'a file.xml'") == "a file.xml"
    assert read("trajectory.points", "[[0, 1], [2, 3]]") == [[0, 1], [2, 3]]
    assert read("plant.mjcf", "  ") is None


@pytest.mark.parametrize("text", ["'open", "--plant.step-s 1", "1 --x 2"])
def test_what_is_no_value_is_refused(text):
    with pytest.raises(InputError, match=r"^plant\.step_s: expected a value, received "):
        read("plant.step_s", text)


def test_the_present_shape_is_offered_as_it_is():
    scenario = scenarios.load(
        "sinusoid", {"trajectory.amplitude_rad": [0.1, 0.1, 0.1 / 3], "plant.engine": "lagrangian"}
    )
    with Bench(scenario) as bench:
        present = {each.name: each for each in shape_settings("sinusoid", bench)}
        assert present["amplitude_rad"].text == f"0.1 0.1 {0.1 / 3!r}"
        assert present["amplitude_rad"].default == "0.2 0.2 0.2"


def test_a_shape_with_a_list_of_tables_is_offered_as_it_is():
    rows = [
        {"amplitude_rad": [0.1, 0.1, 0.1], "frequency_Hz": [0.5, 0.5, 0.5]},
        {"amplitude_rad": [0.05, 0.0, 0.0], "frequency_Hz": [1.5, 1.5, 1.5]},
    ]
    given = {"trajectory": {"shape": "multisine", "components": rows}, "plant.engine": "lagrangian"}
    with Bench(scenarios.load("sinusoid", given)) as bench:
        (components,) = [each for each in shape_settings("multisine", bench) if each.name == "components"]
        before = bench.fields()
        assert bench.command(
            "trajectory", fields={"shape": "multisine", "components": read("x", components.text)}
        )
        bench.advance(0)
        assert bench.state().refused is None
        at = "trajectory.components."
        assert [each for each in bench.fields() if each[0].startswith(at)] == [
            each for each in before if each[0].startswith(at)
        ]


def test_a_law_of_a_persons_own_is_offered_with_its_own_bounds_and_defaults(tmp_path):
    """A gain of the same name as a shipped law's has its own meaning, bounds and default."""
    (tmp_path / "mine.py").write_text(FILE)
    law = f"{tmp_path / 'mine.py'}:Feedback"
    with Bench(scenarios.load("hold", {"plant.engine": "lagrangian", "controller.law": law})) as bench:
        results = {each.name: each for each in settings_of(bench.fields())}
    assert results["controller.law"].text == law
    stiffness = results["controller.stiffness"]
    assert (stiffness.text, stiffness.default) == ("0.5 0.5 0.5", "0.5 0.5 0.5")
    assert stiffness.meaning == "of the error, N·m, > 0, ≤ 1e+09"
