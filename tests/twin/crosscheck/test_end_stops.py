"""End stops in the cross-check: the reference against its own energy, and what breaks which row."""

import dataclasses

import numpy as np

from spheretwin.crosscheck import end_stops
from spheretwin.crosscheck.end_stops import STOPS, Reference
from spheretwin.models.lagrangian import inertia_matrix


def test_without_damping_the_reference_conserves_energy_and_bounces(actuator):
    """At the samples without contact the energy is kinetic."""
    reference = Reference(actuator, STOPS.model_copy(update={"damping_ratio": 0.0}))
    states, contacts = reference.integrate()
    assert contacts == 1
    inside = np.all(np.abs(states[:, :2]) < actuator.hinge_range_rad[:2, 1] - STOPS.travel_rad, axis=1)
    energies = [0.5 * s[3:] @ inertia_matrix(s[:3], actuator.inertia) @ s[3:] for s in states[inside]]
    np.testing.assert_allclose(energies, energies[0], rtol=1e-8)  # tolerances of DOP853 over 0.2 s


def test_the_motion_starts_before_the_buffer_of_any_model(actuator):
    """A contact that lasts from the start on is not counted, and the bound would be 0."""
    narrow = np.radians([[-40.0, 40.0], [-40.0, 40.0], [-180.0, 180.0]])
    for one in (actuator, dataclasses.replace(actuator, hinge_range_rad=narrow)):
        low, high = (one.hinge_range_rad + STOPS.travel_rad * np.array([1.0, -1.0])).T
        start = np.array(end_stops.start_rad(one))
        assert np.all((low < start) & (start < high))
        assert Reference(one, STOPS).integrate()[1] > 0
