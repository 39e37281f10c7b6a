"""Friction of a hinge: our stage, and MuJoCo's friction loss and damping, each against ideal friction.

A slow ramp of torque to above the Coulomb level shows how each sticks and breaks away; coasting shows how
each slides and stops. Every bound is what the model itself makes of ideal friction: our stage is late by its
smoothing and by its error of second order, MuJoCo's by the softness of its constraint.
"""

from math import asinh, ceil, hypot, log, sqrt
from typing import NamedTuple

import numpy as np
import pytest

from spheretwin.crosscheck.scale import scale_of
from spheretwin.models import actuator as actuators
from spheretwin.plant.friction import fill_friction
from spheretwin.scenario.hardware import PROTOTYPE_BEARINGS
from spheretwin.scenario.plant_sections import PlantSection
from tests.models.model_files import edited
from tests.twin.crosscheck import hinge as runs
from tests.twin.crosscheck.hinge import GAMMA, Hinge, STEP_s, by_mujoco, by_stage

# The prototype's bearing, and the heavier of the two guesses that its figure is the lighter of.
LEVELS_Nm = (PROTOTYPE_BEARINGS["plant.coulomb_Nm"][GAMMA], 5e-3)
VISCOUS_Nm_s = PROTOTYPE_BEARINGS["plant.viscous_Nm_s"][GAMMA]
SMOOTHING_rad_s = PlantSection.model_fields["friction_smoothing_rad_s"].default

OURS, MUJOCO = "our stage", "MuJoCo"
HELD = {OURS: Hinge.stage_Nm, MUJOCO: Hinge.mujoco_Nm}
START_rad_s, REST_rad_s = 2.0, 2e-3
PUSH = 0.5  # share of the level
SETTLING = 60  # relaxation times at rest: half a level makes them 1.54 times as long, and leaves exp(-39)
RAMP_s = 5.0  # from nothing to the level
VISCOUS_s = 2.0  # of coasting under viscous friction alone
EPSILON = float(np.finfo(np.float64).eps)


class Row(NamedTuple):
    """A value and its bounds."""

    value: float
    bound: float
    at_least: float = 0.0

    @property
    def ok(self):
        return self.at_least <= self.value <= self.bound


def rows(mjcf, actuator):
    """Return the rows of each bearing by what is compared and the way; bearings scale with the inertia."""
    movers = {
        OURS: lambda *motion: by_stage(actuator, *motion),
        MUJOCO: lambda *motion: by_mujoco(mjcf, actuator, *motion),
    }
    inertia, share = float(actuator.inertia[GAMMA]), scale_of(actuator).inertia
    alone = Hinge(inertia, 0.0, share * VISCOUS_Nm_s, SMOOTHING_rad_s)
    hinges = [alone._replace(coulomb_Nm=share * level) for level in LEVELS_Nm]
    result = {}
    for way, move in movers.items():
        result[f"viscous alone, {way}"] = [viscous(way, move, alone)]
        for row in (creep, breakaway):
            result[f"{row.__name__}, {way}"] = [row(way, move, hinge) for hinge in hinges]
    coasts = [{way: coast(move, hinge) for way, move in movers.items()} for hinge in hinges]
    for way in movers:
        for row in (stopping_time, stopping_angle):
            result[f"{row.__name__.replace('_', ' ')}, {way}"] = [
                row(way, hinge, motions[way]) for hinge, motions in zip(hinges, coasts, strict=True)
            ]
    result["sliding"] = [sliding(hinge, motions) for hinge, motions in zip(hinges, coasts, strict=True)]
    return result


def settling(hinge):
    return ceil(SETTLING * hinge.relaxation_s() / STEP_s)


def creep_rad_s(move, hinge):
    """Return the rate under a push below the level, where ideal friction holds."""
    return move(hinge, 0.0, np.full(settling(hinge), PUSH * hinge.coulomb_Nm)).qdot_rad_s[-1]


def creep(way, move, hinge):
    """Torque that creeps at the rate, over that applied: exact for any step.

    Rounding, 2e-16 a step, of the steps that are not forgotten, which are as many as there are in the
    relaxation time, with a margin of five.
    """
    torque = float(HELD[way](hinge, np.array(creep_rad_s(move, hinge))))
    return Row(abs(torque / (PUSH * hinge.coulomb_Nm) - 1), 1e-15 * (10 + hinge.relaxation_s() / STEP_s))


