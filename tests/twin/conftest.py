"""A model of a user's and a table of torques, for the tests of sessions and disturbances."""

import pytest

from spheretwin.models import actuator as actuators
from tests.twin.disturbance_cases import TORQUES


@pytest.fixture(scope="session")
def sticky(tmp_path_factory):
    """A model of the user's, in which the engine's solver is cut off at each step: where it began shows."""
    text = actuators.MJCF_PATH.read_text()
    for before, after in [
        ('<option integrator="RK4"', '<option integrator="RK4" solver="Newton" iterations="1"'),
        *[
            (f'<joint name="{hinge}"', f'<joint frictionloss="0.5" name="{hinge}"')
            for hinge in ("alpha", "beta", "gamma")
        ],
    ]:
        assert text.count(before) == 1
        text = text.replace(before, after)
    path = tmp_path_factory.mktemp("model") / "sticky.xml"
    path.write_text(text.replace('meshdir="', f'meshdir="{actuators.MJCF_PATH.parent}/'))
    return str(path)


@pytest.fixture
def torques(tmp_path):
    (path := tmp_path / "torques.csv").write_text(TORQUES)
    return str(path)
