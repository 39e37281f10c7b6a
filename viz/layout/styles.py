"""Names and colours of plotted signals."""

import rerun as rr

from spheretwin.models.telemetry.signals import ANGLES, AXES, Signal
from spheretwin.viz import palette
from spheretwin.viz.layout.paths import entity


def log_styles(recording: rr.RecordingStream, signals: tuple[Signal, ...]) -> None:
    """Log names with units and colours of every plotted signal."""
    for signal in signals:
        names = [
            f"{_short(signal)} {label} [{signal.unit}]".replace("  ", " ") for label in signal.labels or ("",)
        ]
        style = rr.SeriesLines(names=names, colors=_colours(signal), widths=[1.5] * len(names))
        recording.log(entity(signal.name), style, static=True)


def _short(signal: Signal) -> str:
    """Name without its unit, which stands in brackets behind it."""
    for suffix in ("_rad_s", "_rad", "_Nm", "_A", "_s"):
        if signal.name.endswith(suffix):
            return signal.name.removesuffix(suffix)
    return signal.name


def _colours(signal: Signal) -> list[palette.Colour]:
    if signal.size == 3 and signal.labels in ((), ANGLES, AXES):
        desired = signal.name.endswith(("_ref_rad", "_ref_rad_s")) or signal.name == "disturbance_Nm"
        return list(palette.DESIRED_COLOURS if desired else palette.AXIS_COLOURS)
    return palette.group_colours(signal.size)
