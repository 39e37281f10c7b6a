"""No message about an input holds words of Python or of the library that checks it."""

import re

import numpy as np
import pytest

from spheretwin import scenario as scenarios
from spheretwin.analysis import tolerances
from spheretwin.models.base.errors import InputError, shown
from spheretwin.scenario import reading
from spheretwin.scenario.fields import every_field
from spheretwin.scenario.sections import Scenario
from spheretwin.study import study as studies
from spheretwin.study.optimise import Optimise

# Names of types count where they stand alone: "string" of a text that a user gave must not be counted.
FORBIDDEN = re.compile(
    r"pydantic|Input should|Value error|Extra inputs|Field required|Traceback|\[type=|Errno|discriminator"
    r"|\b(?:str|dict|tuple|Tuple|Dictionary|NoneType|None|float|int|bool|True|False|boolean|array|object"
    r"|validation|validator|repr|TypeError|ValueError|KeyError|codec)\b"
)

NAMES = sorted({name.replace("#", "0") for name, _ in every_field(Scenario)})

VALUES = [
    None, True, False, 3, -1, 1.5, -1e300, float("nan"), float("inf"), 10**400, "x", "", "12", "x" * 200,
    [], [1], [1, 2, 3, 4], ["a", "b", "c"], [[1]], [None], [{}], {}, {"a": 1}, {"kind": "x"},
    [{"kind": 3}], {"shape": 1},
]  # fmt: skip


def message(call, *arguments):
    """Return the message of a refusal; None if the input is accepted."""
    try:
        call(*arguments)
    except InputError as error:
        return str(error)
    return None


def test_the_list_of_words_finds_what_it_must():
    for text in ("received None", "Input should be", "a dict,", "[type=missing", "NoneType", "valid boolean"):
        assert FORBIDDEN.search(text)
    assert not FORBIDDEN.search("expected a number, received 'string' for controller.integral_rate")


def check(messages, least):
    """Check that there are enough messages, and none with a forbidden word."""
    assert len(messages) > least
    for line in messages - {None}:
        assert not FORBIDDEN.search(line), line
        assert not line.isspace()


@pytest.mark.parametrize("value", ["null", "true", "x", "[]", '{"a": 1}', "1.5", "nan", "9" * 5000, "-1e300"])
def test_flags(value):
    def load(name):
        return scenarios.load("hold", reading.overrides([f"--{name}", value]))

    check({message(load, name) for name in NAMES}, 0)


def test_studies():
    def sections(value):
        for name in studies.Study.model_fields:
            yield {name: value}
        for name in Optimise.model_fields:
            yield {"optimise": {name: value}}
        for name in ("field", "kind", "zip", "values", "low", "high", "count", "mean"):
            for kind in ("values", "linspace", "logspace", "uniform", "normal"):
                yield {"axis": [{"field": "duration", "kind": kind, name: value}]}

    check(
        {
            message(studies.made, {"name": "a", "scenario": "hold", **section}, "mine")
            for value in VALUES
            for section in sections(value)
        },
        150,
    )


@pytest.mark.parametrize("text", ["folder = [[1]]", "folder = 3", "folder = {a = 1}"])
def test_the_folder_of_a_study_is_text(tmp_path, text):
    (path := tmp_path / "mine.toml").write_text(f'name = "a"\nscenario = "hold"\n{text}\n')
    assert "folder: expected text, received" in message(studies.load, str(path))


TOLERANCES = [
    "signals = 3", "signals = []", "[signals]", "[signals]\nq_rad = 3", "[signals.q_rad]\nabsolute = 'x'",
    "[signals.q_rad]\nabsolute = -1", "[signals.q_rad]\nabsolute = nan", "[signals.q_rad]\nabsolute = true",
    "[signals.q_rad]\nabsolut = 1", "[signals.q_rad]\nabsolute = 2024-01-01", "description = 3", "a = 1",
    "[signals.q_rad]\ntime_s = 1e9", "[[signals]]", "description = 1979-05-27T07:32:00Z", "[signals", "\x00",
]  # fmt: skip


@pytest.mark.parametrize("text", TOLERANCES)
def test_tolerances(tmp_path, text):
    (path := tmp_path / "mine.toml").write_text(text)
    assert not FORBIDDEN.search(message(tolerances.load, str(path)))


@pytest.mark.parametrize("load", [scenarios.load, studies.load, tolerances.load])
@pytest.mark.parametrize(
    "content", [b"\xff\xfe", b"a = [[[", b"a" * 9, b"a = " + b"[" * 5000, b"a = 2024-13-01", None]
)
def test_files_that_cannot_be_read(tmp_path, load, content):
    path = tmp_path / "mine.toml"
    if content is not None:
        path.write_bytes(content)
    assert not FORBIDDEN.search(message(load, str(path)))


def test_values_that_toml_does_not_have():
    circle = []
    circle.append(circle)
    for value in ({(1, 2): 3}, circle, "\udcff", {"a": {1, 2}}, b"x", object(), np.zeros(3), 1j):
        line = message(scenarios.load, "hold", {"trajectory.angle_rad": value})
        assert line is None or not FORBIDDEN.search(line.replace("<object object", "<")), line


def test_a_user_s_field_of_several_types_is_named_without_them(tmp_path):
    path = tmp_path / "mine.py"
    path.write_text(
        "from spheretwin.control.law_components.parameters import LawParameters\n"
        "class Mine(LawParameters):\n"
        "    gain: float | tuple[float, float] = 1.0\n"
        "    def build(self, known): ...\n"
    )
    line = message(scenarios.load, "hold", {"controller.law": f"{path}:Mine", "controller.gain": "x"})
    assert line == "scenario hold: controller.gain: expected a number, received 'x'"


def test_shown_ends_whatever_it_is_given():
    circle = [1]
    circle.append(circle)
    deep = []
    for _ in range(100_000):
        deep = [deep]
    for value in (circle, deep, list(range(10**6)), np.zeros((1000, 1000)), {i: i for i in range(10**5)}):
        assert len(shown(value)) <= 120
