"""What every shape of the registry owes, whichever it is."""

import pickle

import numpy as np
import pytest
from pydantic import TypeAdapter

from spheretwin import scenario as scenarios
from spheretwin.models.telemetry.status import Status
from spheretwin.simulation import simulate
from spheretwin.trajectories import SHAPES, Trajectory
from spheretwin.trajectories.shapes import Component, Hold

STEP = 1e-5
POSES = "t_s,alpha_rad,beta_rad,gamma_rad\n0.5,0,0,0\n1.25,0.2,-0.1,1\n3,0.1,0.3,-1\n4.5,0,0,0.5\n"

# Beside every shape as it is when nothing is said of it.
OTHERS = {
    "chirp": {"sweep": "exponential", "sweep_s": 3.3, "amplitude_rad": (0.1, -0.2, 0.05)},
    "multisine": {
        "offset_rad": (0.1, 0.0, -0.2),
        "components": (
            Component(
                amplitude_rad=(0.1, 0.0, 0.02), frequency_Hz=(0.5, 0.0, 3.0), phase_rad=(0.0, 1.0, 2.0)
            ),
            Component(amplitude_rad=(0.0, 0.3, 0.02), frequency_Hz=(0.0, 0.25, 1.5)),
        ),
    },
    "waypoints": {"between": "cubic"},
    "great_circle": {"middle_rad": (0.2, 1.2, -2.0), "axis": (0.3, -0.2, 1.0)},
}
ROUNDED = {"rounding_rad_s2": 40.0}
CASES = [
    *((name, {}) for name in SHAPES),
    *OTHERS.items(),
    *((name, ROUNDED) for name in SHAPES),
    *((name, {**fields, **ROUNDED}) for name, fields in OTHERS.items()),
]


@pytest.fixture(scope="module")
def poses(tmp_path_factory):
    path = tmp_path_factory.mktemp("poses") / "poses.csv"
    path.write_text(POSES)
    return str(path)


@pytest.fixture(params=CASES, ids=lambda case: "-".join([case[0], *case[1]]))
def shape(request, poses):
    name, fields = request.param
    kind = SHAPES[name]
    return kind(**({"file": poses} if "file" in kind.model_fields else {}), **fields)


def test_samples_are_finite_wherever_and_as_many_as_asked_for(shape):
    for t in (np.empty(0), np.zeros(1), np.linspace(0, 10, 1001), np.array([1e6])):
        samples = shape.sample(t)
        assert samples.shape == (len(t), 3, 3)
        assert samples.dtype == np.float64
        assert np.isfinite(samples).all()


def test_rates_and_accelerations_are_derivatives(shape):
    t = np.linspace(0.1, 4.9, 50)  # no end of a rounded window within a step of any
    corners = shape.corners().t_s
    t = t[np.all(np.abs(t[:, None] - corners) > 2 * STEP, axis=1)]
    before, now, after = (shape.sample(t + h) for h in (-STEP, 0, STEP))
    # Central differences: h² times a third derivative below 2000, and rounding of 31 rad over h.
    np.testing.assert_allclose(now[:, 1], (after - before)[:, 0] / (2 * STEP), atol=2e-7)
    np.testing.assert_allclose(now[:, 2], (after - before)[:, 1] / (2 * STEP), atol=2e-7)


def test_is_a_function_of_time_alone(shape):
    t = 1e-3 * np.arange(6000.0)
    whole = shape.sample(t)
    cut = [shape.sample(part) for part in np.split(t, [1, 2, 7, 1000, 1003, 5999])]
    assert np.concatenate(cut).tobytes() == whole.tobytes()
    shuffled = np.random.default_rng(0).permutation(len(t))
    assert shape.sample(t[shuffled]).tobytes() == whole[shuffled].tobytes()


def test_is_known_by_what_is_said_of_it(shape):
    t = np.linspace(0, 5, 101)
    again = TypeAdapter(Trajectory).validate_json(shape.model_dump_json())
    assert again == shape
    for other in (again, shape.model_copy(), pickle.loads(pickle.dumps(shape))):
        assert other == shape
        assert hash(other) == hash(shape)
        assert other.sample(t).tobytes() == shape.sample(t).tobytes()
    if shape.rounding_rad_s2 is None:
        assert shape.sample(t).tobytes() == shape.sharp(t).tobytes()
    else:
        np.testing.assert_array_equal(shape.sample(np.zeros(1))[0, 1], 0.0)
    assert shape != Hold(angle_rad=(9.0, 9.0, 9.0))


@pytest.mark.parametrize("name", SHAPES)
def test_every_shape_s_parameters(name, poses, check_parameters):
    kind = SHAPES[name]
    assert kind.model_fields["shape"].default == name
    member = kind(**({"file": poses} if "file" in kind.model_fields else {}))
    check_parameters(member, "trajectory", lambda fields: {"trajectory": fields})


def test_every_shape_runs(shape):
    fields = {"trajectory": shape.model_dump(mode="json"), "duration": 0.02}
    run = simulate(scenarios.load("hold", fields))
    assert run.status in set(Status)
    assert all(note and "\n" not in note for note in shape.notes())
    samples = shape.sample(run.telemetry["t_s"])
    np.testing.assert_array_equal(run.telemetry["q_ref_rad"], samples[:, 0])
    np.testing.assert_array_equal(run.telemetry["qdot_ref_rad_s"], samples[:, 1])
