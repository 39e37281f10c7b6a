"""Actuators of another number of coil groups: signals, allocation, files and recording follow the model."""

import re

import numpy as np
import pytest

from spheretwin.models import actuator as actuators
from spheretwin.models.magnetics import torque_matrix
from tests.models.model_files import edited

RING = re.compile(r'(?s)<replicate count="12" euler="0 0 30">\s*<site name="coil_middle".*?</replicate>')


@pytest.fixture(params=[12, 24])
def groups(request):
    return request.param


@pytest.fixture
def model(tmp_path, groups):
    """The shipped actuator without its middle ring of coils, or with twice as many in it."""
    ring = RING.search(actuators.MJCF_PATH.read_text())[0]
    double = ring.replace('count="12" euler="0 0 30"', 'count="24" euler="0 0 15"')
    return edited(tmp_path, (ring, double if groups == 24 else ""))


def test_the_matrix_has_a_column_for_each_group(model, groups):
    actuator = actuators.load(model)
    assert len(actuator.groups) == groups
    G = torque_matrix(np.array([0.3, -0.2, 0.7]), actuator)
    assert G.shape == (3, groups)
    # The coils that both have pull alike, whatever stands between them.
    shipped = actuators.load()
    whole = torque_matrix(np.array([0.3, -0.2, 0.7]), shipped)
    for axis, column in zip(actuator.group_axes, G.T, strict=True):
        same = np.abs(shipped.group_axes @ axis) > 1 - 1e-12
        if same.any():
            sign = np.sign(shipped.group_axes[same][0] @ axis)
            # The same sum over pole lines, rounded alike but for the sign.
            np.testing.assert_allclose(column, sign * whole[:, same][:, 0], rtol=0, atol=1e-15)
