"""The command of the cross-check, its rows, and which of its checks fail."""

import json
from contextlib import redirect_stderr, redirect_stdout
from io import StringIO
from pathlib import Path

from spheretwin import cli

FEW = 50
"""States with which most tests check."""
ROWS = json.loads(Path(__file__).with_name("rows.json").read_text(encoding="utf-8"))


def crosscheck(*arguments):
    """Run the command; return its exit code, stdout and stderr."""
    with redirect_stdout(StringIO()) as out, redirect_stderr(StringIO()) as err:
        code = cli.main(["crosscheck", *map(str, arguments)])
    return code, out.getvalue(), err.getvalue()


def broken(checks):
    return {check.name for check in checks if not check.ok}
