"""``spheretwin magnetics curve``: the torque curve from geometry, or a user's own beside it."""

from __future__ import annotations

import argparse
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from spheretwin.models import torque_curve
from spheretwin.models.actuator import MJCF_PATH, read_magnet_and_coil
from spheretwin.models.base.check import Check
from spheretwin.models.base.errors import InputError
from spheretwin.models.base.files import check_writable
from spheretwin.models.design import curve_fit, pole_torque
from spheretwin.models.design import warnings as magnetics_warnings
from spheretwin.models.torque_curve import TorqueCurve
from spheretwin.twin.commands.reporting import kept, print_json, tracked, warn, write_text
from spheretwin.viz.terminal import magnetic_tables

MESH_BOUND = 5e-3
LOOKUP_BOUND = 1e-6


def run(options: argparse.Namespace, rest: Sequence[str]) -> bool:
    """Run the part; True when every bound is kept."""
    if rest:
        raise InputError(f"command line: expected --out, --csv, --mjcf or --json, received {' '.join(rest)}")
    if options.csv and options.out:
        raise InputError("command line: expected --out or --csv, received both")
    if options.out:
        check_writable(options.out)
    warnings = magnetics_warnings.of_model_file(options.mjcf, options.csv)
    warn(warnings)
    if options.csv:
        return _judge(options.csv, options.mjcf, options.json, warnings)
    return _compute(options.out, options.mjcf, options.json, warnings)


def _compute(out: Path | None, mjcf: Path, as_json: bool, warnings: list[str]) -> bool:
    """Compute the curve, check it, write it."""
    magnet, coil = read_magnet_and_coil(mjcf)
    curve = pole_torque.compute_curve(magnet, coil, track=tracked("torque curve"))
    measured = pole_torque.convergence(curve, magnet, coil, track=tracked("again, on half the mesh"))
    checks = [_mesh(measured), _lookup(curve, mjcf)]
    text = torque_curve.to_csv(curve, pole_torque.provenance(magnet, coil, measured))
    if out:
        write_text(out, text)
    elif not as_json:
        print(text, end="")
    figures: dict[str, Any] = {
        **_peak(curve),
        "doubled_mesh_moves_peak": measured.peak,
        "doubled_mesh_moves_worst_sample": measured.worst,
        "lookup_error": checks[1].value,
        "checks": [check.row() for check in checks],
        "warnings": warnings,
    }
    if as_json:
        print_json(figures)
    elif out:
        magnetic_tables.print_curve("torque curve computed from the geometry", _rows(figures))
        magnetic_tables.print_checks(figures["checks"])
        magnetic_tables.print_files([out])
    else:  # the curve itself has stdout
        print(
            f"peak {curve.peak_Nm_per_A:.5f} N·m/A at {figures['peak_deg']:.2f}°;"
            f" a doubled mesh moves it by {measured.peak:.0e} of itself",
            file=sys.stderr,
        )
    return kept("magnetics curve", checks)


def _judge(csv: Path, mjcf: Path, as_json: bool, warnings: list[str]) -> bool:
    """Tell how smooth a user's curve is, and how far it is from the geometry's."""
    magnet, coil = read_magnet_and_coil(mjcf)
    curve = torque_curve.read(csv)
    missed = curve_fit.leave_one_out(curve)
    apart = curve_fit.difference(curve, magnet, coil, track=tracked("the geometry's own curve"))
    figures: dict[str, Any] = {
        "path": str(csv),
        "rows": len(curve.phi_rad),
        **_peak(curve),
        "leave_one_out": missed._asdict(),
        "geometry": {
            "difference": apart.as_given._asdict(),
            "scale": apart.scale,
            "difference_after_scaling": apart.scaled._asdict(),
        },
        "lookup_error": curve_fit.lookup_error(curve),
        "checks": [],
        "warnings": warnings,
    }
    if as_json:
        print_json(figures)
    else:
        magnetic_tables.print_curve(f"torque curve {csv}", _rows(figures))
    return True  # data is judged by its owner: nothing here is bounded


def _peak(curve: TorqueCurve) -> dict[str, float]:
    top = int(np.argmax(np.abs(curve.torque_Nm_per_A)))
    return {"peak_Nm_per_A": curve.peak_Nm_per_A, "peak_deg": float(np.degrees(curve.phi_rad[top]))}


def _mesh(measured: pole_torque.Convergence) -> Check:
    return Check(
        name="mesh",
        compares="peak of the curve against the one on half the mesh, over the peak",
        states=1,
        value=measured.peak,
        bound=MESH_BOUND,
        why="a real magnet's remanence is not known better than half a percent",
    )


def _lookup(curve: TorqueCurve, mjcf: Path) -> Check:
    shipped = mjcf.resolve() == MJCF_PATH
    return Check(
        name="lookup",
        compares="compiled look-up table against the spline, over the peak",
        states=curve_fit.LOOKUP_POINTS,
        value=curve_fit.lookup_error(curve),
        bound=LOOKUP_BOUND if shipped else None,
        why="a tenth of the curve's own error of 1e-5"
        if shipped
        else "the table's intervals were chosen for the shipped geometry; smaller parts need finer ones",
    )


def _rows(figures: dict[str, Any]) -> list[tuple[str, str]]:
    """Figures as a person reads them."""
    rows = [("peak", f"{figures['peak_Nm_per_A']:.5f} N·m/A at {figures['peak_deg']:.2f}°")]
    if "rows" in figures:
        given, scaled = figures["geometry"]["difference"], figures["geometry"]["difference_after_scaling"]
        rows = [
            ("samples", str(figures["rows"])),
            *rows,
            ("a sample left out is missed by", _misfit(figures["leave_one_out"], "peak")),
            ("apart from the geometry's curve", _misfit(given, "its peak")),
            ("best factor on the geometry's curve", f"{figures['geometry']['scale']:.4f}"),
            ("apart from it, so scaled", _misfit(scaled, "its peak")),
            ("look-up table apart from the spline", f"{figures['lookup_error']:.1e} of the peak"),
        ]
    return rows


def _misfit(misfit: dict[str, float], unit: str) -> str:
    rms, worst = 100 * misfit["rms"], 100 * misfit["worst"]
    return f"rms {rms:.2g} %, at most {worst:.2g} % of {unit} (at {misfit['worst_deg']:.2f}°)"
