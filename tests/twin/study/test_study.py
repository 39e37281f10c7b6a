"""Studies from TOML: what cannot be run is refused in one line before the first row."""

import pytest

from spheretwin.models.base.errors import InputError
from spheretwin.study import runner
from spheretwin.study.grid import Grid
from spheretwin.study.row import Rows
from spheretwin.study.runner import run
from spheretwin.study.study import load, shipped
from tests.twin.study.cases import LOADS, study, values

PD = [{"law": "pd"}]
LOAD = "disturbance.load"


@pytest.mark.parametrize("name", shipped())
def test_shipped_studies_can_be_run(name):
    chosen = load(name)
    runner.check(Grid(chosen), Rows(chosen))


def refusal(action):
    with pytest.raises(InputError) as refused:
        action()
    assert "\n" not in str(refused.value)
    return str(refused.value)


def axis(kind, samples=None, **fields):
    return [{"field": LOAD, "kind": kind, **fields}], {"samples": samples}


AXES = {
    "expected one of values, linspace, logspace, uniform, normal": axis("gauss"),
    "axis.0.count: expected a number less": axis("linspace", first=0, last=1, count=10**9),
    "axis.0.deviation: expected a number greater than 0": axis("normal", 3, mean=0, deviation=0),
    "expected no zip of what is drawn": axis("uniform", 3, low=0, high=1, zip="a"),
    "expected different values of disturbance.load, received 1": ([values(LOAD, 1.0, 1)], {}),
    "expected different values": axis("linspace", first=1, last=1, count=2),
    "of equal length, received 2 of disturbance.load, 1 of plant.modelling_error": (
        [values(LOAD, 1.0, 2.0, zip="a"), values("plant.modelling_error", 0.1, zip="a")],
        {},
    ),
    "expected two axes or more of a zip": ([values(LOAD, 1.0, zip="a")], {}),
    "received 'disturbance.laod'; did you mean disturbance.load?": ([values("disturbance.laod", 1.0)], {}),
    "expected a section before the dot": ([values("plant.modelling_error.3", 1.0)], {}),
    "expected a number, received '1.0'": ([values(LOAD, "1.0", "2")], {}),
    "among the fields or as an axis, received both": ([LOADS[0]], {"fields": {LOAD: 1.0}}),
    "received none among 2; the first: scenario": ([values("plant.payload_kg", -1.0, -2.0)], {}),
}
OTHERS = {
    "expected seed and seeds of the study": {"fields": {"seed": 1}},
    "expected a field such as controller.law": {"fields": {"": 1}},
    "in each [[law]], received it among": {"law": PD, "fields": {"controller.stiffness": [1.0]}},
    "received 'pdd'; did you mean pd?": {"law": [{"law": "pdd"}]},
    "in controller, received wobble": {"law": [{"law": "pd", "wobble": 1.0}]},
    "expected rows under 'afsm' that make a scenario": {"law": [*PD, {"law": "afsm", "wobble": 1.0}]},
    "nothing.py": {"law": [{"law": "nothing.py:step"}]},
    "expected figures of different names, received rms_error_rad": {"metrics": ["rms_error_rad"] * 2},
    "expected figures of different names, received one twice": {"metrics": ["a.py:one", "b.py:one"]},
    "expected a readable file of Python": {"metrics": ["nothing.py:one"]},
    "expected columns of different names, received key twice": {"metrics": ["mine.py:key"]},
    "expected rows up to 0 for telemetry, received 1": {"telemetry": [1]},
    "did you mean sinusoid?": {"scenario": "sinsoid"},
}
REFUSED = AXES | {message: ([], others) for message, others in OTHERS.items()}


@pytest.mark.parametrize("message", REFUSED)
def test_what_cannot_be_run_is_refused_before_the_first_row(tmp_path, message):
    (tmp_path / "mine.py").write_text("def key(run): return 1\n")
    axes, others = REFUSED[message]
    assert message in refusal(lambda: run(study(*axes, folder=str(tmp_path), **others), tmp_path))
    assert not (tmp_path / "journal.jsonl").exists()


NO_STUDIES = {
    "name = ": "expected valid TOML",
    "": "name: expected",
    'name = "a"\nscenario = "sinusoid"\naxis = 3\n': "axis: expected",
    'name = "a"\nscenario = "nothing.toml"\n': "expected a readable TOML file",
    "a" * 10 + "[" * 2000: "expected valid TOML",
}


@pytest.mark.parametrize(("text", "message"), NO_STUDIES.items(), ids=range(len(NO_STUDIES)))
def test_files_that_are_no_study_are_refused(tmp_path, text, message):
    path = tmp_path / "study.toml"
    path.write_text(text)
    assert message in refusal(lambda: run(str(path), tmp_path / "out"))
    assert "expected" in refusal(lambda: load(f"{tmp_path}/a\0.toml"))
