"""The whole way in: ideal bits, and numbers of every kind at every input.

The plain copy of the chain is in test_prototype.py.
"""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from spheretwin.electronics.random_streams import noise_table, width_of
from spheretwin.electronics.sensor_chain import (
    SensorChain,
    SensorsSection,
    fill_sensors,
    noise_streams,
    sense,
)
from spheretwin.scenario.hardware import PROTOTYPE_SENSORS
from tests.twin.plant.allocations import allocates_nothing

NO_NOISE = np.empty(0)
STAGES = {
    "potentiometer": {"nonlinearity_rad": 1e-3},
    "adc": {"bits": 10, "offset_V": 1e-2, "gain_error": 1e-2},
    "encoder": {"counts": 100},
}


def sensors_of(section, seed):
    return SensorChain.filled(fill_sensors, section, seed, delays=8)[0]


def prototype(**more):
    """Section with the prototype's values, and others by dotted name over them."""
    fields = {}
    for dotted, value in {**PROTOTYPE_SENSORS, **more}.items():
        _, stage, name = dotted.split(".")
        fields.setdefault(stage, {})[name] = value
    return SensorsSection(**fields)


def measured(section, seed, q, first=0):
    """Angles (n, 3) that are handed over at poses q (n, 3) of consecutive ticks."""
    sensors, streams = sensors_of(section, seed), noise_streams(section)
    noise = noise_table(seed, first, len(q), streams)
    measurement, angles = np.empty((3, 3)), np.empty_like(q)
    for tick in range(len(q)):
        assert sense(sensors, q[tick], q[tick], noise[tick], NO_NOISE, measurement)
        angles[tick] = measurement[0]
    return angles


def poses(ticks, seed=0):
    """Within the range of the joints, γ over many turns."""
    return np.random.default_rng(seed).uniform([-1.4, -1.4, -500], [1.4, 1.4, 500], (ticks, 3))


@pytest.mark.parametrize(
    "section",
    [
        SensorsSection(),
        SensorsSection(
            potentiometer={"electrical_angle_rad": 0.1, "supply_V": 12.0},
            adc={"range_V": 0.01, "oversampling": 10},
        ),
    ],
)
@given(q=st.tuples(*[st.floats(allow_nan=False)] * 3), qdot=st.tuples(*[st.floats(allow_nan=False)] * 3))
def test_an_ideal_chain_hands_over_the_very_bits(section, q, qdot):
    measurement, state = np.full((3, 3), 7.0), np.array([q, qdot])
    sensors = sensors_of(section, 0)
    assert sense(sensors, state[0], state[1], NO_NOISE, NO_NOISE, measurement) == np.isfinite(state).all()
    assert measurement[:2].tobytes() == state.tobytes()
    np.testing.assert_array_equal(measurement[2], 7.0)  # the torque believed, which is another's
    assert not sensors.shifts
    assert not any(sensors.stages[name].on for name in sensors.stages.dtype.names)
    assert width_of(noise_streams(section)) == 0


@pytest.mark.parametrize("stage", STAGES)
def test_a_stage_touches_its_own_angles_alone(stage):
    q = poses(100)
    q[0], q[1] = -0.0, 5e-324  # which a sum with 0, or a way to volts and back, would not leave as they are
    angles = measured(SensorsSection(**{stage: STAGES[stage]}), 0, q)
    own = [2] if stage == "encoder" else [0, 1]
    others = [axis for axis in range(3) if axis not in own]
    assert angles[:, others].tobytes() == q[:, others].tobytes()
    assert np.all(np.any(angles[:, own] != q[:, own], axis=0))


def test_a_mounting_error_alone_is_added_to_each_angle():
    offset, q = (0.01, -0.02, 0.03), poses(50)
    np.testing.assert_array_equal(measured(SensorsSection(angle_offset_rad=offset), 0, q), q + offset)


def test_rates_are_the_true_ones_and_what_was_handed_over_is_kept():
    sensors, measurement = sensors_of(prototype(), 0), np.zeros((3, 3))
    rates = np.array([1.0, -2.0, 3.0])
    sense(sensors, np.array([0.1, 0.2, 0.3]), rates, np.zeros(2), NO_NOISE, measurement)
    np.testing.assert_array_equal(measurement[1], rates)


ANY = st.floats()
LARGE = st.floats(-1e300, 1e300)
BOUND = st.floats(0, 1e3)
SECTIONS = st.builds(
    lambda track, converter, counts, offset: SensorsSection(
        angle_offset_rad=offset, potentiometer=track, adc=converter, encoder={"counts": counts}
    ),
    st.fixed_dictionaries(
        {
            "electrical_angle_rad": st.floats(0.01, 100),
            "supply_V": st.floats(1e-3, 1e3),
            "nonlinearity_rad": st.floats(0, 5.9e-4),
            "noise_rad": st.floats(0, 1),
        }
    ),
    st.fixed_dictionaries(
        {
            "bits": st.integers(0, 32),
            "range_V": st.floats(1e-3, 1e3),
            "offset_V": BOUND,
            "gain_error": st.floats(0, 0.5),
            "noise_V": BOUND,
            "oversampling": st.integers(1, 5),
        }
    ),
    st.integers(0, 2**31),
    st.tuples(*[st.floats(-1e4, 1e4)] * 3),
)


def sensed(section, state, draws):
    """What is returned, and what is handed over, with draws repeated to the width needed."""
    measurement = np.zeros((3, 3))
    noise = np.resize(np.array(draws), width_of(noise_streams(section)))
    q, qdot = np.array(state[:3]), np.array(state[3:])
    finite = sense(sensors_of(section, 0), q, qdot, noise, NO_NOISE, measurement)
    return finite, measurement[:2]


@given(SECTIONS, st.tuples(*[LARGE] * 6), st.lists(st.floats(-1e3, 1e3), min_size=1, max_size=4))
def test_finite_numbers_of_any_size_stay_finite(section, state, draws):
    # 2³¹ counts a turn of 1e290 rad are the most that fit.
    state = (*state[:2], state[2] * 1e-10, *state[3:])
    finite, handed = sensed(section, state, draws)
    assert finite
    assert np.isfinite(handed).all()


@given(SECTIONS, st.tuples(*[ANY] * 6), st.lists(ANY, min_size=1, max_size=4))
def test_whatever_goes_in_is_told_where_it_comes_out_as_no_number(section, state, draws):
    finite, handed = sensed(section, state, draws)
    assert finite == np.isfinite(handed).all()
    for axis in range(6):
        if np.isnan(state[axis]):
            assert np.isnan(handed.ravel()[axis])


@pytest.mark.parametrize("place", range(6))
def test_no_stage_makes_a_number_of_none(place):
    state = np.array([0.1, 0.2, 0.3, 1.0, 2.0, 3.0])
    state[place] = np.nan
    finite, handed = sensed(prototype(), state, [0.5, -0.5])
    assert not finite
    assert np.isnan(handed.ravel()).nonzero()[0].tolist() == [place]


def test_a_short_row_of_noise_is_no_number_either():
    measurement = np.zeros((3, 3))
    assert not sense(
        sensors_of(prototype(), 0),
        np.zeros(3),
        np.zeros(3),
        NO_NOISE,
        NO_NOISE,
        measurement,
    )


def test_sensing_allocates_nothing():
    section = prototype(**{"sensors.adc.oversampling": 4})
    arguments = np.zeros(3), np.zeros(3), np.zeros(8), NO_NOISE, np.zeros((3, 3))
    assert allocates_nothing(sense, sensors_of(section, 0), *arguments)
