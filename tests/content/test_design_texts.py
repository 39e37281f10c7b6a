"""Content of the offline design: messages about geometry. Its numbers are tested in tests/models/design."""

from dataclasses import replace

import numpy as np

from spheretwin.models import actuator as actuators
from spheretwin.models.design import geometry_check
from tests.content.content import content_test
from tests.content.values import lines, plain


def geometry():
    """Gaps of geometries, and messages about those that cannot be built."""
    actuator = actuators.load()
    content = {"gap": geometry_check.air_gap_m(actuator)}
    changes = {
        "shipped": {},
        "wide coils": {"coil": replace(actuator.coil, outer_radius_m=0.03)},
        "wide poles": {"magnet": replace(actuator.magnet, radius_m=0.03)},
        "close coils": {"coil": replace(actuator.coil, distance_m=0.055)},
        "far poles": {"magnet": replace(actuator.magnet, front_radius_m=0.06)},
    }
    for name, change in changes.items():
        subject = replace(actuator, **change)
        checks = (geometry_check.air_gap_m, geometry_check.of_geometry, geometry_check.of_parts)
        content[name] = [each(subject) for each in checks]
    axes = np.array([[1.0, 0, 0], [0, 1.0, 0], [0.8, 0.6, 0]])
    content["clearance"] = geometry_check.clearance(axes, 0.01, 0.02, 0.05)
    return lines(plain(content))


CASES = {"design_geometry": geometry}
test_content = content_test(CASES)
