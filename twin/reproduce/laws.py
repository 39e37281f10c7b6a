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


# In the order of the paper, from the largest error to the smallest; then those that it does not have.
COMPARED: tuple[Compared, ...] = (
    Compared("pd", "PD", "K and λ of (58) as damping and stiffness", True),
    Compared("adaptive_fuzzy", "adaptive fuzzy", "(58)", True),
    Compared("afsm", "AFSM", "(58)", True),
    Compared("pid", "tuned PID", "triple pole at 40 1/s"),
)
OF_PAPER = tuple(compared for compared in COMPARED if compared.of_paper)
