"""Gate of the C plant: numbers beyond their bounds are refused, and leave states and results as they were."""

import numpy as np
import pytest

from spheretwin.export.plant_code import plant_code
from spheretwin.models.base.errors import InputError
from tests.requirements import needs_c_compiler
from tests.twin.export.generated import UNTOUCHED, CPlant

OK, DIVERGED, INVALID = 0, 2, 3
BAD = (np.nan, np.inf, -np.inf, 1e300)

pytestmark = needs_c_compiler


@pytest.fixture(scope="module")
def compiled_plant(tmp_path_factory):
    changes = {"plant.coulomb_Nm": [2e-3] * 3, "plant.thermal.on": True, "drive.supply_V": 24.0}
    return CPlant(tmp_path_factory.mktemp("plant"), "nutation", changes)


@pytest.fixture
def c_plant(compiled_plant):
    compiled_plant.reset()
    return compiled_plant


def entries(c_plant, u, x):
    """Verdict of each entry for inputs and states; none may write a result."""
    assert c_plant.start(c_plant.x_start) == OK
    c_plant.x[:] = x
    before = c_plant.memory
    step, (advance, reached) = c_plant.step(u, 5e-4), c_plant.advance(u, 1e-3)
    np.testing.assert_array_equal(c_plant.memory, before)
    assert reached == 0
    verdicts = [step, advance]
    for result in (
        c_plant.derivatives,
        lambda *both: c_plant.directional(*both, np.zeros(len(u)), np.zeros(len(x))),
    ):
        np.testing.assert_array_equal(result(u, x), UNTOUCHED)
        verdicts.append(c_plant.verdict)
    return verdicts


@pytest.mark.parametrize("value", BAD)
def test_every_entry_refuses_states_and_inputs(c_plant, value):
    u = np.zeros(21)
    for place in (0, 3, 6, 24, 42, 43):
        x = c_plant.x_start.copy()
        x[place] = value
        assert entries(c_plant, u, x) == [INVALID] * 4, place
        assert c_plant.start(x) == INVALID
        assert c_plant.step(u, 5e-4) == INVALID, "until the next start"
    for place in (0, 18):
        u = np.zeros(21)
        u[place] = value
        assert entries(c_plant, u, c_plant.x_start) == [INVALID] * 4, place


def test_declared_bounds_of_every_parameter_are_enforced(c_plant):
    u, places = np.zeros(21), iter(range(len(c_plant.parameters)))
    for quantity in c_plant.model.parameters:
        for name, place in zip(quantity.names, places, strict=False):
            default = c_plant.parameters[place]
            for value in (
                np.nextafter(quantity.least, -np.inf),
                np.nextafter(quantity.largest, np.inf),
                np.nan,
            ):
                c_plant.parameters[place] = value
                assert entries(c_plant, u, c_plant.x_start) == [INVALID] * 4, (name, value)
            c_plant.parameters[place] = default
    assert next(places, None) is None
    c_plant.start(c_plant.x_start)
    assert c_plant.step(u, 5e-4) == OK


@pytest.mark.parametrize("duration", [np.nan, np.inf, -1.0, 0.0, 1e-300, 1e18])
def test_durations_out_of_range_are_refused(c_plant, duration):
    u, before = np.zeros(21), c_plant.memory
    assert c_plant.advance(u, duration) == (INVALID, 0)
    assert c_plant.step(u, duration) == INVALID
    np.testing.assert_array_equal(c_plant.memory, before)


@pytest.mark.parametrize("step", [0.0, 1e-300, 1e-12, -1.0, np.nan])
def test_steps_that_are_too_short_are_refused_at_once(c_plant, step):
    c_plant.set("step_s", step)
    assert c_plant.advance(np.zeros(21), 1e-3) == (INVALID, 0)


def test_the_shortest_declared_step_ends(c_plant):
    c_plant.set("step_s", 1e-6)
    assert c_plant.advance(np.zeros(21), 1e-3) == (OK, pytest.approx(1e-3))


def test_long_directions_give_the_multiple_of_short_ones(c_plant):
    generator = np.random.default_rng(0)
    u, x = generator.uniform(-1, 1, 21), c_plant.x_start.copy()
    x[:24] += generator.uniform(-0.2, 0.2, 24)
    du, dx = generator.normal(size=21), generator.normal(size=len(x))
    short = c_plant.directional(u, x, du, dx)
    for factor in (1e30, 1e200, 1e290):
        # The scale is no power of two: each number is rounded twice more.
        np.testing.assert_allclose(
            c_plant.directional(u, x, factor * du, factor * dx) / factor, short, rtol=1e-12
        )
    assert c_plant.verdict == OK
    assert np.abs(short).max() > 1e4
    np.testing.assert_array_equal(c_plant.directional(u, x, 1e305 * du, 1e305 * dx), UNTOUCHED)
    assert c_plant.verdict == DIVERGED, "the derivative is beyond the largest number"
    du[0] = np.nan
    np.testing.assert_array_equal(c_plant.directional(u, x, du, dx), UNTOUCHED)
    assert c_plant.verdict == INVALID


def test_time_constants_of_zero_have_no_derivatives(c_plant):
    c_plant.set("lag_s", 0.0)
    np.testing.assert_array_equal(c_plant.derivatives(np.zeros(21), c_plant.x_start), UNTOUCHED)
    assert c_plant.verdict == DIVERGED
    assert c_plant.step(np.zeros(21), 5e-4) == OK


def test_an_export_beyond_the_bounds_is_refused():
    with pytest.raises(InputError, match=r"export: expected step_s from 1e-06 to 1 s, received 1e-07"):
        plant_code("hold", {"plant.step_s": 1e-7, "controller.period_s": 1e-7})