def breakaway_rate_rad_s(hinge):
    """Rate that is called sliding: ten times whatever either way creeps at, or loses in one step."""
    step = STEP_s * hinge.coulomb_Nm / hinge.inertia_kgm2
    return 10 * max(hinge.smoothing_rad_s, step, hinge.coulomb_Nm / hinge.mujoco_soft_Nm_s())


def breakaway(way, move, hinge):
    """Torque of a slow ramp at which the hinge slides, over the level.

    Not after ideal friction, which takes √(2 J v dT/dt) above the level to reach the rate v; not before a
    hinge that crept up to any lower rate, and from there on met no more friction than there.
    """
    level, rate, slope = hinge.coulomb_Nm, breakaway_rate_rad_s(hinge), hinge.coulomb_Nm / RAMP_s
    rise = slope * STEP_s

    def inertial(rates):
        return np.sqrt(2 * hinge.inertia_kgm2 * slope * rates)

    latest = level + hinge.viscous_Nm_s * rate + inertial(rate)
    before = np.linspace(0.0, rate, 1001)
    earliest = np.max(HELD[way](hinge, before) + inertial(rate - before))
    ramp = rise * np.arange(1.0, ceil((2 * latest - level) / rise) + 1)
    slides = move(hinge, 0.0, ramp).qdot_rad_s[1:] >= rate
    passed = ramp[np.argmax(slides)] if slides.any() else np.nan
    return Row(passed / level, (latest + rise) / level, (earliest - rise) / level)


def coast(move, hinge):
    still = np.zeros(ceil(hinge.ideal_time_s(START_rad_s) / STEP_s) + settling(hinge))
    return move(hinge, START_rad_s, still)


def stopping_time(way, hinge, motion):
    """Time in which the hinge coasts to a thousandth of its rate, less the exact one of ideal friction."""
    stopped_s = STEP_s * np.argmax(motion.qdot_rad_s <= REST_rad_s)
    late_s = delay_s(way, hinge, REST_rad_s) + STEP_s
    return Row(abs(stopped_s - hinge.ideal_time_s(START_rad_s, REST_rad_s)), late_s)


def delay_s(way, hinge, to_rad_s):
    """Return the delay of the hinge at a rate, compared with ideal friction.

    Ours is late by what the level lacks, 1 - v/√(v² + smoothing²) of it, summed up over the motion, and by
    the error of the stage: r² h/2 at most while half a step takes the share r of the rate, which sums up to
    r h/2, and two steps for the rest. MuJoCo's soft constraint brakes exponentially below its grip.
    """
    if way == OURS:
        lacking = lacking_rad_s(hinge, START_rad_s) - lacking_rad_s(hinge, to_rad_s)
        error = STEP_s * min(0.5 * hinge.stage_loss_rad_s() / to_rad_s, 2.0)
        return error + hinge.inertia_kgm2 / hinge.coulomb_Nm * lacking
    grip = max(min(hinge.mujoco_grip_rad_s(), START_rad_s), to_rad_s)
    return log(grip / to_rad_s) / hinge.mujoco_relaxation_1_s() - hinge.ideal_time_s(grip, to_rad_s)


def lacking_rad_s(hinge, rate_rad_s):
    """Return an integral of √(1 + (smoothing/v)²) - 1 over the rate v."""
    smoothing = hinge.smoothing_rad_s
    return hypot(rate_rad_s, smoothing) - rate_rad_s - smoothing * asinh(smoothing / rate_rad_s)


