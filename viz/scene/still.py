"""What keeps its shape for a whole run."""

from __future__ import annotations

import numpy as np
import rerun as rr

from spheretwin.models.actuator import Actuator
from spheretwin.models.telemetry.facts import RunFacts
from spheretwin.viz import palette
from spheretwin.viz.scene.marks import (
    AXES_LENGTH_m,
    axes,
    current_scale,
    current_scale_labels,
    labels,
    size_of,
)
from spheretwin.viz.scene.meshes import read_meshes
from spheretwin.viz.scene.paths import AXES, COILS, CURRENT_SCALE, PAYLOAD, ROTOR_AXES, WORLD

PAYLOAD_LENGTH_m, PAYLOAD_RADIUS_m = 0.014, 0.011

# The stator's axes stand beside its foot; the rotor's, shorter, around the shaft below a payload.
AXES_AT_m = (-0.085, -0.105, -0.075)
NAMED_AT = 1.15  # of the length: beyond the head
ROTOR_AXES_HEIGHT, ROTOR_AXES_LENGTH_m = 0.6, 0.025


def log_static(recording: rr.RecordingStream, actuator: Actuator, facts: RunFacts) -> None:
    """Log everything that keeps its shape: meshes, axes of both frames, the scale of the coils' colours."""
    recording.log(WORLD, rr.ViewCoordinates.RIGHT_HAND_Z_UP, static=True)
    meshes = read_meshes(facts.mjcf)
    if meshes.coils:
        recording.log(COILS, meshes.coils, static=True)
    for entity, piece in meshes.others.items():
        recording.log(entity, *piece.archetypes(), static=True)
    if facts.payload_kg > 0:
        recording.log(PAYLOAD, _payload(actuator), static=True)
    size = size_of(actuator)
    at, length_m = size * np.array(AXES_AT_m), size * AXES_LENGTH_m
    names = labels(["x", "y", "z"], palette.AXIS_COLOURS)
    ends = rr.Points3D.from_fields(positions=at + NAMED_AT * length_m * np.eye(3))
    recording.log(AXES, axes(at, length_m), names, ends, static=True)
    rotor_axes = axes(ROTOR_AXES_HEIGHT * actuator.shaft_tip_m, size * ROTOR_AXES_LENGTH_m)
    recording.log(ROTOR_AXES, rotor_axes, static=True)
    recording.log(CURRENT_SCALE, current_scale(size), static=True)
    currents = current_scale_labels(facts.current_limit_A, size)
    recording.log(f"{CURRENT_SCALE}/labels", currents, static=True)


def _payload(actuator: Actuator) -> rr.Cylinders3D:
    return rr.Cylinders3D(
        lengths=[PAYLOAD_LENGTH_m],
        radii=[PAYLOAD_RADIUS_m],
        centers=[actuator.payload_mount_m],
        colors=[palette.PAYLOAD],
        fill_mode=rr.components.FillMode.Solid,
    )
