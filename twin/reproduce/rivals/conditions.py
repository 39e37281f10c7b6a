"""Where the laws are compared, and the case of every setting of each."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, NamedTuple

from spheretwin.models.telemetry.status import Status
from spheretwin.twin.reproduce.experiment import Case
from spheretwin.twin.reproduce.rivals.families import BY_LAW, MARKED, PRESET, Family

# The ends of a family may be beyond what the rotor bears: that is seen, and no failure.
ENDS = (Status.COMPLETED, Status.LEFT_WORKSPACE, Status.DIVERGED, Status.FAILSAFE)

GOVERNED_rad_s2, FRICTION = 40.0, 0.8

# Said in full, whatever a preset brings along.
BARE: dict[str, Any] = {
    "controller.governor.acceleration_rad_s2": None,
    "controller.feed_forward.friction": 0.0,
    "controller.feed_forward.inertia": 0.0,
}
AROUND: dict[str, Any] = {
    **BARE,
    "controller.governor.acceleration_rad_s2": GOVERNED_rad_s2,
    "controller.feed_forward.friction": FRICTION,
}

FED = ("pid",)
"""Laws that leave out the reference's acceleration: behind a governor its torque is fed forward to them."""

PAIRED = ("afsm_eso", "pid", "adrc")
"""The law that is held against others, and these."""


class Setting(NamedTuple):
    """Hardware, motion and load on which fronts are drawn."""

    name: str
    title: str
    scenario: str
    fields: Mapping[str, Any]
    hinges: tuple[int, ...]
    """Of which the worst one counts."""
    bounds_A_s: tuple[float, float]
    """Variations within which each law's best is told."""
    prototype: bool = False
    laws: tuple[str, ...] = tuple(BY_LAW)

    @property
    def families(self) -> list[Family]:
        """Of its laws."""
        return [BY_LAW[law] for law in self.laws]


def _sinusoid(m: float, L: float) -> Setting:
    return Setting(
        f"m {m:g}, L {L:g}",
        f"sinusoid, ideal hardware, m = {m:g}, L = {L:g}",
        "sinusoid",
        {"plant.modelling_error": m, "disturbance.load": L},
        (0, 1, 2),
        (10.0, 30.0),
    )


# γ's encoder counts in steps that no law sees within.
_TILT = Setting(
    "prototype", "tilt, prototype", "tilt", {"hardware": "prototype", **BARE}, (0, 1), (25.0, 100.0), True
)
EASY, HARD, BARE_TILT = _sinusoid(0.2, 1.0), _sinusoid(0.5, 5.0), _TILT
GOVERNED_TILT = _TILT._replace(
    name="prototype, governed",
    title="tilt, prototype, governor and feed-forward",
    fields={"hardware": "prototype", **AROUND},
    laws=PAIRED,
)
IDEAL, PROTOTYPE = (EASY, HARD), (BARE_TILT, GOVERNED_TILT)
SETTINGS = (*IDEAL, *PROTOTYPE)


def cases() -> list[Case]:
    """Every setting of every law, then the presets, one kind of hardware after the other."""
    return [each for setting in SETTINGS for each in (*_of_families(setting), *_of_presets(setting))]


def case(setting: Setting, family: Family, ratio: float) -> Case:
    """A law at one of its settings."""
    fields = family.fields(ratio, setting.prototype)
    if setting is GOVERNED_TILT and family.law in FED:
        fields["controller.feed_forward.inertia"] = 1.0
    # Beyond what is shipped a loop may hunt, and then amplifies what rounding leaves.
    told = {"gain": family.label(ratio), "ratio": ratio}
    return _case(setting, family.law, family.label(ratio), fields, told, ratio <= 1)


def marked(setting: Setting, preset: str) -> Case:
    """AFSM-ESO with a preset that its family does not begin at."""
    fields = {"controller.law": "afsm_eso", "controller.preset": preset}
    return _case(setting, "afsm_eso", f"preset {preset}", fields, {"gain": f"preset {preset}"}, False)


def presets(setting: Setting) -> list[str]:
    """Presets that are points of their own; without what stands around a law alone."""
    if setting is GOVERNED_TILT:
        return []
    begun = PRESET if setting.prototype else "ideal"
    return [preset for preset in MARKED if preset != begun]


def _of_families(setting: Setting) -> list[Case]:
    return [case(setting, family, ratio) for family in setting.families for ratio in family.ratios]


def _of_presets(setting: Setting) -> list[Case]:
    return [marked(setting, preset) for preset in presets(setting)]


def _case(
    setting: Setting, law: str, gain: str, fields: dict[str, Any], told: dict[str, Any], compared: bool
) -> Case:
    return Case(
        name=f"{law}, {gain}: {setting.name}",
        scenario=setting.scenario,
        fields={**setting.fields, **fields},
        told={"setting": setting.name, **told},
        ends=ENDS,
        compared=compared,
    )