def stopping_angle(way, hinge, motion):
    """Angle until nothing is left, less the exact one of ideal friction; bounds as of the delay."""
    value = abs(motion.q_rad[-1] - hinge.ideal_angle_rad(START_rad_s))
    if way == OURS:
        v, smoothing = START_rad_s, hinge.smoothing_rad_s
        # The integral of √(v² + smoothing²) - v over the rate.
        lacking = 0.5 * (v * hypot(v, smoothing) + smoothing**2 * asinh(v / smoothing) - v**2)
        loss = hinge.stage_loss_rad_s()  # the delay at each rate, summed up, and two steps at the loss
        error = STEP_s * min(loss, v) * (2.0 + 0.5 * log(1 + v / loss))
        return Row(value, error + hinge.inertia_kgm2 / hinge.coulomb_Nm * lacking)
    grip = min(hinge.mujoco_grip_rad_s(), START_rad_s)
    # The force has a corner within a step, which RK4 does not see.
    corner = STEP_s**2 * (hinge.coulomb_Nm + hinge.viscous_Nm_s * grip) / hinge.inertia_kgm2
    return Row(value, grip / hinge.mujoco_relaxation_1_s() - hinge.ideal_angle_rad(grip) + corner)


def sliding(hinge, motions):
    """Difference of both ways while both slide: the largest deceleration times the delay of our stage."""
    slowest = min(max(breakaway_rate_rad_s(hinge), hinge.mujoco_grip_rad_s()), START_rad_s)
    slides = motions[MUJOCO].qdot_rad_s >= slowest
    apart = np.abs(motions[OURS].qdot_rad_s - motions[MUJOCO].qdot_rad_s)[slides]
    deceleration = (hinge.coulomb_Nm + hinge.viscous_Nm_s * START_rad_s) / hinge.inertia_kgm2
    late = deceleration * delay_s(OURS, hinge, slowest)
    return Row(np.max(apart), late + len(apart) * EPSILON * START_rad_s)


def viscous(way, move, hinge):
    """Coasting under viscous friction alone, with the exact decay.

    Half a step of ours leaves 1/(1 + x + x²/2) of the rate, x = viscous h/2J, which is exp(-x) times at most
    exp(x³/6); RK4 truncates x⁵/120 a step at x = viscous h/J. Rounding is 2e-16 in each part of a step.
    """
    count, share = round(VISCOUS_s / STEP_s), hinge.viscous_Nm_s * STEP_s / hinge.inertia_kgm2
    steps = np.arange(count + 1.0)
    exact = START_rad_s * np.exp(-share * steps)
    parts, truncation = (
        (2, np.max(exact * np.expm1((0.5 * share) ** 3 / 3 * steps)))
        if way == OURS
        else (1, count * START_rad_s * share**5 / 120)
    )
    value = np.max(np.abs(move(hinge, START_rad_s, np.zeros(count)).qdot_rad_s - exact))
    return Row(value, truncation + parts * count * EPSILON * START_rad_s)


def broken(mjcf, actuator):
    """Return the names of the rows with a value beyond its bounds."""
    return {name for name, row in rows(mjcf, actuator).items() if not all(part.ok for part in row)}


@pytest.fixture(scope="module")
def shipped(actuator):
    return rows(actuators.MJCF_PATH, actuator)


VALUES = {
    "breakaway, our stage": (1.1602, 1.0924),
    "breakaway, MuJoCo": (1.2131, 1.1335),
    "stopping time, our stage": (17.0582e-3, 7.0831e-3),
    "stopping time, MuJoCo": (8.0582e-3, 16.5831e-3),
    "stopping angle, our stage": (3.55748e-4, 1.45023e-4),
    "stopping angle, MuJoCo": (4.94006e-5, 1.234785e-4),
    "sliding": (4.597612e-4, 4.661099e-4),
}
"""Of 2 and 5 mN·m, in s, rad and rad/s; the values of other rows are rounding."""


def test_every_row_keeps_its_bounds_and_what_is_no_rounding_its_value(shipped):
    for name, row in shipped.items():
        assert all(part.ok for part in row), (name, row)
        expected = VALUES.get(name, (0.0, 0.0)[: len(row)])
        assert [part.value for part in row] == pytest.approx(expected, rel=2e-5, abs=1e-11)
    assert len(shipped) == 11
    late_s = {name: [part.bound for part in shipped[f"stopping time, {name}"]] for name in (OURS, MUJOCO)}
    assert late_s[OURS] == pytest.approx([17.3364e-3, 7.2927e-3], rel=1e-5)
    assert late_s[MUJOCO] == pytest.approx([8.4899e-3, 16.8079e-3], rel=1e-5)


