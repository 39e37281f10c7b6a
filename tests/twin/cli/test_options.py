"""Options of every verb: their defaults, their types, and the ends of their ranges."""

from importlib import import_module
from pathlib import Path

import pytest

from spheretwin import cli
from spheretwin.models.actuator import MJCF_PATH


@pytest.fixture
def received(monkeypatch):
    """Return the options that a verb receives in place of its run."""

    def parse(*arguments):
        module = import_module(f"spheretwin.cli.{arguments[0]}")
        calls = []

        def replaced(verb):
            return verb._replace(run=lambda given: not calls.append(given))

        if parts := getattr(module, "PARTS", {}):
            monkeypatch.setitem(parts, arguments[1], replaced(parts[arguments[1]]))
        else:
            monkeypatch.setattr(module, "run", replaced(module.run))
        assert cli.main(list(arguments)) == cli.DONE
        (options,) = calls
        return vars(options)

    return parse


DEFAULTS = {
    "simulate hold": {"scenario": "hold"},
    "log check a": {"files": [Path("a")], "scenario": "hold"},
    "bench": {
        "scenario": "bench", "port": 8080, "hold_after": 2.0, "folder": Path(), "frame": "spheretwin",
    },
    "crosscheck": {"states": 10_000, "mjcf": MJCF_PATH, "figure_format": "svg"},
    "reproduce figure6": {"names": ["figure6"], "figure_format": "svg"},
    "sweep paper": {"study": "paper", "engine": "local", "figure_format": "svg"},
    "review a": {"runs": [Path("a")], "figure_format": "svg"},
    "recover a --out b": {"file": Path("a"), "out": Path("b")},
    "explain x y": {"subjects": ["x", "y"]},
    "magnetics curve": {"mjcf": MJCF_PATH},
    "magnetics check": {"mjcf": MJCF_PATH, "poses": 15, "seed": 0, "figure_format": "svg"},
    "magnetics map": {"mjcf": MJCF_PATH, "largest_tilt": 57.0, "figure_format": "svg"},
}  # fmt: skip
"""Defaults of the options that are neither absent nor off nor empty."""


@pytest.mark.parametrize("command", DEFAULTS)
def test_options_have_their_defaults(received, command):
    options = received(*command.split())
    assert options.pop("has_fields") == (command.split()[0] in ("simulate", "bench"))
    own = set(options) - {"run", "parser", "help"}
    stated = {name: options[name] for name in own if options[name] not in (None, [])}
    assert {name: value for name, value in stated.items() if value is not False} == DEFAULTS[command]


GIVEN = [
    "simulate hold --record a/b --telemetry a/b --export-log a/b --export-truth a/b --live --json",
    "simulate --replay a/b",
    "log check a --columns a/b --json",
    "bench --record a/b --no-browser",
    "crosscheck --out a/b --mjcf a/b --json --verbose",
    "reproduce figure6 --out a/b --json --verbose",
    "sweep paper --out a/b --optimise --json",
    "review a --export a/b --merge a/b --figures a/b --json",
    "explain x --all --json",
    "magnetics curve --out a/b --csv a/b",
    "magnetics check --csv a/b",
    "magnetics map --out a/b --json --verbose",
]


@pytest.mark.parametrize("command", GIVEN)
def test_files_are_paths_and_switches_are_on(received, command):
    words = command.split()
    options = received(*words)
    for word, after in zip(words, [*words[1:], "--"], strict=True):
        if word.startswith("--"):
            expected = True if after.startswith("--") else Path(after)
            assert options[word[2:].replace("-", "_")] in (expected, [expected])


@pytest.mark.parametrize(
    ("command", "flag", "valid", "invalid"),
    [
        ("simulate hold", "--record-rate", ["1e-9", "1000.5"], ["0", "-1", "inf", "nan", "x"]),
        ("simulate hold", "--live-window", ["0.001", "3600"], ["0", "-1", "inf"]),
        ("simulate hold", "--view", ["overview", "control"], ["Overview", "all"]),
        ("bench", "--port", ["0", "65535"], ["65536", "-1", "8e3"]),
        ("bench", "--hold-after", ["0", "2.5"], ["-0.1", "inf"]),
        ("crosscheck", "--states", ["1", "1000000"], ["0", "1000001"]),
        ("crosscheck", "--figure-format", ["pdf", "png", "pdf-one-column", "pdf-two-columns"], ["PDF"]),
        ("reproduce all", "--seeds", ["1", "1000"], ["0", "1001", "²"]),
        ("reproduce all", "--limit", ["1", "1000"], ["0", "1001"]),
        ("sweep paper", "--threads", ["1", "1024"], ["0", "1025"]),
        ("sweep paper", "--limit", ["1", "1000000000000"], ["0", "1000000000001"]),
        ("sweep paper", "--trials", ["1", "1000000000000"], ["0", "1.5"]),
        ("sweep paper", "--engine", ["local", "ray"], ["threads"]),
        ("magnetics check", "--poses", ["1", "10000"], ["0", "10001"]),
        ("magnetics check", "--seed", ["0", "1000000000000000000"], ["-1", "1000000000000000001"]),
        ("magnetics map", "--need", ["1e-6", "2"], ["0", "-1"]),
        ("magnetics map", "--largest-tilt", ["0", "85"], ["-0.1", "85.1", "nan"]),
    ],
)
def test_a_value_is_taken_up_to_the_ends_of_its_range(received, capsys, command, flag, valid, invalid):
    for text in valid:
        value = received(*command.split(), flag, text)[flag[2:].replace("-", "_")]
        assert value == (text if isinstance(value, str) else type(value)(text))
    for text in invalid:
        assert cli.main([*command.split(), f"{flag}={text}"]) == cli.BAD_INPUT
        assert text in capsys.readouterr().err
