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
