"""The sliding surface ``s = lambda e + edot`` (30); linear, although the paper calls it terminal."""

from spheretwin.models.base.compiled import allocation_free
from spheretwin.models.telemetry.signals import ANGLES, Signal

SLIDING_SIGNAL = Signal("sliding_s", "rad/s", 3, "sliding variable s = λe + ė (30)", ANGLES)


@allocation_free
def sliding_surface(error: float, error_rate: float, slope: float) -> float:
    """Distance from the surface on one axis, rad/s: zero where the error decays at rate `slope`."""
    return slope * error + error_rate
