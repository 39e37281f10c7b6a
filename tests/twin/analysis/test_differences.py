"""Every number of a report minus that of the first run."""

from spheretwin.analysis.review import differences


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
