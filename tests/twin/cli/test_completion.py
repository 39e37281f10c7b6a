"""Completion: words from the parsers and the models, and a script for bash that works."""

import subprocess
import sys
from pathlib import Path

import pytest

from spheretwin import cli
from spheretwin.cli.completion import SCRIPTS, words
from spheretwin.control.laws import LAWS
from spheretwin.scenario import reading
from tests.requirements import needs_shell


@pytest.mark.parametrize(
    ("typed", "expected"),
    [
        ((""), [*cli.VERBS, "--help", "--version"]),
        (("sim"), ["simulate"]),
        (("simulate", ""), reading.shipped()),
        (("simulate", "hold", "--controller.law", ""), list(LAWS)),
        (("simulate", "hold", "--controller.law", "afsm"), ["afsm", "afsm_eso"]),
        (("simulate", "--plant.coul"), ["--plant.coulomb-Nm", "--plant.coulomb-asymmetry"]),
        (("magnetics", "cu"), ["curve"]),
        (("magnetics", "map", "--need"), ["--need"]),
        (("review", "--figure-format", "pd"), ["pdf", "pdf-one-column", "pdf-two-columns"]),
        (("new", ""), ["law", "actuator", "study"]),
        (("simulate", "hold", "--record", ""), []),
        (("nonsense", ""), []),
        (("export", ""), ["fmu", "c"]),
        (("export", "fmu", "hold", "--ki"), ["--kind"]),
        (("export", "c", "hold", "--controller.law"), ["--controller.law"]),
    ],
)
def test_words(typed, expected):
    assert words([typed] if isinstance(typed, str) else typed) == expected


@needs_shell("bash")
def test_bash_completes_a_verb():
    script = (
        f"{SCRIPTS['bash']}\nCOMP_WORDS=(spheretwin sim) COMP_CWORD=1\n_spheretwin\necho ${{COMPREPLY[@]}}"
    )
    path = f"{Path(sys.executable).parent}:/usr/bin:/bin"
    done = subprocess.run(["bash", "-c", script], env={"PATH": path}, capture_output=True, text=True)
    assert done.stdout.split() == ["simulate"]


@pytest.mark.parametrize("shell", [pytest.param(name, marks=needs_shell(name)) for name in ("zsh", "fish")])
def test_the_scripts_of_other_shells_have_valid_syntax(shell):
    subprocess.run([shell, "-n"], input=SCRIPTS[shell], text=True, check=True)
