"""Calls of the command line in the process of the test, and processes of their own."""

import contextlib
import io
import json
import signal
import subprocess
import sys
from typing import NamedTuple

from spheretwin import cli
from spheretwin.models.base.errors import LONGEST_LINE


class Call(NamedTuple):
    """Exit code of a call and the text of its two streams."""

    code: int
    out: str
    err: str

    @property
    def json(self):
        """Return the figures on stdout, which nothing else is on."""
        return json.loads(self.out)


def call(*arguments):
    """Run the command with these arguments."""
    with contextlib.redirect_stdout(io.StringIO()) as out, contextlib.redirect_stderr(io.StringIO()) as err:
        try:
            code = cli.main([*map(str, arguments)])
        except SystemExit as end:  # --help and --version end in argparse
            code = end.code
    return Call(code, out.getvalue(), err.getvalue())


def succeeded(*arguments):
    """Return the text on stdout of a call that writes nothing to stderr."""
    result = call(*arguments)
    assert (result.code, result.err) == (cli.DONE, "")
    return result.out


def refusal(*arguments):
    """Return the message of a call that is refused: a printable line, alone on stderr."""
    code, out, err = call(*arguments)
    assert (code, out) == (cli.BAD_INPUT, "")
    message = err.removeprefix("spheretwin: ").removesuffix("\n")
    assert err == f"spheretwin: {message}\n"
    assert message.isprintable()
    assert len(message) < LONGEST_LINE + 20
    return message


COMMAND = [sys.executable, "-m", "spheretwin"]


def started(*arguments, **options):
    """Start the command with the default handlers of signals, as a shell in the foreground does."""
    command, pipe = [*COMMAND, *map(str, arguments)], subprocess.PIPE
    options = {"text": True, "preexec_fn": _default_handlers, **options}
    return subprocess.Popen(command, stdout=pipe, stderr=pipe, **options)


def _default_handlers():
    for number in (signal.SIGINT, signal.SIGTERM):
        signal.signal(number, signal.SIG_DFL)


LAW = """
import os
import sys

def law(t, reference, measurement, parameters, state, torque):
    torque[:] = -0.5 * (measurement[0] - reference[0]) - 0.03 * measurement[1]
    """


def under_law(folder, statement):
    """Return the arguments of a run of hold, whose law also executes a statement at each tick."""
    (folder / "law.py").write_text(f"{LAW}{statement}\n")
    law = f"{folder / 'law.py'}:law"
    return ["simulate", "hold", "--plant.engine", "lagrangian", "--controller.law", law]
