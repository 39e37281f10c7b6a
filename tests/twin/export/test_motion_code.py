"""C of the motion, traced from the model: equal terms once, nothing of what is 0, and no other function."""

import re

from spheretwin import plant
from spheretwin.export.motion_code import controller_motion, plant_motion

MOTION = ("rotation", "solve_inertia", "mass_matrix", "hinge_acceleration", "coil_motion", "hinge_torque_of")


def functions_of(text):
    """Return the bodies of the functions by name."""
    return dict(re.findall(r"void NAME\((\w+)\)\([^\n]*\)\n\{\n(.*?)\n\}", text, re.DOTALL))


def motion_of(changes):
    return functions_of(plant_motion(plant.parameters("hold", changes).joint[0]))


def test_no_term_is_computed_twice_and_no_zero_is_added():
    for body in (*motion_of({}).values(), *functions_of(controller_motion()).values()):
        terms = re.findall(r"const \w+ t\d+ = (.*);", body)
        assert len(set(terms)) == len(terms)
        assert "ST_C(0.0)" not in body.replace("M->beta_gamma = ST_C(0.0);", "")


def test_an_ideal_joint_passes_its_motion_and_a_general_one_has_its_numbers():
    ideal, general = motion_of({}), motion_of({"plant.mass.axis_tilt_error_rad": 0.01})
    assert ideal.keys() == general.keys() == {*MOTION, "angular_velocity"}
    assert "coil_q[0] = q[0];" in ideal["coil_motion"]
    assert "ARC_TANGENT" in general["coil_motion"]
    assert "(void)p;" in general["mass_matrix"]
    assert "p->inertia_kg_m2[0]" in ideal["mass_matrix"]
