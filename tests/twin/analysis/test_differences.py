"""Every number of a report minus that of the first run."""

import json

import pytest

from spheretwin import cli
from spheretwin.analysis.review import differences
from spheretwin.metrics import METRICS
from tests.twin.analysis.runs import written


def test_numbers_are_subtracted_one_by_one_and_nothing_else():
    first = {
        "path": "a",
        "x": 1.5,
        "each": [1.0, None, 3.0],
        "law": "pd",
        "seed": 1,
        "whole": True,
        "y": None,
    }
    other = {"path": "b", "x": 4.0, "each": [0.5, 2.0, 3.0], "law": "pid", "seed": 2, "whole": False, "y": 2}
    assert differences([first, other]) == [{"path": "b", "x": 2.5, "each": [-0.5, None, 0.0], "y": None}]
    assert differences([first]) == []


def test_a_list_that_one_lacks_has_no_difference():
    assert differences([{"path": "a", "e": None}, {"path": "b", "e": [1.0]}]) == [{"path": "b", "e": None}]


def test_json_has_the_difference_of_every_metric(tmp_path, capsys):
    first, _ = written(tmp_path, "first", duration=0.2)
    other, _ = written(tmp_path, "other", **{"duration": 0.2, "disturbance.load": 2.0})
    assert cli.main(["review", str(first), str(other), str(first), "--json"]) == 0
    report = json.loads(capsys.readouterr().out)
    to_other, to_itself = report["differences"]
    assert (to_other["path"], to_itself["path"]) == (str(other), str(first))
    a, b = report["runs"][:2]
    assert set(METRICS) | {"mechanical_work_J", "energy_J"} <= set(to_other)
    assert to_other["rms_torque_Nm"] == b["rms_torque_Nm"] - a["rms_torque_Nm"] != 0
    assert to_other["rms_error_rad"] == [
        y - x for x, y in zip(a["rms_error_rad"], b["rms_error_rad"], strict=True)
    ]
    for value in to_itself.values():
        assert value in (str(first), 0, None, [0, 0, 0], [None] * 3)


@pytest.mark.parametrize("count", [1, 2])
def test_there_is_one_less_than_runs(tmp_path, capsys, count):
    path, _ = written(tmp_path, duration=0.05)
    assert cli.main(["review", *[str(path)] * count, "--json"]) == 0
    assert len(json.loads(capsys.readouterr().out)["differences"]) == count - 1
