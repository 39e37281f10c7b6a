"""A model of a user's and a table of torques, for the tests of sessions and disturbances."""

import pytest

from tests.models.model_files import edited
from tests.twin.disturbance_cases import TORQUES


@pytest.fixture(scope="session")
def sticky(tmp_path_factory):
    """A model of the user's, in which the engine's solver is cut off at each step: where it began shows."""
    solver = ('<option integrator="RK4"', '<option integrator="RK4" solver="Newton" iterations="1"')
    hinges = ((f'name="{name}"', f'frictionloss="0.5" name="{name}"') for name in ("alpha", "beta", "gamma"))
    joints = ((f"<joint {before}", f"<joint {after}") for before, after in hinges)
    return str(edited(tmp_path_factory.mktemp("model"), solver, *joints))


@pytest.fixture
def torques(tmp_path):
    (path := tmp_path / "torques.csv").write_text(TORQUES)
    return str(path)
