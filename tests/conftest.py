"""Shared by all tests: the shipped actuator, and reproducible property tests."""

import hypothesis
import pytest

from spheretwin.models import actuator as actuators

# Derandomised: a failure on one machine is a failure on every machine. No deadline: machines are shared.
hypothesis.settings.register_profile("reproducible", derandomize=True, deadline=None, max_examples=200)
hypothesis.settings.load_profile("reproducible")


@pytest.fixture(scope="session")
def actuator() -> actuators.Actuator:
    return actuators.load()
