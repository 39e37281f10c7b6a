"""The command under hostile arguments, in this process: an exit code, one line, never a traceback."""

import contextlib
import io
from importlib.metadata import version

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from spheretwin.models.base.wording import LONGEST_LINE
from spheretwin.twin import cli
from spheretwin.twin import scenario as scenarios
from spheretwin.twin.commands import simulate
from spheretwin.twin.scenario import flags
from spheretwin.twin.scenario.reading import shipped


def called(*arguments):
    """Exit code, stdout and stderr."""
    stdout, stderr = io.StringIO(), io.StringIO()
    with contextlib.redirect_stdout(stdout), contextlib.redirect_stderr(stderr):
        try:
            code = cli.main(arguments)
        except SystemExit as ended:  # --help and --version end in argparse
            code = ended.code
    return code, stdout.getvalue(), stderr.getvalue()


def refusal(*arguments):
    code, stdout, stderr = called(*arguments)
    assert (code, stdout) == (2, "")
    assert stderr.startswith("spheretwin: ")
    assert stderr.endswith("\n")
    assert stderr[:-1].isprintable()
    assert len(stderr) < LONGEST_LINE + 20
    return stderr[:-1]


def test_version_is_printed():
    assert called("--version") == (0, f"spheretwin {version('spheretwin')}\n", "")


LONG = "x" * 20_000


@pytest.mark.parametrize(
    ("arguments", "parts"),
    [
        (["hold", "--seed", "9" * 5000], ["seed: expected a valid integer, received '99", "…"]),
        (["hold", "--seed", "9" * 100_000], ["seed: expected a valid integer"]),
        ([f"{LONG}.toml"], ["expected a readable TOML file", "…"]),
        ([LONG], ["nutation", "…"]),
        (["hold", "--record", LONG], ["File name too long"]),
        (["hold", "--telemetry", f"/{'d/' * 20_000}x"], ["File name too long"]),
        (["hold", "--plant.mjcf", LONG], ["expected an MJCF file"]),
        (["hold", "--plant.torque-curve", LONG], ["expected a readable text file"]),
        (["hold", "--name", "a\nb"], ["without control characters", r"'a\nb'"]),
        (["hold", "--name", "\x1b[2J"], [r"'\x1b[2J'"]),
        (["hold", "--\x1b[2J", "1"], [r"\x1b[2J"]),
        (["hold", "--record", "a\x1bb.rrd"], [r"'a\x1bb.rrd'"]),
        (["hold", "--record", "a\udcff.rrd"], [r"'a\udcff.rrd'"]),
        (["a\0b.toml"], [r"'a\x00b.toml'"]),
        ([""], ["nutation", "received ''"]),
        (["hold", "--seed="], ["seed", "received ''"]),
        (["hold", "--="], ["such as controller.law, received ''"]),
        (["hold", "--a..b", "1"], ["such as controller.law, received 'a..b'"]),
        (["hold", "--controler.law", "pd"], ["controler; did you mean controller?"]),
        (["hold", "--controller.law", "afsn"], ["did you mean afsm?"]),
        (["nutatio"], ["did you mean nutation?"]),
        (["hold", "--plant", "[" * 100_000], ["plant"]),
        (["hold", f"--{'a.' * 5000}a", "1"], ["scenario hold"]),
    ],
)  # fmt: skip
def test_hostile_arguments_are_refused_on_one_line(arguments, parts):
    line = refusal("simulate", *arguments)
    for part in parts:
        assert part in line


NAMES = [flag for flag, *_ in flags.described(scenarios.load("nutation"))]
VALUES = ["0", "-1", "1e999", "nan", "9" * 5000, "true", "null", "[1,2,3]", '{"a": 1}', "pd", "", LONG]

flag = st.sampled_from(NAMES) | st.sampled_from(["--", "-", "--=", "---", "--a..b", "--live", "--json", "-x"])
flag |= st.text(max_size=8).map(lambda text: f"--{text}")
value = st.sampled_from(VALUES) | st.text(st.characters(), max_size=12) | st.floats().map(repr)
valid = st.sampled_from(["--seed=3", "--duration=2", "--controller.law=pd", "--name=a", "--json", "--live"])
argument = valid | flag | value | st.builds(lambda name, text: f"{name}={text}", flag, value)
scenario = st.sampled_from(["hold", *shipped(), "nutatoin", "none.toml"]) | value
# After a bare -- the word -h is a value.
help_or_refused = st.sampled_from(["--help", "--duration=-1", "--no.such.field=1"])


# 300 examples: some seconds.
@settings(max_examples=300)
@given(scenario, st.lists(valid, max_size=6) | st.lists(argument, max_size=6), help_or_refused)
def test_any_arguments_end_in_an_exit_code(source, arguments, last):
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(simulate, "Session", _not_run)
        code, _, stderr = called("simulate", source, *arguments, last)
    assert code in (0, 2)
    if code == 2:
        assert stderr.endswith("\n")
        assert stderr[:-1].isprintable()
    else:
        assert stderr == ""


def _not_run(scenario):
    raise AssertionError("a run began, although its last argument asks for help or is invalid")
