"""Motion of both engines against end stops and static friction of another section: what breaks the rows."""

import pytest

from spheretwin.crosscheck import end_stops, stiction
from spheretwin.models import actuator as actuators

SECTIONS = {end_stops: "end stops", stiction: "static friction"}


def checks_of(module, actuator):
    checks = module.compare(actuators.MJCF_PATH, actuator).checks
    names = [f"{SECTIONS[module]}: motion, {engine}" for engine in ("MuJoCo", "Lagrangian")]
    assert [check.name for check in checks] == names
    return checks


@pytest.mark.parametrize(
    ("module", "share"), [(end_stops, 0.5), (stiction, 0.1)], ids=["end stops", "friction"]
)
def test_every_bound_is_met_with_a_margin(actuator, module, share):
    for check in checks_of(module, actuator):
        assert check.value < share * check.bound, check.name
        assert check.unit == "rad/s"


@pytest.mark.parametrize(
    ("module", "field", "value"),
    [
        (end_stops, "travel_rad", 0.055),
        (end_stops, "stiffness_Nm_rad", 1700.0),
        (end_stops, "damping_ratio", 0.35),
        (stiction, "break_away", 1.4),
        (stiction, "presliding_rad", 1.2e-3),
        (stiction, "stribeck_rad_s", 0.1),
        (stiction, "damping_ratio", 1.0),
    ],
)
def test_a_reference_with_another_coefficient_breaks_both_motions(
    actuator, module, field, value, monkeypatch
):
    right = module.Reference

    def other(actuator, section, *rest):
        return right(actuator, section.model_copy(update={field: value}), *rest)

    monkeypatch.setattr(module, "Reference", other)
    assert not any(check.ok for check in checks_of(module, actuator))


def test_smoothed_friction_in_the_plant_breaks_both_motions(actuator, monkeypatch):
    reference = stiction.Reference(actuator, stiction.STICTION, stiction.COULOMB_Nm)
    states = reference.integrate(stiction.START_rad, stiction.DURATION_s)
    monkeypatch.setattr(stiction.Reference, "integrate", lambda *_: states)
    monkeypatch.setattr(stiction, "STICTION", stiction.STICTION.model_copy(update={"on": False}))
    assert not any(check.ok for check in checks_of(stiction, actuator))
