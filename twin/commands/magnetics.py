"""``spheretwin magnetics``: the magnetic model by itself."""

from __future__ import annotations

import argparse
import math
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from spheretwin.models.actuator import MJCF_PATH, TORQUE_CURVE_PATH
from spheretwin.models.design.workspace import LARGEST_TILT_DEG
from spheretwin.twin.commands.reporting import add_verbose

CURVE = "torque curve from 0 to 180 degrees, columns phi_deg,torque_Nm_per_A"

MOST_POSES = 10_000  # some four hours

# At 90 degrees the shaft's azimuth no longer tells a pose, and the hinges lock.
STEEPEST_DEG = 85.0


def add_to(verbs: Any) -> None:
    """Add the verb to the command's parser."""
    parser = verbs.add_parser("magnetics", help="the magnetic model by itself", allow_abbrev=False)
    parts = parser.add_subparsers(metavar="PART", required=True)
    curve = _part(
        parts,
        "curve",
        "compute the torque curve of a pole and a coil, or judge your own",
        "Compute the torque curve f_t(φ) from the geometry of the model file, with magpylib; or compare"
        " your own finite-element or bench data with it.",
    )
    curve.add_argument("--out", type=Path, metavar="FILE.csv", help="write the curve here, not to stdout")
    curve.add_argument("--csv", type=Path, metavar="FILE.csv", help=f"judge this {CURVE}")
    curve.set_defaults(run=_run_curve)

    check = _part(
        parts,
        "check",
        "check the torque matrix against the summed field of all poles on all windings",
        "Compare G_t(q)·I with the exact field of all magnets on the current of all windings"
        " (magpylib), in random poses and for random currents.",
    )
    _add_curve(check)
    check.add_argument("--poses", type=_count, default=15, metavar="N", help="number of poses (default: 15)")
    check.add_argument(
        "--seed", type=_seed, default=0, metavar="N", help="of poses and currents (default: 0)"
    )
    check.set_defaults(run=_run_check)

    capability = _part(
        parts,
        "map",
        "map the torque that is available in every direction over the workspace",
        "Map, over tilt, its direction and spin: the torque available in every direction at the current"
        " limit, the torque matrix's smallest singular value and condition number, and the copper loss.",
    )
    _add_curve(capability)
    capability.add_argument("--out", type=Path, metavar="DIR", help="write figures into this folder")
    capability.add_argument(
        "--need", type=_positive, metavar="NM", help="fail where less torque (N·m) is available"
    )
    capability.add_argument(
        "--largest-tilt",
        type=_tilt,
        default=LARGEST_TILT_DEG,
        metavar="DEG",
        help=f"of the shaft, degrees (default: {LARGEST_TILT_DEG:g})",
    )
    capability.set_defaults(run=_run_map)


# Each part is imported when it runs: numba and scipy are slow to import.


def _run_curve(options: argparse.Namespace, rest: Sequence[str]) -> bool:
    from spheretwin.twin.commands.magnetic import curve

    return curve.run(options, rest)


def _run_check(options: argparse.Namespace, rest: Sequence[str]) -> bool:
    from spheretwin.twin.commands.magnetic import check

    return check.run(options, rest)


def _run_map(options: argparse.Namespace, rest: Sequence[str]) -> bool:
    from spheretwin.twin.commands.magnetic import map

    return map.run(options, rest)


def _part(parts: Any, name: str, summary: str, description: str) -> argparse.ArgumentParser:
    part: argparse.ArgumentParser = parts.add_parser(
        name, help=summary, description=description, allow_abbrev=False
    )
    part.add_argument("--mjcf", type=Path, default=MJCF_PATH, metavar="FILE.xml", help="model file")
    part.add_argument("--json", action="store_true", help="print the figures as JSON, alone on stdout")
    add_verbose(part)
    return part


def _add_curve(part: argparse.ArgumentParser) -> None:
    part.add_argument(
        "--csv",
        type=Path,
        default=TORQUE_CURVE_PATH,
        metavar="FILE.csv",
        help=f"{CURVE} (default: the shipped one)",
    )


def _count(text: str) -> int:
    if not _digits(text) or not 1 <= int(text) <= MOST_POSES:
        raise argparse.ArgumentTypeError(f"expected a whole number from 1 to {MOST_POSES}, received {text}")
    return int(text)


def _seed(text: str) -> int:
    if not _digits(text):
        raise argparse.ArgumentTypeError(f"expected a whole number from 0 to 10^18, received {text}")
    return int(text)


def _digits(text: str) -> bool:
    return text.isdecimal() and len(text) <= 18


def _positive(text: str) -> float:
    value = _number(text)
    if not (0 < value < math.inf):
        raise argparse.ArgumentTypeError(f"expected a number above 0, received {text}")
    return value


def _tilt(text: str) -> float:
    value = _number(text)
    if not 0 <= value <= STEEPEST_DEG:
        raise argparse.ArgumentTypeError(f"expected degrees from 0 to {STEEPEST_DEG:g}, received {text}")
    return value


def _number(text: str) -> float:
    try:
        return float(text)
    except ValueError:
        return math.nan
