"""Results are those of the same objects, not of equal ones, and never of an object that is gone."""

from spheretwin.models.base.reuse import MOST_RESULTS, reused


class Section:
    def __init__(self, value):
        self.value = value


def counted():
    calls = []

    @reused
    def double(section):
        calls.append(section.value)
        return 2 * section.value

    return double, calls


def test_a_result_is_computed_once_for_an_object():
    double, calls = counted()
    section, equal = Section(1), Section(1)
    assert [double(section), double(section), double(equal)] == [2, 2, 2]
    assert calls == [1, 1]


def test_objects_that_are_gone_give_no_result():
    """Without its argument a stored result would be that of the next object at the same place in memory."""
    double, _ = counted()
    for value in range(3 * MOST_RESULTS):
        assert double(Section(value)) == 2 * value
