"""Learned torque of the plant: its form, its range, its file, and the paths that have none."""

import numpy as np
import pytest

from spheretwin import plant
from spheretwin import scenario as scenarios
from spheretwin.machine import model_of
from spheretwin.models.base.errors import InputError
from spheretwin.plant.learned_torque import (
    LearnedTorque,
    LearnedTorqueSection,
    add_learned_torque,
    fill_learned_torque,
    learned_torque,
    write_arrays,
)
from spheretwin.session import Session
from tests.twin.passive_cases import ENGINES, FREE, STILL, table

ARRAYS = {
    "centre_rad": np.array([[0.0, 0.0, 0.0], [0.1, 0.0, 0.2]]),
    "length_rad": np.array([0.2, 0.3, 0.4]),
    "reach": np.array(0.5),
    "rate_rad_s": np.array([1.0, 2.0, 3.0]),
    "torque_Nm": np.array([0.1, 0.2, 0.3]),
    "weight_Nm": 1e-3 * np.arange(1.0, 19.0).reshape(2, 3, 3),
}


def evaluated(q, qdot=(0.0, 0.0, 0.0), coil_Nm=(0.0, 0.0, 0.0)):
    """Torque and share at a state."""
    rows = LearnedTorque.zeros()
    fill_learned_torque(rows, ARRAYS)
    torque = np.zeros(3)
    add_learned_torque(rows[0], np.array(q), np.array(qdot), np.array(coil_Nm), torque)
    return torque, rows["share"][0]


def test_its_form_within_the_range():
    q, qdot, coil = np.array([0.05, 0.02, 0.1]), np.array([0.5, -1.0, 2.0]), np.array([0.05, -0.1, 0.2])
    bells = np.exp(-0.5 * np.sum(((q - ARRAYS["centre_rad"]) / ARRAYS["length_rad"]) ** 2, axis=1))
    features = np.stack([np.ones(3), qdot / ARRAYS["rate_rad_s"], coil / ARRAYS["torque_Nm"]])
    expected = np.einsum("m,mki,ki->i", bells, ARRAYS["weight_Nm"], features)
    torque, share = evaluated(q, qdot, coil)
    np.testing.assert_allclose(torque, expected, rtol=1e-14)
    assert share == 1.0


@pytest.mark.parametrize(
    ("state", "share"),
    [
        (([0.0, -0.15, 0.0],), 1.0),  # half a length: the reach
        (([0.0, -0.225, 0.0],), 0.5),
        (([0.0, -0.3, 0.0],), 0.0),
        (([0.0] * 3, [0.0, -3.0, 0.0]), 0.5),
        (([0.0] * 3, [0.0, 0.0, 6.0]), 0.0),
        (([0.0] * 3, [0.0] * 3, [0.15, 0.0, 0.0]), 0.5),
        (([0.0] * 3, [0.0] * 3, [0.0, 0.0, -0.7]), 0.0),
    ],
)
def test_it_fades_outside_of_its_range_and_is_not_extrapolated(state, share):
    torque, received = evaluated(*state)
    assert received == pytest.approx(share, abs=1e-12)
    assert np.all(torque == 0.0) == (share == 0.0)


@pytest.fixture
def section(tmp_path):
    path = tmp_path / "learned.npz"
    return {"plant.learned_torque.file": str(path), "plant.learned_torque.sha256": write_arrays(path, ARRAYS)}


@pytest.mark.parametrize("engine", ENGINES)
def test_both_engines_have_its_acceleration(section, engine):
    """At rest at a centre, after one period: torque over inertia; the rate itself adds 0.3 %."""
    run = table(2, "hold", STILL | section | {"plant.engine": engine, "plant.coulomb_Nm": [0.0] * 3}, FREE)
    torque, _ = evaluated([0.0] * 3)
    inertia = model_of("hold").parameters.inertia_kg_m2
    np.testing.assert_allclose(run["qdot_rad_s"][1], 1e-3 * torque / inertia, rtol=5e-3)
    np.testing.assert_allclose(run["learned_torque_Nm"][0], torque, rtol=5e-3)
    assert run["learned_share"].tolist() == [1.0, 1.0]


def test_a_run_that_leaves_the_range_says_so(section):
    changes = STILL | section | {"plant.initial_rad": [0.0, 0.5, 0.0]}
    with Session(scenarios.load("hold", changes)) as session:
        rows = session.advance(5)
    assert np.all(rows["learned_share"] == 0.0)
    assert np.all(rows["learned_torque_Nm"] == 0.0)


def test_another_content_is_refused(section, tmp_path):
    file, digest = section.values()
    with open(file, "ab") as opened:
        opened.write(b"!")
    with pytest.raises(InputError, match="expected the digest"):
        learned_torque(LearnedTorqueSection(file=file, sha256=digest))
    with pytest.raises(InputError, match="expected a file"):
        learned_torque(LearnedTorqueSection(file=str(tmp_path / "none.npz"), sha256=digest))
    path = tmp_path / "other.npz"
    digest = write_arrays(path, ARRAYS | {"reach": np.zeros(2)})
    with pytest.raises(InputError, match="expected arrays"):
        learned_torque(LearnedTorqueSection(file=str(path), sha256=digest))


def test_the_plant_step_refuses_it(section):
    with pytest.raises(InputError, match="no learned torque"):
        plant.parameters("hold", section)
