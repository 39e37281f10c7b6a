"""``spheretwin magnetics``: the magnetic model by itself."""

from __future__ import annotations

import argparse
import json
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from spheretwin.models import pole_torque, torque_curve
from spheretwin.models.actuator import MJCF_PATH, read_magnet_and_coil
from spheretwin.models.errors import InputError


def add_to(verbs: Any) -> None:
    """Add the verb to the command's parser."""
    parser = verbs.add_parser("magnetics", help="the magnetic model by itself", allow_abbrev=False)
    parts = parser.add_subparsers(metavar="PART", required=True)
    curve = parts.add_parser(
        "curve",
        help="compute the torque curve of a pole and a coil",
        description="Compute the torque curve f_t(φ) from the geometry of the model file, with magpylib.",
        allow_abbrev=False,
    )
    curve.add_argument("--out", type=Path, metavar="FILE.csv", help="write the curve here, not to stdout")
    curve.add_argument("--mjcf", type=Path, default=MJCF_PATH, metavar="FILE.xml", help="model file")
    curve.add_argument("--json", action="store_true", help="print the figures as JSON, alone on stdout")
    curve.set_defaults(run=run_curve)


def run_curve(options: argparse.Namespace, rest: Sequence[str]) -> bool:
    """Compute the curve, check its convergence, write it."""
    if rest:
        raise InputError(f"command line: expected --out, --mjcf or --json, received {' '.join(rest)}")
    magnet, coil = read_magnet_and_coil(options.mjcf)
    curve = pole_torque.compute_curve(magnet, coil)
    measured = pole_torque.convergence(curve, magnet, coil)
    text = torque_curve.to_csv(curve, pole_torque.provenance(magnet, coil, measured))
    if options.out:
        _write(options.out, text)
    elif not options.json:
        print(text, end="")
    figures = {
        "peak_Nm_per_A": curve.peak_Nm_per_A,
        "peak_deg": float(np.degrees(curve.phi_rad[np.argmax(curve.torque_Nm_per_A)])),
        "doubled_mesh_moves_peak": measured.peak,
        "doubled_mesh_moves_worst_sample": measured.worst,
    }
    if options.json:
        print(json.dumps(figures))
    else:
        print(
            f"peak {figures['peak_Nm_per_A']:.5f} N·m/A at {figures['peak_deg']:.2f}°;"
            f" a doubled mesh moves it by {measured.peak:.0e} of itself",
            file=sys.stderr,
        )
    return True


def _write(path: Path, text: str) -> None:
    try:
        path.write_text(text, encoding="utf-8")
    except OSError as error:
        raise InputError(f"output: expected a writable path, {error}") from None
