"""Options of every verb: their defaults, their types, and the ends of their ranges."""

from importlib import import_module
from pathlib import Path

import pytest

from spheretwin import cli
from spheretwin.models.actuator import MJCF_PATH

PART = {"curve": "run_curve", "check": "run_check", "map": "run_map"}


@pytest.fixture
def received(monkeypatch):
    """Return the options that a verb receives in place of its run."""

    def parse(*arguments):
        verb = arguments[0]
        run = PART[arguments[1]] if verb == "magnetics" else "run"
        calls = []
        monkeypatch.setattr(
            import_module(f"spheretwin.cli.{verb}"), run, lambda given: not calls.append(given)
        )
        assert cli.main(list(arguments)) == cli.DONE
        (options,) = calls
        return vars(options)

    return parse


PAGE = {"out": None, "figure_format": "svg", "json": False}
MAGNETICS = {"mjcf": MJCF_PATH, "json": False, "verbose": False, "out": None}

DEFAULTS = {
    "simulate hold": {
        "scenario": "hold", "record": None, "record_rate": None, "telemetry": None, "live": False,
        "live_window": None, "view": None, "replay": None, "metric": [], "json": False, "fields": [],
        "export_log": None, "export_truth": None, "twin": None,
    },
    "log check a": {
        "files": [Path("a")], "columns": None, "scenario": "hold", "accept": [], "json": False,
    },
    "bench": {
        "scenario": "bench", "port": 8080, "no_browser": False, "hold_after": 2.0, "record": None,
        "fields": [], "folder": Path(), "machine": None, "arm": False, "lockstep": False, "ramp_s": None,
        "timeout_ms": None, "limit_current_A": None, "limit_angle_deg": None, "limit_rate_rad_s": None,
        "limit_temperature_degC": None, "frame": "spheretwin",
    },
    "crosscheck": {**PAGE, "states": 10_000, "mjcf": MJCF_PATH, "verbose": False},
    "reproduce figure6": {
        **PAGE, "names": ["figure6"], "verbose": False, "seeds": None, "limit": None, "plant": None,
    },
    "sweep paper": {
        **PAGE, "study": "paper", "threads": None, "engine": "local", "address": None, "limit": None,
        "row": None, "optimise": False, "trials": None, "twin": None, "draws": None,
    },
    "review a": {
        "runs": [Path("a")], "tolerance": None, "export": None, "merge": None, "figures": None,
        "figure_format": "svg", "json": False,
    },
    "recover a --out b": {"file": Path("a"), "out": Path("b")},
    "explain x y": {"subject": ["x", "y"], "all": False, "json": False},
    "magnetics curve": {**MAGNETICS, "csv": None},
    "magnetics check": {
        **MAGNETICS, "csv": None, "poses": 15, "seed": 0, "figure_format": "svg",
    },
    "magnetics map": {
        **MAGNETICS, "csv": None, "need": None, "largest_tilt": 57.0, "figure_format": "svg",
    },
}  # fmt: skip


@pytest.mark.parametrize("command", DEFAULTS)
def test_options_have_their_defaults(received, command):
    options = received(*command.split())
    own = {name: value for name, value in options.items() if name in DEFAULTS[command]}
    assert own == DEFAULTS[command]
    assert set(options) - set(own) <= {"run", "parser", "has_fields", "help", "fields"}
    assert options["has_fields"] == (command.split()[0] in ("simulate", "bench"))


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
            assert options[word[2:].replace("-", "_")] == expected


@pytest.mark.parametrize(
    ("command", "flag", "valid", "invalid"),
    [
        ("simulate hold", "--record-rate", ["1e-9", "1000.5"], ["0", "-1", "inf", "nan", "x"]),
        ("simulate hold", "--live-window", ["0.001", "3600"], ["0", "-1", "inf"]),
        ("simulate hold", "--view", ["overview", "control"], ["Overview", "all"]),
        ("bench", "--port", ["0", "65535"], ["65536", "-1", "8e3"]),
        ("bench", "--hold-after", ["0", "2.5"], ["-0.1", "inf"]),
        ("crosscheck", "--states", ["1", "1000000"], ["0", "1000001"]),
        (
            "crosscheck",
            "--figure-format",
            ["pdf", "png", "pdf-one-column", "pdf-two-columns"],
            ["PDF", "jpg"],
        ),
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


def test_own_metrics_can_be_repeated(received):
    assert received("simulate", "hold", "--metric", "a:b", "--metric", "c:d")["metric"] == ["a:b", "c:d"]
