"""End stops and static friction of both engines against references without a step."""

import dataclasses
from functools import partial

import numpy as np
import pytest

from spheretwin.crosscheck import coil_driven
from spheretwin.crosscheck.coil_driven import ENGINES
from spheretwin.crosscheck.scale import scale_of
from spheretwin.crosscheck.trajectories import convergence
from spheretwin.models import actuator as actuators
from spheretwin.models.lagrangian import inertia_matrix
from spheretwin.plant.bristle_friction import StictionSection
from tests.twin.crosscheck import end_stop_reference as end_stops
from tests.twin.crosscheck import stick_slip_reference as stiction
from tests.twin.crosscheck.commands import MACHINES, machine

ORDER_STEPS_s = (1e-3, 5e-4, 2.5e-4, 1.25e-4, 6.25e-5)


def expected_motion(module, mjcf, actuator, share=1.0):
    """Return the states of the reference, and the bound of the rates."""
    scale = scale_of(actuator)
    if module is end_stops:
        states, contacts = end_stops.Reference(actuator, end_stops.stops(scale), mjcf).integrate()
        return states, end_stops.bound_rad_s(actuator, states, contacts)
    levels = scale.torques_Nm(stiction.COULOMB_Nm)
    reference = stiction.Reference(actuator, stiction.STICTION, levels, mjcf, share * scale.torque)
    states, break_aways = reference.integrate(scale.pose_rad(stiction.START_rad), stiction.DURATION_s)
    return states, stiction.bound_rad_s(actuator, break_aways)


def shares_of_bound(module, mjcf, actuator):
    """Return the largest difference of a rate of each engine over its bound."""
    expected, bound = expected_motion(module, mjcf, actuator)
    of = actuator if module is end_stops else scale_of(actuator)
    motions = [module.by_plant(mjcf, of, engine) for engine in ENGINES.values()]
    return [float(np.abs(motion - expected)[:, 3:].max()) / bound for motion in motions]


def order_of(actuator, share):
    """Return the order of the Lagrangian plant under a share of the torques."""
    mjcf, scale = actuators.MJCF_PATH, scale_of(actuator)
    expected, _ = expected_motion(stiction, mjcf, actuator, share)
    method = partial(stiction.by_plant, mjcf, scale, "lagrangian", share=share)
    return convergence(lambda step_s: method(step_s=step_s), expected, ORDER_STEPS_s).order


@pytest.mark.parametrize(
    ("module", "value"), [(end_stops, 5.506e-3), (stiction, 1.4117e-4)], ids=["end stops", "friction"]
)
def test_both_engines_follow_the_reference_within_the_bound(actuator, module, value):
    _, bound = expected_motion(module, actuators.MJCF_PATH, actuator)
    assert bound == pytest.approx({end_stops: 4.93385e-2, stiction: 3.61903e-3}[module], rel=1e-5)
    shares = shares_of_bound(module, actuators.MJCF_PATH, actuator)
    assert shares == pytest.approx([value / bound] * 2, rel=1e-3)


@pytest.mark.release("compiles loops of another machine")
@pytest.mark.parametrize("kind", MACHINES)
@pytest.mark.parametrize("module", [end_stops, stiction], ids=["end stops", "friction"])
def test_both_engines_follow_the_reference_on_other_machines(tmp_path, module, kind):
    mjcf = machine(kind, tmp_path)
    assert max(shares_of_bound(module, mjcf, actuators.load(mjcf))) < 1


def test_the_order_is_2_within_presliding_and_1_where_the_stribeck_effect_reverses(actuator):
    """A step finds neither the instant of a break-away nor that of a reversal: order 1."""
    assert order_of(actuator, 0.5) == pytest.approx(2.03, abs=0.05)
    assert order_of(actuator, 1.0) == pytest.approx(1.0, abs=0.3)


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
    assert min(shares_of_bound(module, actuators.MJCF_PATH, actuator)) > 1


def test_smoothed_friction_in_the_plant_breaks_both_motions(actuator, monkeypatch):
    reference = stiction.Reference(actuator, stiction.STICTION, stiction.COULOMB_Nm)
    states = reference.integrate(stiction.START_rad, stiction.DURATION_s)
    monkeypatch.setattr(stiction.Reference, "integrate", lambda *_: states)
    monkeypatch.setattr(stiction, "STICTION", stiction.STICTION.model_copy(update={"on": False}))
    assert min(shares_of_bound(stiction, actuators.MJCF_PATH, actuator)) > 1


