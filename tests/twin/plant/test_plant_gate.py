"""Gate of the public plant: wrong lengths, numbers that are not finite and steps out of range are refused."""

import numpy as np
import pytest

from spheretwin import plant
from spheretwin.models.base.errors import InputError
from spheretwin.plant.plant_step import roll_out

PARAMETERS = plant.parameters("nutation")
GOOD = {
    "q": np.array([0.1, 0.2, 0.3]), "qdot": np.zeros(3), "currents": np.full(18, 0.5),
    "disturbance": np.zeros(3), "dt": 5e-4, "parameters": PARAMETERS,
}  # fmt: skip


def step(**changes):
    given = GOOD | changes
    state = plant.State(given["q"], given["qdot"])
    return plant.step(state, given["currents"], given["disturbance"], given["parameters"], given["dt"])


def replaced(**fields):
    return {"parameters": PARAMETERS._replace(**fields)}


def with_entry(size, value):
    values = np.ones(size)
    values[-1] = value
    return values


BAD_NUMBERS = (np.nan, np.inf, -np.inf)
VECTORS = {"q": 3, "qdot": 3, "currents": 18, "disturbance": 3}
BAD = [
    *({name: np.zeros(size + more)} for name, size in VECTORS.items() for more in (-1, 1)),
    *({name: with_entry(size, value)} for name, size in VECTORS.items() for value in BAD_NUMBERS),
    *({"dt": value} for value in (np.nan, np.inf, 0.0, -1e-3, 1.5)),
    *(
        replaced(**{name: values})
        for name in ("inertia_kg_m2", "coulomb_Nm", "viscous_Nm_s", "constant_torque_Nm", "spring_Nm_rad")
        for values in (np.ones(2), np.ones(4), with_entry(3, np.nan))
    ),
    *(
        replaced(torque_gain=values)
        for values in (np.ones(0), np.ones(17), np.ones(19), with_entry(18, np.inf))
    ),
    replaced(inertia_kg_m2=np.array([1e-3, 0.0, 1e-3])),
    replaced(weight_moment_Nm=np.nan),
    replaced(friction_smoothing_rad_s=0.0),
]


@pytest.mark.parametrize("changes", BAD, ids=lambda changes: next(iter(changes)))
def test_a_step_refuses(changes):
    with pytest.raises(InputError, match=r"^plant: expected .*, received"):
        step(**changes)


def test_what_follows_a_view_in_memory_is_not_read():
    """A view of 17 currents lies in front of others; the step read the eighteenth from there."""
    memory = np.full(40, 100.0)
    with pytest.raises(InputError, match="one finite number for each group"):
        step(currents=memory[:17])


@pytest.mark.parametrize(
    "q", [np.zeros(2), np.zeros(4), np.array([0.0, np.nan, 0.0]), np.array([np.inf, 0, 0])]
)
def test_a_torque_matrix_refuses(q):
    with pytest.raises(InputError, match="q_rad of 3 finite numbers"):
        plant.torque_matrix(q, PARAMETERS)


@pytest.mark.parametrize(
    ("currents", "steps", "q"),
    [((2, 17), 1, (2, 3)), ((2, 18), -1, (2, 3)), ((2, 18), 1, (1, 3)), ((2, 18), 1, (2, 2))],
)
def test_a_sequence_refuses(currents, steps, q):
    state = plant.State(np.zeros(3), np.zeros(3))
    with pytest.raises(InputError, match=r"expected currents \(m, groups\), q \(m, 3\) and steps from 0 on"):
        roll_out(state, np.zeros(currents), np.zeros(3), PARAMETERS, 5e-4, steps, np.zeros(q))


@pytest.mark.parametrize(("dt", "steps"), [(np.nan, 1), (0.0, 1), (2.0, 1), (5e-4, -1), (5e-4, 1.5)])
def test_many_plants_refuse_steps_and_stay_as_they_were(dt, steps):
    plants = plant.Plants([PARAMETERS] * 3)
    plants.set_state([0.1, 0.0, 0.0], np.zeros(3))
    before = plants.q_rad
    for call in (
        lambda: plants.step(np.zeros(18), np.zeros(3), dt, steps),
        lambda: plants.step_torque(np.zeros(3), dt, steps),
        lambda: plants.roll_out(np.zeros((1, 3, 18)), np.zeros(3), dt, steps),
    ):
        with pytest.raises(InputError, match=r"plants: expected (a step dt above 0|steps as a whole number)"):
            call()
    np.testing.assert_array_equal(plants.q_rad, before)


@pytest.mark.parametrize(
    ("q", "qdot", "plants"),
    [
        (np.zeros(2), np.zeros(3), slice(None)),
        (np.zeros((2, 3)), np.zeros(3), slice(None)),
        (np.array([np.nan, 0, 0]), np.zeros(3), slice(None)),
        (np.zeros(3), np.array([0, np.inf, 0]), 1),
        (np.zeros((2, 3)), np.zeros(3), 1),
        (np.zeros((3, 3)), np.zeros(3), [0, 2]),
    ],
)
def test_many_plants_refuse_states_and_stay_as_they_were(q, qdot, plants):
    many = plant.Plants([PARAMETERS] * 3)
    many.set_state([0.1, 0.0, 0.0], [1.0, 0.0, 0.0])
    with pytest.raises(InputError, match="plants: expected q"):
        many.set_state(q, qdot, plants)
    np.testing.assert_array_equal(many.q_rad, [[0.1, 0.0, 0.0]] * 3)
    np.testing.assert_array_equal(many.qdot_rad_s, [[1.0, 0.0, 0.0]] * 3)


def test_many_plants_refuse_parameters():
    with pytest.raises(InputError, match="inertia_kg_m2"):
        plant.Plants(PARAMETERS._replace(inertia_kg_m2=np.ones(1)))
