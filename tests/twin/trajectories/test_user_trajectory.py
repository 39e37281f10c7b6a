"""A trajectory of the user's: any object with sample(t), as it is, in a run, or refused on one line."""

import numpy as np
import pytest

from spheretwin import cli
from spheretwin import scenario as scenarios
from spheretwin.models.base.errors import InputError
from spheretwin.models.telemetry.table import read_parquet
from spheretwin.records.provenance import record_of
from spheretwin.session import Session
from spheretwin.simulation import simulate
from spheretwin.trajectories.shapes import Sinusoid
from spheretwin.trajectories.trajectory import UserTrajectory, checked

T = np.linspace(0, 3, 31)


class Own:
    def __init__(self, sample):
        self.sample = sample


def spiral(t):
    """A widening turn, with its exact derivatives."""
    angle = np.stack([0.05 * t, 0.02 * t**2, np.sin(t)], axis=1)
    rate = np.stack([np.full_like(t, 0.05), 0.04 * t, np.cos(t)], axis=1)
    acceleration = np.stack([np.zeros_like(t), np.full_like(t, 0.04), -np.sin(t)], axis=1)
    return np.stack([angle, rate, acceleration], axis=1)


class Spiral(Own):
    def __init__(self):
        super().__init__(spiral)


@pytest.mark.parametrize(
    "sample",
    [Sinusoid().sample, lambda t: np.asfortranarray(Sinusoid().sample(t)).astype(">f8")],
    ids=["as it is", "another order of memory and bytes"],
)
def test_its_samples_are_float64_in_c_order(sample):
    own = checked(Own(sample))
    assert own.sample(T).flags.c_contiguous
    assert own.sample(T).dtype == np.float64
    assert own.sample(T).tobytes() == Sinusoid().sample(T).tobytes()
    assert checked(own) is own
    assert isinstance(own, UserTrajectory)


def test_what_it_does_with_its_arrays_later_changes_nothing():
    buffer = np.zeros((2, 3, 3))

    def sample(t):
        buffer[:] = t[0]
        t[:] = -1.0
        return buffer[: len(t)]

    own, t = checked(Own(sample)), np.array([1.0, 2.0])
    first = own.sample(t)
    own.sample(np.array([5.0, 6.0]))
    np.testing.assert_array_equal(first, 1.0)
    np.testing.assert_array_equal(t, [1.0, 2.0])


def test_later_samples_are_checked_too():
    own = checked(Own(lambda t: np.zeros((1, 3, 3))))
    with pytest.raises(InputError, match=r"float64 of shape \(5, 3, 3\)"):
        own.sample(np.arange(5.0))


# In a run


def scenario(**changes):
    return scenarios.load("hold", {"duration": 0.3, **changes})


def test_a_run_follows_it_instead_of_the_scenario_s():
    run = simulate(scenario(**{"plant.initial_rad": None}), trajectory=Spiral())
    samples = spiral(run.telemetry["t_s"])
    np.testing.assert_array_equal(run.telemetry["q_ref_rad"], samples[:, 0])
    np.testing.assert_array_equal(run.telemetry["qdot_ref_rad_s"], samples[:, 1])
    assert run.scenario.trajectory.shape == "Spiral"
    assert run.scenario.plant.initial_rad == (0.0, 0.0, 0.0)


def test_one_of_the_package_s_shapes_is_the_same_either_way():
    tables = [
        simulate(scenarios.load("sinusoid", {"duration": 0.2}), trajectory=own).telemetry
        for own in (None, Sinusoid())
    ]
    assert tables[0].values.tobytes() == tables[1].values.tobytes()


def test_changes_and_snapshots_keep_it_and_no_other_session_goes_on_along_it():
    with Session(scenario(), trajectory=Spiral()) as session, Session(scenario()) as plain:
        session.advance(50)
        session.set("disturbance.load", 0.5)
        session.set("controller.law", "pd")
        snapshot = session.snapshot()
        table = session.advance(50)
        np.testing.assert_array_equal(table["q_ref_rad"], spiral(table["t_s"])[:, 0])
        session.restore(snapshot)
        assert session.advance(50).values.tobytes() == table.values.tobytes()
        assert session.scenario.trajectory.shape == "Spiral"
        for name, value in (("trajectory.shape", "nutation"), ("trajectory", {"shape": "hold"})):
            with pytest.raises(InputError, match="Spiral replaces it"):
                session.set(name, value)
        with pytest.raises(InputError, match="with the trajectory of this session, received one with Spiral"):
            plain.restore(snapshot)


def test_its_telemetry_says_so_and_cannot_be_replayed(tmp_path, capsys):
    path = tmp_path / "run.parquet"
    with Session(scenario(), trajectory=Spiral()) as session:
        session.advance(50).write_parquet(path, record_of(session).metadata())
    assert '"shape": "Spiral"' in read_parquet(path)[1]["scenario"]
    assert cli.main(["simulate", "--replay", str(path)]) == 2
    assert "received one along Spiral, a trajectory that its file does not contain" in capsys.readouterr().err
