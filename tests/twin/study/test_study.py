"""Studies from TOML: what cannot be run is told in one line before the first row."""

import pytest

from spheretwin.models.base.errors import InputError
from spheretwin.study import runner
from spheretwin.study.grid import Grid
from spheretwin.study.row import Rows
from spheretwin.study.runner import run
from spheretwin.study.study import load, shipped
from tests.twin.study.cases import LOADS, run_rows, study, values

PD = [{"law": "pd"}]


def test_studies_ship_and_each_has_the_rows_that_it_says():
    rows = {
        "compensators": 720,
        "delays": 320,
        "estimators": 60,
        "mismatch": 800,
        "paper": 108,
        "rivals_electronics": 20,
        "rivals_ideal": 20,
        "robustness": 10_000,
        "sensors": 480,
        "tuning": 50,
    }
    assert shipped() == list(rows)
    studies = {name: load(name) for name in shipped()}
    assert {name: len(Grid(chosen)) for name, chosen in studies.items()} == rows
    assert [law["law"] for law in studies["paper"].law] == ["pd", "adaptive_fuzzy", "afsm"]
    assert studies["robustness"].fields["duration"] == 1.0
    for chosen in studies.values():
        runner.check(Grid(chosen), Rows(chosen))


def refusal(action):
    with pytest.raises(InputError) as refused:
        action()
    assert "\n" not in str(refused.value)
    return str(refused.value)


@pytest.mark.parametrize(
    ("axes", "others", "message"),
    [
        (
            [values("disturbance.laod", 1.0)],
            {},
            "received 'disturbance.laod'; did you mean disturbance.load?",
        ),
        (
            [values("fault.0.known", True)],
            {},
            "received 'fault.0.known', the former name of fault.0.reported_to_controller",
        ),
        ([values("plant.modelling_error.3", 1.0)], {}, "expected a section before the dot"),
        ([values("plant.coulomb_Nm.9", 1.0)], {}, "expected a list index from 0 to 3"),
        ([values("plant", 1.0)], {}, "plant: expected a table of fields"),
        ([values("disturbance.load", "1.0", "2")], {}, "expected a number, received '1.0'"),
        ([values("seed", 1)], {}, "expected seeds instead of an axis over seed"),
        ([values("controller.law", "pd")], {}, "expected [[law]] instead of an axis over controller.law"),
        ([LOADS[0], LOADS[0]], {}, "expected one axis for a field, received disturbance.load twice"),
        ([LOADS[1]], {}, "expected samples, as plant.modelling_error is drawn"),
        ([LOADS[0]], {"samples": 3}, "expected an axis that is drawn for samples, received 3"),
        ([LOADS[0]], {"fields": {"disturbance.load": 1.0}}, "among the fields or as an axis, received both"),
        ([values("disturbance.load", 1.0, zip="a")], {}, "expected two axes or more of a zip"),
        ([], {"fields": {"seed": 1}}, "expected seed and seeds of the study"),
        ([], {"fields": {"": 1}}, "expected a field such as controller.law"),
        ([], {"fields": {"duration": "long"}}, "duration: expected a number"),
        ([], {"law": PD, "fields": {"controller.stiffness": [1.0]}}, "in each [[law]], received it among"),
        ([], {"law": PD * 2}, "expected each [[law]] once, received {'law': 'pd'} twice"),
        ([], {"law": [{"gain": 1.0}]}, "expected law in each [[law]]"),
        ([], {"law": [{"law": "pdd"}]}, "received 'pdd'; did you mean pd?"),
        ([], {"law": [{"law": "pd", "wobble": 1.0}]}, "in controller, received wobble"),
        (
            [],
            {"law": [*PD, {"law": "afsm", "wobble": 1.0}]},
            "expected rows under 'afsm' that make a scenario",
        ),
        ([], {"law": [{"law": "nothing.py:step"}]}, "nothing.py"),
        ([], {"metrics": ["rms"]}, "or FILE.py:NAME, received 'rms'"),
        ([], {"metrics": ["rms_error_rad", "rms_error_rad"]}, "figures of different names"),
        (
            [],
            {"metrics": ["a.py:one", "b.py:one"]},
            "expected figures of different names, received one twice",
        ),
        ([], {"metrics": ["nothing.py:one"]}, "expected a readable file of Python"),
        ([], {"telemetry": [1]}, "expected rows up to 0 for telemetry, received 1"),
        ([], {"design": "grid"}, "design: expected"),
        ([], {"seeds": 0}, "seeds: expected a number greater than or equal to 1"),
        ([], {"scenario": "sinsoid"}, "did you mean sinusoid?"),
        ([], {"name": "../up"}, "expected a name that a folder can have, received '../up'"),
        ([], {"name": ""}, "name: expected"),
        ([], {"colour": "red"}, "colour"),
    ],
)
def test_what_cannot_be_run_is_refused_before_the_first_row(tmp_path, axes, others, message):
    assert message in refusal(lambda: run(study(*axes, **others), tmp_path))
    assert not (tmp_path / "journal.jsonl").exists()


def test_a_figure_may_not_have_the_name_of_a_column(tmp_path):
    (tmp_path / "mine.py").write_text("def key(run): return 1\n")
    chosen = study(metrics=[f"{tmp_path}/mine.py:key"])
    assert "expected columns of different names, received key twice" in refusal(lambda: run(chosen, tmp_path))


def test_some_values_out_of_range_are_rows_all_of_them_are_a_refusal(tmp_path):
    assert len(run_rows(study(values("plant.payload_kg", -1.0, 0.0)), tmp_path / "a")) == 2
    chosen = study(values("plant.payload_kg", -1.0, -2.0))
    assert "received none among 2; the first: scenario" in refusal(lambda: run(chosen, tmp_path / "b"))


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("name = ", "expected valid TOML"),
        ("", "name: expected"),
        ('name = "a"\nscenario = "sinusoid"\naxis = 3\n', "axis: expected"),
        ('name = "a"\nscenario = "nothing.toml"\n', "expected a readable TOML file"),
        ("a" * 10 + "[" * 2000, "expected valid TOML"),
    ],
)
def test_files_that_are_no_study_are_refused(tmp_path, text, message):
    path = tmp_path / "study.toml"
    path.write_text(text)
    assert message in refusal(lambda: run(str(path), tmp_path / "out"))


@pytest.mark.parametrize("source", ["papr", "nothing.toml", "nothing", "a\0.toml"])
def test_names_that_are_no_study_are_refused(source):
    assert "expected" in refusal(lambda: load(source))