def test_below_its_level_our_stage_creeps_by_its_smoothing_and_mujoco_by_its_softness(actuator):
    """In the limit of a small step, smoothing T/√(level² - T²); and (1 - d) T/(d b J)."""
    alone = Hinge(actuator.inertia[GAMMA], 0.0, VISCOUS_Nm_s, SMOOTHING_rad_s)
    for level in LEVELS_Nm:
        hinge = alone._replace(coulomb_Nm=level)
        ours = creep_rad_s(lambda *motion: by_stage(actuator, *motion), hinge)
        assert ours == pytest.approx(0.01 * PUSH / sqrt(1 - PUSH**2), rel=1e-3)
        theirs = creep_rad_s(lambda *motion: by_mujoco(actuators.MJCF_PATH, actuator, *motion), hinge)
        b = 2 / (0.95 * 0.02)
        assert theirs == pytest.approx(0.1 / 0.9 / b / hinge.inertia_kgm2 * PUSH * level, rel=5e-5)


@pytest.mark.release("4 s; the shipped actuator keeps its bounds above")
@pytest.mark.parametrize("share", [1e-3, 0.1, 10.0])
def test_bounds_hold_for_actuators_of_other_inertia(tmp_path, share):
    moments = " ".join(f"{share * moment:.9g}" for moment in (2.219e-3, 2.176e-3, 2.256e-3))
    model = edited(tmp_path, ("2.219e-3 2.176e-3 2.256e-3", moments))
    assert broken(model, actuators.load(model)) == set()


def test_options_of_a_file_change_nothing(tmp_path, actuator, shipped):
    model = edited(
        tmp_path,
        ("<option ", '<option gravity="0 0 -5" solver="PGS" iterations="1" noslip_iterations="9" '),
        ('contact="disable"', 'contact="disable" frictionloss="disable" damper="disable" sleep="enable"'),
        ('axis="0 0 1"', 'axis="0 0 1" solreffriction="0.1 2" solimpfriction="0.5 0.6 0.1 0.5 2"'),
    )
    assert rows(model, actuator) == shipped


SLIDES = {"stopping time, our stage", "stopping angle, our stage", "sliding"}
CREEP, BREAKAWAY, VISCOUS = "creep, our stage", "breakaway, our stage", "viscous alone, our stage"


@pytest.mark.release("2 to 4 s; the right stage keeps its bounds above")
@pytest.mark.parametrize(
    ("level", "viscous", "smoothing", "step", "rows"),
    [
        (0.997, 1, 1, 1, SLIDES | {CREEP}),
        (0.95, 1, 1, 1, SLIDES | {CREEP, BREAKAWAY}),
        (1, 1.001, 1, 1, {CREEP, VISCOUS}),
        (1, 1, 1.5, 1, SLIDES | {CREEP, BREAKAWAY}),
        (1, 1, 1, 2, SLIDES | {CREEP, BREAKAWAY, VISCOUS}),
    ],
)
def test_a_wrong_stage_breaks_its_rows(monkeypatch, actuator, level, viscous, smoothing, step, rows):
    def wrong(rows, C, c, s, h):
        fill_friction(rows, level * C, viscous * c, smoothing * s, step * h)

    monkeypatch.setattr(runs, "fill_friction", wrong)
    assert broken(actuators.MJCF_PATH, actuator) == rows


MUJOCO_STOPS = {"stopping time, MuJoCo", "stopping angle, MuJoCo"}


@pytest.mark.release("2 to 4 s; the right stage keeps its bounds above")
@pytest.mark.parametrize(
    ("field", "share", "rows"),
    [
        ("dof_frictionloss", 0.999, MUJOCO_STOPS | {"breakaway, MuJoCo", "sliding"}),
        ("dof_damping", 0.999, MUJOCO_STOPS | {"creep, MuJoCo", "viscous alone, MuJoCo"}),
        ("dof_solref", 1.01, MUJOCO_STOPS | {"creep, MuJoCo"}),
    ],
)
def test_another_constraint_breaks_its_rows(monkeypatch, actuator, field, share, rows):
    right = runs._with_bearing

    def other(original, actuator, hinge):
        changed = right(original, actuator, hinge)
        getattr(changed.bare, field)[runs.GAMMA] *= share
        return changed

    monkeypatch.setattr(runs, "_with_bearing", other)
    assert broken(actuators.MJCF_PATH, actuator) == rows
