"""Rerun's own program, which is installed with it."""

import sys
from pathlib import Path

import rerun_cli

PROGRAM = Path(rerun_cli.__file__).with_name("rerun.exe" if sys.platform == "win32" else "rerun")
