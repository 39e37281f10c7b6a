"""What every kind of disturbance of the registry owes, whichever it is."""

import pickle

import numpy as np
import pytest
from pydantic import TypeAdapter

from spheretwin import scenario as scenarios
from spheretwin.models.telemetry.status import Status
from spheretwin.simulation import simulate
from spheretwin.trajectories.disturbances import KINDS, AnyDisturbance
from tests.twin.disturbance_cases import sampled

# Beside every kind as it is when nothing is said of it.
OTHERS = [
    ("constant", {"torque_Nm": (0.1, -0.2, 0.3)}),
    ("steps", {"times_s": (0.5, 2.0), "torques_Nm": ((0.1, 0.0, 0.2), (0.0, -0.3, 0.0))}),
    (
        "sinusoidal",
        {"amplitude_Nm": (0.1, 0.2, 0.3), "frequency_Hz": (1.0, 0.0, 9.0), "phase_rad": (0.0, 1.0, 2.0)},
    ),
    ("table", {"between": "held"}),
    ("random", {"gamma_envelope": "growing", "bound_Nm": (0.1, 0.0, 1e-3)}),
]


@pytest.fixture(
    params=[*((name, {}) for name in KINDS), *OTHERS], ids=lambda case: "-".join([case[0], *case[1]])
)
def term(request, torques):
    name, fields = request.param
    kind = KINDS[name]
    return kind(**({"file": torques} if "file" in kind.model_fields else {}), **fields)


def test_samples_are_finite_and_as_many_as_asked_for(term):
    for first, ticks in ((0, 1), (0, 1000), (5000, 7)):
        torque = sampled(term, first, ticks)
        assert torque.shape == (ticks, 3)
        assert torque.dtype == np.float64
        assert np.isfinite(torque).all()


def test_is_a_function_of_the_tick_alone(term):
    whole = sampled(term, 0, 4000)
    for first, last in ((3999, 4000), (0, 1), (1, 8), (1000, 2000), (1003, 3999)):
        assert sampled(term, first, last - first).tobytes() == whole[first:last].tobytes()


def test_is_known_by_what_is_said_of_it(term):
    again = TypeAdapter(AnyDisturbance).validate_json(term.model_dump_json())
    for other in (again, term.model_copy(), pickle.loads(pickle.dumps(term))):
        assert other == term
        assert hash(other) == hash(term)
        assert sampled(other, 0, 100).tobytes() == sampled(term, 0, 100).tobytes()


@pytest.mark.parametrize("name", KINDS)
def test_every_kind_s_parameters(name, torques, check_parameters):
    kind = KINDS[name]
    assert kind.model_fields["kind"].default == name
    member = kind(**({"file": torques} if "file" in kind.model_fields else {}))
    check_parameters(member, "disturbance.terms.0", lambda fields: {"disturbance.terms": [fields]})


def test_every_kind_acts_as_it_says(term):
    quiet = {"disturbance.load": 0.0, "disturbance.random_bound_Nm": 0.0, "duration": 0.03}
    made = scenarios.load("hold", {**quiet, "disturbance.terms": [term.model_dump(mode="json")]})
    run = simulate(made)
    assert run.status == Status.COMPLETED
    received = run.telemetry["disturbance_Nm"]
    np.testing.assert_array_equal(received, sampled(term, 0, 30, made.seed, 0))
