"""What keeps its shape for a whole run."""

from __future__ import annotations

from pathlib import Path

import rerun as rr

from spheretwin.models.actuator import Actuator
from spheretwin.viz import palette
from spheretwin.viz.scene.meshes import read_meshes
from spheretwin.viz.scene.paths import COILS, TIP, TIP_DESIRED, WORLD


def log_static(recording: rr.RecordingStream, actuator: Actuator, mjcf: Path, payload_kg: float) -> None:
    """Log everything that keeps its shape: meshes by body, coils as one mesh."""
    recording.log(WORLD, rr.ViewCoordinates.RIGHT_HAND_Z_UP, static=True)
    meshes = read_meshes(mjcf)
    if meshes.coils:
        recording.log(COILS, meshes.coils, static=True)
    for entity, piece in meshes.others.items():
        recording.log(entity, *piece.archetypes(), static=True)
    if payload_kg > 0:
        mount = [actuator.payload_mount_m]
        weight = rr.Cylinders3D(lengths=[0.014], radii=[0.011], centers=mount, colors=[palette.TRACE])
        recording.log(f"{WORLD}/rotor/payload", weight, static=True)
    _style_traces(recording)


def _style_traces(recording: rr.RecordingStream) -> None:
    for entity, colour, width in ((TIP, palette.TRACE, 2.0), (TIP_DESIRED, palette.DESIRED_TRACE, 1.0)):
        style = rr.LineStrips3D.from_fields(colors=[colour], radii=rr.Radius.ui_points(width))
        recording.log(entity, style, static=True)
