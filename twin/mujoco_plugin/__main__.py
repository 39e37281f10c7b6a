"""Viewer of a model with the plugin: ``python -m spheretwin.mujoco_plugin [MODEL.xml]``."""

import argparse
import sys

import mujoco
from mujoco import viewer

from spheretwin.models.base.errors import without_breaks
from spheretwin.models.base.files import regular_file
from spheretwin.mujoco_plugin import EXAMPLE


def main() -> int:
    """Open a model in MuJoCo's viewer, whose sliders set the controls; return the exit code."""
    parser = argparse.ArgumentParser(prog="python -m spheretwin.mujoco_plugin", description=main.__doc__)
    parser.add_argument("model", nargs="?", default=f"{EXAMPLE}", help="MJCF file; default: the shipped one")
    path = parser.parse_args().model
    try:
        model = mujoco.MjModel.from_xml_path(str(regular_file(path)))
    except (OSError, ValueError) as error:
        print(f"model {path}: expected valid MJCF, {without_breaks(error)}", file=sys.stderr)
        return 2
    viewer.launch(model)
    return 0


if __name__ == "__main__":
    sys.exit(main())
