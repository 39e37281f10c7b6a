"""Play of the hinges: the measured angles, the rotor that it leaves alone, events and refusals."""

import numpy as np
import pytest

from spheretwin import plant
from spheretwin import scenario as scenarios
from spheretwin.models.base.errors import InputError
from spheretwin.session import Session
from tests.twin.passive_cases import ENGINES, FREE, STILL, table

PLAY_rad = [0.02, 0.03, 0.05]
PLAY = STILL | {"plant.backlash_rad": PLAY_rad}
pytestmark = pytest.mark.uncompiled


@pytest.mark.parametrize("engine", ENGINES)
@pytest.mark.parametrize("stiction", [False, True])
def test_the_shaft_follows_the_rotor_after_half_of_the_play(engine, stiction):
    """Hinge γ of the upright rotor, with a rate at the start: it stays at the end of its play."""
    changes = PLAY | {"plant.engine": engine, "plant.initial_rad_s": [0.0, 0.0, 1.0]}
    changes |= {"plant.coulomb_Nm": [0.0, 0.0, 5e-3], "plant.stiction.on": stiction}
    run = table(500, "hold", changes, FREE)
    without = table(500, "hold", changes | {"plant.backlash_rad": [0.0] * 3}, FREE)
    np.testing.assert_array_equal(run["q_rad"], without["q_rad"])
    measured = np.maximum.accumulate(run["q_rad"][:, 2]) - 0.5 * PLAY_rad[2]
    np.testing.assert_allclose(run["q_measured_rad"][:, 2], np.maximum(measured, 0.0), rtol=0, atol=1e-6)
    assert measured[-1] > 0.05


def test_the_measured_angles_have_the_hysteresis_of_the_play():
    """A controlled motion with reversals, at one physics step in a period, against the play of its angles."""
    period_s, half_rad = 1e-3, 0.5 * np.array(PLAY_rad)
    changes = {"plant.backlash_rad": PLAY_rad, "plant.step_s": period_s, "controller.period_s": period_s}
    run = table(150, "nutation", changes | {"plant.initial_rad_s": [2.0, -1.0, 3.0]})
    joint = run["q_rad"][0]
    for q, measured in zip(run["q_rad"], run["q_measured_rad"], strict=True):
        joint = np.where(
            q - joint > half_rad, q - half_rad, np.where(joint - q > half_rad, q + half_rad, joint)
        )
        np.testing.assert_allclose(measured, joint, rtol=0, atol=1e-15)
    within = np.abs(run["q_rad"] - run["q_measured_rad"]) < half_rad - 1e-9
    assert within[20:].any()
    assert not within[20:].all()


def test_the_joint_begins_anew_at_a_pose_that_is_set():
    with Session(scenarios.load("nutation", {"plant.backlash_rad": PLAY_rad})) as session:
        session.advance(20)
        session.set_state(q_rad=[0.1, 0.1, 0.1])
        assert session.advance(1)["q_measured_rad"][0].tolist() == [0.1, 0.1, 0.1]
        session.set("plant.backlash_rad", [0.0] * 3)
        session.advance(2)
        session.set("plant.backlash_rad", PLAY_rad)
        rows = session.advance(1)
        assert np.array_equal(rows["q_measured_rad"], rows["q_rad"])


def test_the_plant_step_refuses_a_play():
    with pytest.raises(InputError, match="no backlash"):
        plant.parameters("hold", PLAY)
