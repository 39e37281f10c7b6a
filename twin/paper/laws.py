"""Laws of figures 6 to 8, and the errors that the paper prints of them."""

from __future__ import annotations

import tomllib
from collections.abc import Mapping
from importlib import resources
from typing import Any, NamedTuple


class ComparedLaw(NamedTuple):
    """Law of the figures; its gains are its defaults."""

    law: str
    label: str
    gains: str
    """Origin of the gains."""
    of_paper: bool = False
    in_figures: bool = False
    """Whether the figures show it next to the paper's; the tables and the JSON contain all."""


_CONTENT = tomllib.loads((resources.files("spheretwin.paper") / "laws.toml").read_text(encoding="utf-8"))
COMPARED_LAWS = tuple(ComparedLaw(**law) for law in _CONTENT["law"])
BY_LAW = {law.law: law for law in COMPARED_LAWS}
PAPER_LAWS = tuple(law for law in COMPARED_LAWS if law.of_paper)

TABLES: Mapping[str, Any] = _CONTENT["table"]
"""Tables that several experiments have."""

Three = tuple[float, float, float]

PRINTED_rad: Mapping[tuple[float, float], Mapping[str, Three]] = {
    (condition["m"], condition["L"]): {law: tuple(errors) for law, errors in condition["error_rad"].items()}
    for condition in _CONTENT["printed"]
}
"""By m and L, and by law; of α, β and γ."""


def printed_rad(law: str, m: float, L: float) -> Three | None:
    """Largest errors that the paper prints of a law under a condition; None if it prints none."""
    return PRINTED_rad.get((round(m, 6), round(L, 6)), {}).get(law)
