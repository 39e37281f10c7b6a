"""The laws that figures 6 to 8 compare: one more joins by a row."""

from __future__ import annotations

from typing import NamedTuple


class Compared(NamedTuple):
    """A law of the figures; its gains are its defaults."""

    law: str
    label: str
    gains: str
    """Whose they are."""
    of_paper: bool = False
    drawn: bool = False
    """Whether the figures show it beside the paper's; the tables and the JSON have all."""


# In the order of the paper, from the largest error to the smallest; then those that it does not have.
COMPARED: tuple[Compared, ...] = (
    Compared("pd", "PD", "K and λ of (58) as damping and stiffness", True, True),
    Compared("adaptive_fuzzy", "adaptive fuzzy", "(58)", True, True),
    Compared("afsm", "AFSM", "(58)", True, True),
    Compared("pid", "tuned PID", "triple pole at 40 1/s", drawn=True),
    Compared("afsm_eso", "AFSM-ESO", "preset ideal", drawn=True),
    Compared("lqi", "LQI", "integral's weight at 60 1/s"),
    Compared("computed_torque", "computed torque", "triple pole at 40 1/s"),
    Compared("backstepping_sliding_mode", "backstepping SM", "triple pole at 40 1/s"),
    Compared("super_twisting", "super-twisting", "triple pole at 40 1/s, μ = 8"),
    Compared("adrc", "ADRC", "140 1/s, observer 80 and 40 1/s"),
)
BY_LAW = {compared.law: compared for compared in COMPARED}
OF_PAPER = tuple(compared for compared in COMPARED if compared.of_paper)
