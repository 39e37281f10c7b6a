"""AFSM on the rotation error: the three subsystems of AFSM in the rotor frame."""

import numpy as np

from spheretwin import scenario as scenarios
from spheretwin.control.law_components.rotation import rotation_error, rotation_vector
from spheretwin.control.laws.afsm import AFSM, RotationAFSM
from spheretwin.models.kinematics import rotation
from spheretwin.simulation import simulate
from tests.control.laws.cases import TICKS, known
from tests.control.laws.test_geometric import torque_of


def test_it_is_afsm_on_the_components_of_the_rotation_error(actuator):
    ours, theirs = (
        kind(surface_slope=[40.0, 50.0, 60.0]).build(known(actuator)) for kind in (RotationAFSM, AFSM)
    )
    states, torques = [law.state.copy() for law in (ours, theirs)], np.empty((2, 3))
    generator = np.random.default_rng(3)
    for _ in range(TICKS):
        reference, measurement = generator.normal(size=(2, 3, 3))
        error = rotation_error(reference, measurement)
        rows = np.array([rotation_vector(error), error.rate, np.zeros(3)])
        R = rotation(measurement[0])
        theirs.step(0.0, np.zeros((3, 3)), rows, theirs.parameters, states[1], torques[1])
        ours.step(0.0, reference, measurement, ours.parameters, states[0], torques[0])
        # Sums of some hundred numbers, as in `follows`.
        np.testing.assert_allclose(torques[0], R @ torques[1], rtol=1e-11, atol=1e-11)
        np.testing.assert_allclose(states[0], states[1], rtol=1e-11, atol=1e-11)
    assert [signal.name for signal in ours.signals] == [
        f"rotation_{signal.name}" for signal in theirs.signals
    ]


def test_near_the_origin_it_is_afsm_to_first_order(actuator):
    """To first order the hinges are the rotor's axes; the approximator's output is 0 at the first tick."""
    laws = [kind().build(known(actuator)) for kind in (RotationAFSM, AFSM)]
    measurement = np.random.default_rng(4).normal(size=(3, 3))

    def distance(size):
        ours, theirs = (torque_of(law, np.zeros((3, 3)), size * measurement) for law in laws)
        return np.linalg.norm(ours - theirs)

    sizes = 1e-3 * np.array([4.0, 2.0, 1.0])
    distances = np.array([distance(size) for size in sizes])
    np.testing.assert_allclose(np.log2(distances[:-1] / distances[1:]), 2, atol=0.05)


def test_laws_on_rotations_track_near_80_degrees():
    """From 1° away, with the shipped gains."""
    fields = {
        "trajectory.angle_rad": [0.5, 1.36, -0.4], "plant.initial_rad": [0.48, 1.34, -0.42],
        "plant.engine": "lagrangian", "disturbance.load": 0.0, "duration": 1.0,
    }  # fmt: skip
    for law in ("geometric_pd", "geometric_pid", "quaternion_backstepping", "rotation_afsm"):
        run = simulate(scenarios.load("hold", fields | {"controller.law": law}))
        assert run.status == "completed"
        assert np.abs(run.telemetry["error_rad"][-1]).max() < 2e-3
