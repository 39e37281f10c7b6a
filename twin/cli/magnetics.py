"""``spheretwin magnetics``: analysis of the magnetic model."""

from __future__ import annotations

import argparse
import math
import sys
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from spheretwin.cli.common import print_message, print_result, report_broken, warn, warn_about_model
from spheretwin.cli.options import number, verb, whole
from spheretwin.models import actuator as actuators
from spheretwin.models import torque_curve
from spheretwin.models.actuator import TORQUE_CURVE_PATH
from spheretwin.models.base.checks import Check
from spheretwin.models.base.errors import InputError
from spheretwin.models.base.files import check_writable
from spheretwin.models.curve_origin import SAME, computed_from
from spheretwin.models.design import curve_check, field_check, rotor_field, torque_map
from spheretwin.models.design.workspace import LARGEST_TILT_DEG
from spheretwin.models.magnet_and_coil import read_magnet_and_coil
from spheretwin.viz.pages import magnetics
from spheretwin.viz.pages.markdown import ResultTable, prepare, save_text
from spheretwin.viz.terminal.progress import tracked

CURVE = "torque curve from 0 to 180 degrees, columns phi_deg,torque_Nm_per_A"

MODEL = """
    --mjcf
    --json
    --verbose"""

OF_CURVE = f"""
    --csv FILE.csv  {CURVE}, or a torque field (default: the file of the model file)"""

MOST_DEGREE = 300  # some gigabytes

MOST_POSES = 10_000  # some four hours

HOOP = "docs/scripts/iron_hoop.py"

# At 90 degrees the azimuth of the shaft no longer determines a pose, and the hinges lock.
STEEPEST_DEG = 85.0


@verb(
    f"""{MODEL}{OF_CURVE}
    --poses N=15  number of poses (default: 15)
    --seed N=0    seed of poses and currents (default: 0)
    --out
    --figure-format
    """,
    poses=whole(MOST_POSES),
    seed=whole(10**18, first=0),
)
def run_check(options: argparse.Namespace) -> bool:
    """Compare the torque matrix with the summed field of all poles on all windings.

    G_t(q)·I is compared with the exact field of all magnets on the current of all windings (magpylib), in
    random poses and for random currents.
    """
    actuator = actuators.load(options.mjcf, options.csv)
    if options.out:
        prepare(options.out)
    verdict = field_check.judge(actuator, options.poses, options.seed, tracked("direct sums"))
    warn_about_model(options.mjcf)
    warn(verdict.warnings)
    if verdict.curve_is_of_another_geometry:
        distance = 100 * verdict.sources.curve_between_samples_of_peak
        warn(
            [
                f"the torque curve is {distance:.2g} % of its peak away from the model file's geometry:"
                " `spheretwin magnetics curve` computes it again"
            ]
        )
    command = f"spheretwin magnetics check --poses {options.poses} --seed {options.seed}"
    written = (
        magnetics.write_check(options.out, verdict, command, options.figure_format) if options.out else []
    )
    tables, text = [magnetics.field_table(verdict)], magnetics.sources_text(verdict)
    return print_result(
        options, "magnetics check", verdict._asdict(), tables, verdict.checks, text, written=written
    )


@verb(
    f"""{MODEL}{OF_CURVE}
    --need NM         fail if less torque (N·m) is available at a pose
    --largest-tilt DEG={LARGEST_TILT_DEG:g}  largest tilt of the shaft, degrees
        (default: {LARGEST_TILT_DEG:g})
    --out
    --figure-format
    """,
    need=number("a number above 0"),
    largest_tilt=number(f"degrees from 0 to {STEEPEST_DEG:g}", lambda tilt: 0 <= tilt <= STEEPEST_DEG),
)
def run_map(options: argparse.Namespace) -> bool:
    """Map the torque that is available in every direction over the workspace.

    The map is over tilt, its direction and spin, and has the torque available in every direction at the
    current limit, the torque matrix's smallest singular value and condition number, and the copper loss.
    """
    actuator = actuators.load(options.mjcf, options.csv)
    if options.out:
        prepare(options.out)
    surveyed = torque_map.survey(actuator, options.largest_tilt, tracked("torque capability"))
    verdict = torque_map.judge(surveyed, options.need)
    warn_about_model(options.mjcf)
    warn(verdict.warnings)
    written = []
    if options.out:
        need = f" --need {options.need:g}" if options.need else ""
        command = f"spheretwin magnetics map --largest-tilt {options.largest_tilt:g}{need}"
        written = magnetics.write_map(options.out, surveyed, verdict, command, options.figure_format)
    tables, text = magnetics.workspace_tables(verdict), magnetics.MAP_TERMS
    return print_result(
        options, "magnetics map", verdict._asdict(), tables, verdict.checks, text, written=written
    )


