"""Whether Rerun's reader lives through a file: some damage ends its process, which none can catch."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import rerun_cli

from spheretwin.models.base.errors import InputError, SpheretwinError
from spheretwin.models.base.wording import without_breaks

PROGRAM = Path(rerun_cli.__file__).with_name("rerun.exe" if sys.platform == "win32" else "rerun")

# With less it has found something that the reader finds again, and says on one line.
_PANICS = 100


def check_readable(path: Path, named: Path) -> None:
    """Let a process of its own read a recording first; of 10 MB that takes 30 ms.

    Parameters
    ----------
    path : Path
        What is read.
    named : Path
        What a complaint names.

    Raises
    ------
    InputError
        The process did not live through it.
    SpheretwinError
        Rerun's program cannot be started.
    """
    command = [str(PROGRAM), "rrd", "verify", "--check-footers=false", str(path)]
    try:
        ended = subprocess.run(
            command,
            stdin=subprocess.DEVNULL,
            stdout=subprocess.DEVNULL,
            stderr=subprocess.DEVNULL,
            check=False,
        ).returncode
    except OSError as error:
        raise SpheretwinError(
            f"recording {named}: expected Rerun at {PROGRAM}, {without_breaks(error)}"
        ) from None
    if ended < 0 or ended >= _PANICS:
        raise InputError(
            f"recording {named}: expected one of a run, received one so damaged that Rerun ends at it"
        )
