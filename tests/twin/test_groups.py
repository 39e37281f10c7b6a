"""Actuators of another number of coil groups: signals, allocation, files and recording follow the model."""

import re

import numpy as np
import pytest

from spheretwin.models import actuator as actuators
from spheretwin.models.magnetics import torque_matrix
from spheretwin.simulation import simulate
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


@pytest.mark.release("18 s to compile for each number of groups; test_torque_fields tracks with 8")
@pytest.mark.parametrize("engine", ["mujoco", "lagrangian"])
@pytest.mark.parametrize("allocation", ["least_norm", "bounded"])
def test_a_run_tracks_with_the_groups_there_are(model, groups, engine, allocation):
    changes = {"plant.mjcf": str(model), "duration": 0.4, "plant.engine": engine, "allocation": allocation}
    run = simulate("hold", changes | {"plant.group_gain": [1.0] * groups})
    table = run.telemetry
    assert run.status == "completed"
    assert table["current_A"].shape == table["current_command_A"].shape == (400, groups)
    actuator = actuators.load(model)
    for row in (1, 200, 399):  # what is logged is what the currents give, G_t(q) I (15), amid the first step
        middle = table["q_rad"][row] + 0.25e-3 * table["qdot_rad_s"][row]
        G = torque_matrix(middle, actuator)
        # A product of 3 x 24 numbers, summed in another order.
        np.testing.assert_allclose(G @ table["current_A"][row], table["torque_Nm"][row], rtol=0, atol=1e-13)
    assert np.abs(table["error_rad"][-1]).max() < 0.5 * np.abs(table["error_rad"][0]).max()
