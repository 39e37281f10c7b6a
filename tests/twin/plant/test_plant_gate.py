"""Gate of the public plant: a length is checked before memory is read; tests/content has every refusal."""

import numpy as np
import pytest

from spheretwin import plant
from spheretwin.models.base.errors import InputError


def test_what_follows_a_view_in_memory_is_not_read():
    """A view of 17 currents lies in front of others; the step read the eighteenth from there."""
    memory, state = np.full(40, 100.0), plant.State(np.zeros(3), np.zeros(3))
    with pytest.raises(InputError, match="one finite number for each group"):
        plant.step(state, memory[:17], np.zeros(3), plant.parameters("nutation"), 5e-4)


@pytest.mark.parametrize(
    ("scenario", "name"), [("nutation", "curve"), ("ventusff", "field")], ids=["curve", "field"]
)
def test_a_table_of_another_shape_is_not_read(scenario, name):
    """Its rows are found without a check: a shorter table would be read beyond its end."""
    parameters = plant.parameters(scenario)
    model, groups = parameters.magnetics, len(parameters.torque_gain)
    shorter = model.tables._replace(**{name: getattr(model.tables, name)[:3].copy()})
    wrong = parameters._replace(magnetics=model._replace(tables=shorter))
    state = plant.State(np.zeros(3), np.zeros(3))
    with pytest.raises(InputError, match=f"expected tables.{name} of `torque_model`"):
        plant.step(state, np.zeros(groups), np.zeros(3), wrong, 5e-4)
    with pytest.raises(InputError, match=f"expected tables.{name} of `torque_model`"):
        plant.Plants([wrong])
