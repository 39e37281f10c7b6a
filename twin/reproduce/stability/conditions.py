"""What each law is put through: loads, ten minutes, delays, inertias, control rates."""

from __future__ import annotations

from typing import Any, NamedTuple

from spheretwin.models.telemetry.status import Status
from spheretwin.twin.reproduce.experiment import Case
from spheretwin.twin.reproduce.laws import COMPARED, Compared

SCENARIO = "sinusoid"

WATCHED: tuple[Compared, ...] = tuple(
    compared
    for compared in COMPARED
    if compared.law in ("afsm", "pid", "afsm_eso")  # one more joins by its name
)

LONG_s = 600.0
LOADS = (1.0, 5.0)
STEP_s = 5e-4

# A margin is looked for beyond its end: a run may be lost there.
ENDS = (Status.COMPLETED, Status.LEFT_WORKSPACE, Status.DIVERGED)


class Margin(NamedTuple):
    """One thing that is made worse step by step."""

    name: str
    unit: str
    steps: tuple[float, ...]
    """From what is healthy on."""


DELAY = Margin("unknown delay", "ms", (0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 12, 14))
HEAVIER = Margin("inertia, heavier: m", "", (0, 0.5, 1, 2, 3, 4, 5, 6, 8, 12, 16))
LIGHTER = Margin("inertia, lighter: m", "", (0, -0.3, -0.5, -0.6, -0.7, -0.8, -0.9, -0.95))
SLOWER = Margin("control rate, slower", "Hz", (1000, 500, 400, 250, 200, 100))
FASTER = Margin("control rate, faster", "Hz", (1000, 2000, 5000, 10000))
MARGINS = (DELAY, HEAVIER, LIGHTER, SLOWER, FASTER)


def cases() -> list[Case]:
    """Everything for every law."""
    found = [reaching(law, load) for law in WATCHED for load in LOADS]
    found += [drift(law) for law in WATCHED]
    by_name = {each.name: each for law in WATCHED for at in MARGINS for each in margin(law, at)}
    return [*found, *by_name.values()]


def reaching(compared: Compared, load: float) -> Case:
    """From rest under a load."""
    return _case(compared, f"L {load:g}", {"disturbance.load": load}, (Status.COMPLETED,))


def drift(compared: Compared) -> Case:
    """Ten minutes on end."""
    return _case(compared, f"{LONG_s:g} s", {"duration": LONG_s}, ENDS)


def margin(compared: Compared, of: Margin) -> list[Case]:
    """A law under every step of a margin."""
    return [_case(compared, *_worse(of, step), ENDS)._replace(compared=False) for step in of.steps]


def _worse(of: Margin, step: float) -> tuple[str, dict[str, Any]]:
    if of is DELAY:  # of which no law is told
        return f"delay {step:g} ms", {"drive.delay_s": 1e-3 * step, "nominal.delay_s": 0.0}
    if of in (HEAVIER, LIGHTER):
        return f"m {step:g}", {"plant.modelling_error": float(step)}
    period_s = 1 / step
    return f"{step:g} Hz", {"controller.period_s": period_s, "plant.step_s": min(STEP_s, period_s)}


def _case(compared: Compared, condition: str, fields: dict[str, Any], ends: tuple[Status, ...]) -> Case:
    return Case(
        name=f"{compared.law}: {condition}",
        scenario=SCENARIO,
        fields={"controller.law": compared.law, **fields},
        told={"condition": condition},
        once=True,
        ends=ends,
    )
