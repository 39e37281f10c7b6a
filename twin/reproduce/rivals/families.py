"""The family of gains of each law: one number, spaced evenly by ratio about what is shipped.

Each gain goes with a power of the number that is its unit's: poles move out along their rays, and the family
is the same wherever it begins. At a ratio of 1 nothing is set, so that it is the law as shipped.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, NamedTuple

from spheretwin.control.laws import (
    adrc,
    afsm_eso,
    backstepping_sliding_mode,
    computed_torque,
    lqi,
    pid,
    super_twisting,
)
from spheretwin.control.laws.adaptive_fuzzy import AdaptiveFuzzy
from spheretwin.control.laws.afsm import AFSM
from spheretwin.control.laws.pd import PD
from spheretwin.control.laws.registry import LAWS

STEP = 1.5
"""Ratio of a setting to the one before."""


class Family(NamedTuple):
    """A law over one number."""

    law: str
    symbol: str
    unit: str
    shipped: float
    """The number where nothing is set."""
    powers: Mapping[str, float]
    """Of the ratio, by which each gain goes."""
    first: int = -2
    """Steps from what is shipped to the lowest setting; seven settings in all."""
    on_prototype: Mapping[str, Any] = {}
    """Fields of the controller from which it begins there instead."""
    aside: str = ""
    """What else moves with the number, in words."""

    @property
    def ratios(self) -> tuple[float, ...]:
        """Of its settings, ascending."""
        return tuple(STEP**step for step in range(self.first, self.first + 7))

    def label(self, ratio: float) -> str:
        """A setting in words."""
        return f"{self.symbol} = {self.shipped * ratio:.3g} {self.unit}".strip()

    def fields(self, ratio: float, prototype: bool) -> dict[str, Any]:
        """Fields of a scenario that make the setting."""
        base = dict(self.on_prototype) if prototype else {}
        shipped = LAWS[self.law](**base)
        gains = {} if ratio == 1 else {name: _times(getattr(shipped, name), ratio**power)
                                       for name, power in self.powers.items()}  # fmt: skip
        return {f"controller.{name}": value for name, value in {"law": self.law, **base, **gains}.items()}


def _times(gains: tuple[float, ...], factor: float) -> list[float]:
    return [gain * factor for gain in gains]


PRESET = "prototype"
"""Of AFSM-ESO, about which its family is on the prototype."""

_TRIPLE = {"stiffness": 2.0, "damping": 1.0, "integral": 3.0}
_SURFACE = {"surface_slope": 1.0, "reaching_gain": 1.0}

# The paper's gains are low for all laws that have them: their families reach further up.
FAMILIES: tuple[Family, ...] = (
    Family("pd", "damping", "1/s", PD().damping[0], {"stiffness": 2.0, "damping": 1.0}, -1),
    Family("adaptive_fuzzy", "K", "1/s", AdaptiveFuzzy().reaching_gain[0], _SURFACE, -1, aside="λ = 2.5 K"),
    Family("afsm", "K", "1/s", AFSM().reaching_gain[0], _SURFACE, -1, aside="λ = 2.5 K"),
    Family("pid", "ω", "1/s", pid.BANDWIDTH_rad_s, _TRIPLE),
    Family(
        "afsm_eso",
        "factor",
        "",
        1.0,
        {
            "surface_slope_1_s": 1.0,
            "reaching_gain_1_s": 1.0,
            "boost_slope_1_s": 1.0,
            "observer_bandwidth_rad_s": 1.0,
            "disturbance_bandwidth_rad_s": 1.0,
            "fast_disturbance_bandwidth_rad_s": 1.0,
        },
        on_prototype={"preset": PRESET},
        aside="of the preset `ideal`, on the prototype of `prototype`; layer and bound of the boost stay",
    ),
    Family("lqi", "ω", "1/s", lqi.BANDWIDTH_rad_s, {"integral_weight": 3.0}),
    Family("computed_torque", "ω", "1/s", computed_torque.BANDWIDTH_rad_s, _TRIPLE),
    Family(
        "backstepping_sliding_mode",
        "ω",
        "1/s",
        backstepping_sliding_mode.BANDWIDTH_rad_s,
        {**_SURFACE, "adaptation_rate": 2.0},
    ),
    Family(
        "super_twisting",
        "ω",
        "1/s",
        super_twisting.BANDWIDTH_rad_s,
        {"surface_slope": 1.0, "root_gain": 1.0, "twisting_gain": 2.0},
    ),
    Family(
        "adrc",
        "observer",
        "1/s",
        adrc.OBSERVER_rad_s[0],
        # Alone or with the feedback at the same power, it does worse on one or the other kind of hardware.
        {"observer_bandwidth": 1.0, "bandwidth": 0.5},
        aside="the feedback's bandwidth by its square root",
    ),
)
BY_LAW = {family.law: family for family in FAMILIES}

MARKED = tuple(afsm_eso.PRESETS)
"""Presets of AFSM-ESO, each a point of its own where its family does not begin there."""
