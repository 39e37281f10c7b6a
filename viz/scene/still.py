"""What keeps its shape for a whole run."""

from __future__ import annotations

from pathlib import Path

import rerun as rr

from spheretwin.models.actuator import Actuator
from spheretwin.viz import palette
from spheretwin.viz.scene.meshes import read_meshes
from spheretwin.viz.scene.paths import TIP, TIP_DESIRED, WORLD


def log_static(recording: rr.RecordingStream, actuator: Actuator, mjcf: Path, payload_kg: float) -> None:
    """Log everything that keeps its shape, and the looks of the traces."""
    log_shapes(recording, actuator, mjcf, payload_kg)
    style_traces(recording, palette.TRACE)


def log_shapes(recording: rr.RecordingStream, actuator: Actuator, mjcf: Path, payload_kg: float) -> None:
    """Log meshes by body and colour, coils as one mesh."""
    recording.log(WORLD, rr.ViewCoordinates.RIGHT_HAND_Z_UP, static=True)
    for entity, mesh in read_meshes(mjcf).items():
        recording.log(entity, mesh, static=True)
    if payload_kg > 0:
        mount = [actuator.payload_mount_m]
        weight = rr.Cylinders3D(lengths=[0.014], radii=[0.011], centers=mount, colors=[palette.TRACE])
        recording.log(f"{WORLD}/rotor/payload", weight, static=True)


def style_traces(recording: rr.RecordingStream, colour: palette.Colour) -> None:
    """Log how the trace of the shaft's tip, in a colour, and that of where it should be look."""
    for entity, of_trace, width in ((TIP, colour, 2.0), (TIP_DESIRED, palette.DESIRED_TRACE, 1.0)):
        style = rr.LineStrips3D.from_fields(colors=[of_trace], radii=rr.Radius.ui_points(width))
        recording.log(entity, style, static=True)