@verb(
    f"""{MODEL}
    --out FILE.csv  write the curve here, not to stdout
    --csv FILE.csv  check this {CURVE}
    """,
    excludes={"--csv": "--out"},
)
def run_curve(options: argparse.Namespace) -> bool:
    """Compute the torque curve of a pole and a coil, or check another curve.

    The curve f_t(φ) follows from the geometry of the model file, with magpylib; finite-element or
    measured data are compared with it.
    """
    if options.csv:
        return _judge(options)
    if options.out:
        check_writable(Path(options.out), ".csv")
    if _is_known(options.mjcf):
        print_message(f"{options.mjcf} has the poles and coils of {TORQUE_CURVE_PATH}: the curve is the same")
    computed = curve_check.compute(options.mjcf, tracked("torque curve"))
    warn_about_model(options.mjcf)
    warn(computed.warnings)
    figures = {
        **computed.peak._asdict(),
        "doubled_mesh_moves_peak": computed.doubled_mesh.peak,
        "doubled_mesh_moves_worst_sample": computed.doubled_mesh.worst,
        "lookup_error": computed.lookup_error,
        "checks": computed.checks,
        "warnings": computed.warnings,
    }
    if not options.out and not options.json:
        print(
            f"peak {computed.peak.peak_Nm_per_A:.5f} N·m/A at {computed.peak.peak_deg:.2f}°;"
            f" a doubled mesh moves it by {computed.doubled_mesh.peak:.0e} of itself",
            file=sys.stderr,
        )
    tables = [magnetics.computed_curve_table(computed)]
    return _report_csv(options, "curve", figures, computed.checks, tables, computed.csv)


@verb(
    f"""{MODEL}
    --out FILE.csv   write the field here, not to stdout
    --step DEG=1     step of the samples, degrees (default: 1)
    --degree N={rotor_field.DEGREE}  largest degree of the harmonics (default: {rotor_field.DEGREE})
    --on-iron        put the back of each magnet on an infinite plane of iron, by its mirror image
    """,
    step=number("a divisor of 180 from 0.25 to 30", lambda step: 0.25 <= step <= 30 and not 180 % step),
    degree=whole(MOST_DEGREE, first=3),
)
def run_field(options: argparse.Namespace) -> bool:
    """Compute the torque field of any arrangement of magnets.

    It is the torque of one ampere in a coil as a vector function of its direction in the rotor frame,
    from the magnets and the coils of the model file, with magpylib.
    """
    if options.out:
        check_writable(Path(options.out), ".csv")
    computed = rotor_field.compute(
        options.mjcf, options.step, options.degree, options.on_iron, tracked("field of the magnets")
    )
    warn_about_model(options.mjcf)
    figures = {
        "peak_Nm_per_A": computed.field.peak_Nm_per_A,
        "rows": computed.field.torque_Nm_per_A.size // 3,
        "upper_degrees": computed.degree_share,
        "checks": computed.checks,
    }
    return _report_csv(options, "field", figures, computed.checks, [], computed.csv)


@verb(MODEL)
def run_hoop(options: argparse.Namespace) -> bool:
    """Moved to docs/scripts/iron_hoop.py of the repository."""
    raise InputError(f"magnetics hoop: expected `python {HOOP}` in a clone of the repository: it moved there")


def _judge(options: argparse.Namespace) -> bool:
    """Report the smoothness of a user curve and its distance from the curve of the geometry."""
    track = tracked("the geometry's own curve")
    judged = curve_check.judge(torque_curve.read(options.csv), options.mjcf, track)
    warn_about_model(options.mjcf)
    warn(judged.warnings)
    figures = {
        "path": str(options.csv),
        "rows": judged.rows,
        **judged.peak._asdict(),
        "leave_one_out": judged.leave_one_out,
        "geometry": {
            "difference": judged.geometry.as_given,
            "scale": judged.geometry.scale,
            "difference_after_scaling": judged.geometry.scaled,
        },
        "lookup_error": judged.lookup_error,
        "checks": [],  # the user judges the data
        "warnings": judged.warnings,
    }
    return print_result(
        options, "magnetics curve", figures, [magnetics.judged_curve_table(options.csv, judged)], []
    )


def _is_known(mjcf: Path) -> bool:
    """True if nothing that the shipped curve depends on differs in a model."""
    known = dict(torque_curve.read(TORQUE_CURVE_PATH).computed_for or {})
    numbers = computed_from(*read_magnet_and_coil(mjcf))
    return known.keys() == numbers.keys() and all(
        math.isclose(known[name], number, rel_tol=SAME) for name, number in numbers.items()
    )


def _report_csv(
    options: argparse.Namespace,
    part: str,
    figures: Mapping[str, Any],
    checks: Sequence[Check],
    tables: Sequence[ResultTable],
    csv: str,
) -> bool:
    """Write a curve or a field to its file or to stdout; return True if no bound is broken."""
    if options.out:
        save_text(options.out, csv)
    elif not options.json:
        print(csv, end="")
        return report_broken(f"magnetics {part}", checks)
    return print_result(options, f"magnetics {part}", figures, tables, checks, written=[options.out])


PARTS = {"curve": run_curve, "field": run_field, "hoop": run_hoop, "check": run_check, "map": run_map}
