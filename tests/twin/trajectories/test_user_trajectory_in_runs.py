"""Any object with sample(t) as the reference of a session or a run."""

import numpy as np
import pytest

from spheretwin import cli
from spheretwin import scenario as scenarios
from spheretwin.models.base.errors import InputError
from spheretwin.models.telemetry.table import read_parquet
from spheretwin.provenance import record_of
from spheretwin.session import Session
from spheretwin.simulation import simulate
from spheretwin.trajectories.shapes import Sinusoid


class Spiral:
    """A widening turn, with its exact derivatives."""

    def sample(self, t):
        angle = np.stack([0.05 * t, 0.02 * t**2, np.sin(t)], axis=1)
        rate = np.stack([np.full_like(t, 0.05), 0.04 * t, np.cos(t)], axis=1)
        acceleration = np.stack([np.zeros_like(t), np.full_like(t, 0.04), -np.sin(t)], axis=1)
        return np.stack([angle, rate, acceleration], axis=1)


def scenario(**changes):
    return scenarios.load("hold", {"duration": 0.3, **changes})


def test_it_is_followed_instead_of_the_scenario_s():
    run = simulate(scenario(**{"plant.initial_rad": None}), trajectory=Spiral())
    table = run.telemetry
    np.testing.assert_array_equal(table["q_ref_rad"], Spiral().sample(table["t_s"])[:, 0])
    np.testing.assert_array_equal(table["qdot_ref_rad_s"], Spiral().sample(table["t_s"])[:, 1])
    assert run.scenario.trajectory.shape == "Spiral"
    assert run.scenario.plant.initial_rad == (0.0, 0.0, 0.0)


def test_one_of_the_package_s_shapes_is_the_same_either_way():
    shipped = simulate(scenarios.load("sinusoid", {"duration": 0.2}))
    handed = simulate(scenarios.load("sinusoid", {"duration": 0.2}), trajectory=Sinusoid())
    assert handed.telemetry.values.tobytes() == shipped.telemetry.values.tobytes()


def test_changes_beside_it_leave_it_in_force():
    with Session(scenario(), trajectory=Spiral()) as session:
        session.advance(50)
        session.set("disturbance.load", 0.5)
        session.set("controller.law", "pd")
        table = session.advance(50)
        np.testing.assert_array_equal(table["q_ref_rad"], Spiral().sample(table["t_s"])[:, 0])
        assert session.scenario.trajectory.shape == "Spiral"
        for name, value in (("trajectory.shape", "nutation"), ("trajectory", {"shape": "hold"})):
            with pytest.raises(InputError, match="Spiral replaces it"):
                session.set(name, value)


def test_a_snapshot_goes_on_along_it_and_not_along_another():
    with Session(scenario(), trajectory=Spiral()) as session, Session(scenario()) as plain:
        session.advance(70)
        snapshot = session.snapshot()
        ahead = session.advance(80).values.tobytes()
        session.restore(snapshot)
        assert session.advance(80).values.tobytes() == ahead
        with pytest.raises(InputError, match="with the trajectory of this session, received one with Spiral"):
            plain.restore(snapshot)


def test_its_telemetry_says_so_and_cannot_be_replayed(tmp_path, capsys):
    with Session(scenario(), trajectory=Spiral()) as session:
        table = session.advance(50)
        path = tmp_path / "run.parquet"
        table.write_parquet(path, record_of(session).metadata())
    assert '"shape": "Spiral"' in read_parquet(path)[1]["scenario"]
    assert cli.main(["simulate", "--replay", str(path)]) == 2
    assert "received one along Spiral, a trajectory that its file does not contain" in capsys.readouterr().err


@pytest.mark.parametrize("own", [3, Spiral, type("Empty", (), {})()])
def test_what_cannot_be_sampled_is_refused(own):
    with pytest.raises(InputError, match=r"expected an object with sample\(t\)"):
        simulate(scenario(), trajectory=own)