def test_the_reference_breaks_away_and_slides_as_its_equations_say(actuator, monkeypatch):
    """Hinge γ alone, under three times its level: elastic swing, break-away, then uniform acceleration."""
    J, load = actuator.inertia[2], 6e-3
    monkeypatch.setattr(stiction, "torque_Nm", lambda t: np.array([0.0, 0.0, load]))
    section = StictionSection(on=True, break_away=1.0, presliding_rad=1e-4, damping_ratio=0.0)
    states, break_aways = stiction.Reference(actuator, section, stiction.COULOMB_Nm).integrate(
        (0.0, 0.0, 0.0), 0.5
    )
    assert break_aways == 1
    t_s, level = stiction.SAMPLE_s * np.arange(len(states)), stiction.COULOMB_Nm[2]
    # Energy at any angle beyond the range: springs and sliders took k (y (q - y) + y²/2) each.
    slip = np.array([0.5e-4, 1e-4])
    spent = level / slip.sum() * np.sum(slip * (states[10:, [2]] - 0.5 * slip), axis=1)
    np.testing.assert_allclose(0.5 * J * states[10:, 5] ** 2, load * states[10:, 2] - spent, rtol=1e-8)
    np.testing.assert_allclose(np.diff(states[10:, 5]) / np.diff(t_s[10:]), (load - level) / J, rtol=1e-8)
    assert not states[:, [0, 1, 3, 4]].any()


def test_the_reference_starts_at_rest_in_its_pose(actuator):
    states, break_aways = stiction.Reference(actuator, stiction.STICTION, stiction.COULOMB_Nm).integrate(
        stiction.START_rad, 0.01
    )
    np.testing.assert_array_equal(states[0], [*stiction.START_rad, 0, 0, 0])
    assert break_aways == 0


def test_without_damping_the_reference_conserves_energy_and_bounces(actuator):
    """At the samples without contact the energy is kinetic."""
    reference = end_stops.Reference(actuator, end_stops.STOPS.model_copy(update={"damping_ratio": 0.0}))
    states, contacts = reference.integrate()
    assert contacts == 1
    inside = np.all(
        np.abs(states[:, :2]) < actuator.hinge_range_rad[:2, 1] - end_stops.STOPS.travel_rad, axis=1
    )
    energies = [0.5 * s[3:] @ inertia_matrix(s[:3], actuator.inertia) @ s[3:] for s in states[inside]]
    np.testing.assert_allclose(energies, energies[0], rtol=1e-8)  # tolerances of DOP853 over 0.2 s


def test_the_motion_starts_before_the_buffer_of_any_model(actuator):
    """A contact that lasts from the start on is not counted, and the bound would be 0."""
    narrow = np.radians([[-40.0, 40.0], [-40.0, 40.0], [-180.0, 180.0]])
    for one in (actuator, dataclasses.replace(actuator, hinge_range_rad=narrow)):
        low, high = (one.hinge_range_rad + end_stops.STOPS.travel_rad * np.array([1.0, -1.0])).T
        start = np.array(end_stops.start_rad(one))
        assert np.all((low < start) & (start < high))
        assert end_stops.Reference(one, end_stops.STOPS).integrate()[1] > 0


def thrown(actuator, ratio, throws, duration_s=20.0):
    """Energy of random throws of 8 rad/s after each step of 0.5 ms, over that at the start."""
    random, step_s, energies = np.random.default_rng(1), 5e-4, []
    ends = actuator.hinge_range_rad + end_stops.STOPS.travel_rad * np.array([1.0, -1.0])
    count = round(duration_s / step_s)
    for _ in range(throws):
        direction = random.normal(size=3)
        fields = {
            "plant.engine": "lagrangian",
            "plant.step_s": step_s,
            "controller.period_s": step_s,
            "plant.initial_rad_s": tuple((8 * direction / np.linalg.norm(direction)).tolist()),
            "plant.initial_rad": tuple(random.uniform(-1, 1, 3).tolist()),
            "plant.end_stops.on": True,
            "plant.end_stops.damping_ratio": ratio,
        }
        states = coil_driven.drive_plant(
            actuators.MJCF_PATH, fields, lambda groups: np.zeros((count, groups)), np.zeros((count, 3)), 1
        )
        beyond = states[:, :3] - np.clip(states[:, :3], *ends.T)
        kinetic = [
            0.5 * v @ inertia_matrix(q, actuator.inertia) @ v
            for q, v in zip(*np.split(states, 2, 1), strict=True)
        ]
        energy = np.array(kinetic) + 0.5 * end_stops.STOPS.stiffness_Nm_rad * (beyond**2).sum(axis=1)
        energies.append(energy / energy[0])
    return np.array(energies)


@pytest.mark.release("20 s; the energy of one hinge is exact in test_end_stops.py")
def test_coupled_hinges_gain_energy_in_end_stops_without_damping_alone(actuator):
    """The figures of `plant.end_stops` and of the page on bench safety."""
    free = thrown(actuator, 0.0, 20)
    assert free.max() == pytest.approx(1.44, abs=0.1)  # a bounce multiplies rounding
    assert np.median(free[:, -1]) == pytest.approx(1.07, abs=0.04)
    damped = thrown(actuator, 0.05, 20)
    assert damped.max() < 1 + 1e-8  # of Runge and Kutta between the contacts
    assert 1e-3 < np.diff(damped).max() < 3e-3
    assert damped[:, -1].max() < 1 + 1e-8
