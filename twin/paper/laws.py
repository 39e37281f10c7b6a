"""Laws of figures 6 to 8, and the errors that the paper prints of them."""

from __future__ import annotations

from collections.abc import Mapping
from typing import NamedTuple


class ComparedLaw(NamedTuple):
    """Law of the figures; its gains are its defaults."""

    law: str
    label: str
    gains: str
    """Origin of the gains."""
    of_paper: bool = False
    in_figures: bool = False
    """Whether the figures show it next to the paper's; the tables and the JSON contain all."""


# In the order of the paper, from the largest error to the smallest; then the laws that it does not have.
COMPARED_LAWS: tuple[ComparedLaw, ...] = (
    ComparedLaw("pd", "PD", "K and λ of (58) as damping and stiffness", True, True),
    ComparedLaw("adaptive_fuzzy", "adaptive fuzzy", "(58)", True, True),
    ComparedLaw("afsm", "AFSM", "(58)", True, True),
    ComparedLaw("pid", "tuned PID", "triple pole at 40 1/s", in_figures=True),
    ComparedLaw("afsm_eso", "AFSM-ESO", "preset ideal", in_figures=True),
    ComparedLaw("lqi", "LQI", "integral's weight at 60 1/s"),
    ComparedLaw("computed_torque", "computed torque", "triple pole at 40 1/s"),
    ComparedLaw("backstepping_sliding_mode", "backstepping SM", "triple pole at 40 1/s"),
    ComparedLaw("super_twisting", "super-twisting", "triple pole at 40 1/s, μ = 8"),
    ComparedLaw("adrc", "ADRC", "140 1/s, observer 80 and 40 1/s"),
)
BY_LAW = {law.law: law for law in COMPARED_LAWS}
PAPER_LAWS = tuple(law for law in COMPARED_LAWS if law.of_paper)

Three = tuple[float, float, float]

PRINTED_rad: Mapping[tuple[float, float], Mapping[str, Three]] = {
    (0.2, 1.0): {
        "pd": (0.4376, 0.4121, 0.4687),
        "adaptive_fuzzy": (0.2505, 0.2822, 0.2669),
        "afsm": (0.0832, 0.0750, 0.0761),
    },
    (0.2, 2.0): {
        "pd": (1.2560, 1.0560, 1.1500),
        "adaptive_fuzzy": (0.8954, 0.9856, 1.0100),
        "afsm": (0.1854, 0.1986, 0.1769),
    },
}
"""By m and L, and by law; of α, β and γ."""


def printed_rad(law: str, m: float, L: float) -> Three | None:
    """Largest errors that the paper prints of a law under a condition; None if it prints none."""
    return PRINTED_rad.get((round(m, 6), round(L, 6)), {}).get(law)
