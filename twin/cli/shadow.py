"""``spheretwin shadow LOG``: estimated state of a machine from its log."""

from __future__ import annotations

import argparse
import json
import time

import numpy as np

from spheretwin.cli.common import interruptible, print_json, print_message
from spheretwin.cli.log_options import (
    STREAM,
    STREAMED,
    blocks,
    file_log,
    known_fields,
    live_view,
    scenario_of,
)
from spheretwin.cli.options import verb
from spheretwin.machine.log import Log
from spheretwin.machine.model import model_of
from spheretwin.machine.noise_fit import fit_noise
from spheretwin.machine.state_estimation import (
    Consistency,
    Shadowed,
    ShadowSettings,
    chi2_text,
    followed,
    shadow,
    signals,
)
from spheretwin.models.base.errors import InputError
from spheretwin.models.telemetry.joint_state_server import published
from spheretwin.models.telemetry.signals import ANGLES
from spheretwin.models.telemetry.table import Table, with_currents
from spheretwin.records import outputs
from spheretwin.viz.terminal import runs


@verb(
    f"""{STREAM}
    --fit      fit noise and delay to the log first
    --offsets  estimate the offsets of the angle sensors as well
    --telemetry FILE.parquet  write the estimates
    --record
    --json
    """,
    has_fields=True,
    **STREAMED,
)
def run(options: argparse.Namespace) -> bool:
    """Estimate angles, rates and disturbance torque of a machine from a log.

    The estimator is an extended Kalman filter on the plant of a scenario. Exit code 1 if model and log
    are not consistent.
    """
    outputs.check(options.record, options.telemetry)
    settings = ShadowSettings(offset_walk_rad=1e-5 if options.offsets else None)
    shift = None
    log = file_log(options)
    if log is None and options.fit:
        raise InputError("command line: expected --fit with the file of a log, received a stream")
    model = model_of(scenario_of(options), known_fields(options, log))
    if log:
        if options.fit:
            fitted = fit_noise(log, model, settings)
            settings, shift = fitted.settings, fitted.shift_interval_s
        shadow(log.rows(0, 2), model, settings=settings)  # compiles
    with (
        interruptible() as stop_requested,
        published(options.publish) as publishers,
        live_view(options, model, signals(options.offsets), stop_requested) as view,
    ):

        def show(part: Log, telemetry: Table, verdict: Consistency) -> None:
            if view:
                text = verdict.markdown(part)
                view.show(telemetry, part.current_A, text)
            for publisher in publishers:
                publisher.write(with_currents(telemetry, part.current_A))

        started_s = time.process_time()
        log, result = followed(blocks(options, log, model.groups, stop_requested), model, settings, show)
        cpu_s = time.process_time() - started_s
    cpu_s_per_s = cpu_s / float(log.t_s[-1] - log.t_s[0])
    if options.telemetry:
        metadata = {
            "log": log.name,
            "log_sha256": log.digest,
            "accepted_findings": json.dumps(log.accepted),
            "settings": settings.model_dump_json(),
        }
        result.telemetry.write_parquet(options.telemetry, metadata)
    if options.record:
        from spheretwin.analysis.comparison import subject_of  # Rerun is slow to import
        from spheretwin.viz.comparison import shadow as recording

        verdict = Consistency(result.chi2, result.consistent).markdown(log)
        text = f"{verdict}\n\nSHA-256 of the numbers of the log: {log.digest}"
        subject = subject_of(model.scenario, model.actuator)
        recording.write(options.record, result.telemetry, log.current_A, subject, text)
    if options.json:
        print_json(
            {
                "rows": len(log),
                "log_sha256": log.digest,
                "accepted_findings": list(log.accepted),
                "chi2": result.chi2,
                "consistent": result.consistent,
                "rms_innovation_rad": result.rms_innovation_rad.tolist(),
                "cpu_s_per_s": cpu_s_per_s,
                "settings": settings.model_dump(),
                "shift_interval_s": list(shift) if shift else None,
                "telemetry": str(options.telemetry) if options.telemetry else None,
            }
        )
    else:
        _print(result, settings, shift)
        runs.print_written([path for path in (options.telemetry, options.record) if path])
    if not result.consistent:
        print_message(f"shadow: model and log {log.name} are not consistent")
    return result.consistent


def _print(result: Shadowed, settings: ShadowSettings, shift: tuple[float, float] | None) -> None:
    table, last = result.telemetry, slice(len(result.telemetry) // 2, None)
    deviations = [
        np.sqrt(np.mean(table[f"{name}_std"][last] ** 2, axis=0))
        for name in ("q_estimated_rad", "qdot_estimated_rad_s", "disturbance_estimated_Nm")
    ]
    rows = [
        [
            ANGLES[i],
            chi2_text(chi2),
            f"{1e3 * result.rms_innovation_rad[i]:.3f}",
            f"{1e3 * deviations[0][i]:.3f}",
            f"{1e3 * deviations[1][i]:.2f}",
            f"{1e3 * deviations[2][i]:.2f}",
        ]
        for i, chi2 in enumerate(result.chi2.values())
    ]
    head = [
        "hinge",
        "χ²",
        "innovation mrad rms",
        "± angle mrad",
        "± rate mrad/s",
        "± disturbance mN·m",
    ]
    runs.print_rows(f"shadow, {len(table)} rows", head, rows, 1)
    if shift:
        walk, white, late, low, high = (
            1e3 * value
            for value in (settings.disturbance_walk_Nm, settings.torque_noise_Nm_s, settings.shift_s, *shift)
        )
        print(
            f"fitted: disturbance {walk:.3g} mN·m in a second, white torque {white:.3g} mN·m·√s, currents"
            f" {late:+.2f} ms later than the model's ({low:+.2f} to {high:+.2f})"
        )
