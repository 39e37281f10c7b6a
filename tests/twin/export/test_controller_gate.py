"""Gate of the exported control tick: a refused tick changes nothing; after wrong ones the loop recovers."""

from functools import cache

import numpy as np
import pytest

from tests.requirements import needs_c_compiler
from tests.twin.export.generated import CController, CPlant
from tests.twin.export.test_controller_code import CASES

pytestmark = needs_c_compiler

DELAY = {"nominal.delay_s": 1.5e-3}
LAWS = {"pd": {}, "pid": {}, "lqi": DELAY, "afsm": {}, "afsm_eso": DELAY}
ESTIMATORS = ("ideal", "difference", "kalman", "differentiator")
REFERENCE, ANGLE, RATE = 0, 1, 2
"""Arguments of a tick."""


@pytest.fixture(scope="module")
def started(tmp_path_factory):
    """Return the controller of changes at its start; each is compiled once."""

    @cache
    def compiled(changes, single):
        return CController(tmp_path_factory.mktemp("controller"), "hold", dict(changes), single)

    def start(changes, single=False):
        fields = {
            name: value if not isinstance(value, list) else tuple(value) for name, value in changes.items()
        }
        controller = compiled(tuple(fields.items()), single)
        controller.start()
        return controller

    return start


@pytest.fixture(scope="module")
def c_plant(tmp_path_factory):
    return CPlant(tmp_path_factory.mktemp("plant"), "hold", {})


def still():
    """Arguments of a tick near rest."""
    return [np.zeros((3, 3)), np.array([0.01, -0.02, 0.03]), np.array([0.1, 0.2, -0.1])]


def with_value(argument, place, value):
    arguments = still()
    arguments[argument].flat[place] = value
    return arguments


BAD = [
    (argument, place, value)
    for argument, places in ((REFERENCE, (0, 4, 8)), (ANGLE, (0, 2)), (RATE, (1,)))
    for place in places
    for value in (np.nan, np.inf, -np.inf, 1e30, -1e6)
]


@pytest.mark.parametrize("single", [False, True], ids=["double", "single"])
@pytest.mark.parametrize(
    "case", ["pid", "robust", pytest.param("afsm", marks=pytest.mark.release("compiler, 2 s"))]
)
def test_a_refused_tick_has_no_effect(case, single, started):
    controller = started(CASES[case], single)
    assert controller.tick(*still())[0] > 0
    before = controller.memory
    for argument, place, value in BAD:
        if argument == RATE and "estimator.kind" in CASES[case]:
            continue  # the rate is not read
        share, command = controller.tick(*with_value(argument, place, value))
        assert share == -1, (argument, place, value)
        np.testing.assert_array_equal(command, 0)
        np.testing.assert_array_equal(controller.memory, before)
    assert controller.tick(*still())[0] > 0


def test_bounds_are_those_of_the_machine(started):
    controller = started(CASES["pid"] | {"watchdog.largest_rate_rad_s": 20.0, "estimator.kind": "ideal"})
    limits = {
        (ANGLE, 0): np.radians(80) + 0.1,
        (REFERENCE, 0): np.radians(80) + 0.1,
        (ANGLE, 2): 2 * np.pi,  # without an end: distance from the desired angle
        (REFERENCE, 4): 20.0,
        (RATE, 1): 20.0,
        (REFERENCE, 7): 1e4,
    }
    for (argument, place), limit in limits.items():
        for sign in (-1, 1):
            controller.start()
            assert controller.tick(*with_value(argument, place, sign * limit * (1 - 1e-9)))[0] > 0, (
                argument,
                place,
            )
            assert controller.tick(*with_value(argument, place, sign * limit * (1 + 1e-9)))[0] == -1


GLITCHES = {
    "angle": (ANGLE, 1, 1.4),
    "angle without an end": (ANGLE, 2, 6.2),
    "rate": (RATE, 0, 60.0),
    "desired angle": (REFERENCE, 0, 1.4),
    "desired rate": (REFERENCE, 4, 60.0),
    "desired acceleration": (REFERENCE, 7, 1e4),
    "dropout": (ANGLE, slice(None), np.nan),
}


def errors(controller, c_plant, load, glitch=None, ticks=1000, first=300, count=1):
    """Largest angle after each tick of a loop that holds the pose 0, with wrong inputs for some ticks."""
    c_plant.reset()
    controller.start()
    u, largest = np.zeros(21), np.empty(ticks)
    u[18] = load
    for tick in range(ticks):
        arguments = [np.zeros((3, 3)), c_plant.x[:3].copy(), c_plant.x[3:6].copy()]
        if glitch and first <= tick < first + count:
            argument, place, value = glitch
            arguments[argument].flat[place] = value
        u[:18] = controller.tick(*arguments)[1]
        assert np.isfinite(u).all()
        assert c_plant.advance(u, 1e-3)[0] == 0, "the rotor left its workspace"
        largest[tick] = np.abs(c_plant.x[:3]).max()
    return largest


RARE = pytest.mark.release(
    "compiler and 8 s of simulated time a case; the others have each law and each estimator"
)
SOME = {("pid", "differentiator"), ("lqi", "difference"), ("afsm_eso", "kalman")}


@pytest.mark.parametrize(
    ("law", "estimator"),
    [
        pytest.param(law, estimator, marks=() if (law, estimator) in SOME else RARE)
        for law in LAWS
        for estimator in ESTIMATORS
    ],
)
def test_the_loop_recovers_from_accepted_wrong_inputs(law, estimator, started, c_plant):
    """A wrong tick within the bounds, and a dropout of 50 ticks: after 0.4 s the pose is held as before."""
    controller = started({"controller.law": law, "estimator.kind": estimator, **LAWS[law]})
    load = 0.0 if law == "pd" else 0.02  # PD alone has an error under a load
    undisturbed = errors(controller, c_plant, load)[700:].max()
    # AFSM never reduces its switching gains: they stay larger, and so does the chattering.
    bound = {"afsm": 0.2, "pd": 0.05}.get(law, 2e-3)
    for name, glitch in GLITCHES.items():
        disturbed = errors(controller, c_plant, load, glitch, count=50 if name == "dropout" else 1)
        assert disturbed[700:].max() < undisturbed + bound, name
        assert disturbed.max() < 0.3, name
