"""What the paper prints: largest errors of the sinusoid, the only numbers of its simulations."""

from __future__ import annotations

from collections.abc import Mapping

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
    """Largest errors that are printed of a law under a condition; None where there are none."""
    return PRINTED_rad.get((round(m, 6), round(L, 6)), {}).get(law)
