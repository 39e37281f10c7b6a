"""Messages about parts that cannot be computed with: estimators, magnets, coils, scatter, fields, files."""

from dataclasses import replace

import numpy as np

from spheretwin import plant
from spheretwin.analysis.tolerances import Tolerance, Tolerances, exceeded
from spheretwin.control.estimators.kalman import Kalman
from spheretwin.control.estimators.noise_and_lag import SampledSine, compare
from spheretwin.export.plant_code import magnetic_tables
from spheretwin.models import actuator as actuators
from spheretwin.models import magnetics
from spheretwin.models.design import rotor_field
from spheretwin.models.design.pole_torque import compute_curve
from spheretwin.models.scatter import scattered_model
from spheretwin.models.telemetry import joint_states
from tests.content.content import content_test, refusal, scratch
from tests.control.estimators.cases import sampling
from tests.models.design import test_rotor_field as of_rotors
from tests.models.poses import SECOND
from tests.models.test_part_shapes import COIL, SHAPES, model_file
from tests.models.test_scatter import ACTUATOR, scatter
from tests.twin.analysis.runs import made_of

MAGNETS = [
    'size="0.006 0.004" pos="0.028 0 0" zaxis="1 0 0"',
    'type="ellipsoid" size="0.006 0.004 0.004" pos="0.02 0 0"',
]
WAVE = np.zeros((50, 2))


def of_reference(name, period_s):
    return exceeded(made_of(WAVE), made_of(WAVE, period_s), Tolerances(signals={name: Tolerance()}))


def invalid_parts():
    folder, random = scratch("parts"), np.random.default_rng(1)
    bare = replace(ACTUATOR, torque_data=replace(ACTUATOR.torque_curve, distance_sensitivity=None))
    second = actuators.load(SECOND)
    model, field, tilt = (
        magnetics.torque_model(second),
        plant.parameters("ventusff"),
        plant.parameters("tilt"),
    )
    tables = field.magnetics.tables
    smaller = field.magnetics._replace(tables=tables._replace(field=tables.field[:-2]))
    calls = {
        "two periods": lambda: compare([100.0], SampledSine(duration_s=4.0)),
        "no noise": lambda: Kalman(acceleration_density_rad2_s3=1.0).build(sampling(noise=0.0)),
        "no winding": lambda: compute_curve(
            ACTUATOR.magnet, replace(ACTUATOR.coil, inner_radius_m=ACTUATOR.coil.outer_radius_m)),
        **{each: lambda each=each: rotor_field.compute(of_rotors.written(folder, each)) for each in MAGNETS},
        "negative times": lambda: joint_states.write(folder / "a.mcap", np.array([-1.0, 0.0]), {}, {}),
        **{each: lambda each=each: actuators.load(model_file(folder, COIL, each)) for each in SHAPES},
        "errors without distance": lambda: scattered_model(bare, scatter(random, 0.1, 0.01)),
        "errors of distance": lambda: scattered_model(bare, scatter(random, 0.1, 0.01, 1e-4)),
        "single coils": lambda: actuators.load(SECOND, actuators.TORQUE_CURVE_PATH),
        "curve of a field": lambda: second.torque_curve,
        "export of a field": lambda: magnetic_tables(model.arrangement[0], model.tables),
        "fields of two sizes": lambda: plant.Plants([field, field._replace(magnetics=smaller)]),
        "field and curve": lambda: plant.Plants([field, tilt]),
        "no such signal": lambda: of_reference("x_rd", 1e-3),
        "two periods of control": lambda: of_reference("x_rad", 2e-3),
    }  # fmt: skip
    return "\n".join(f"{name}: {refusal(call)}" for name, call in calls.items())


CASES = {"refused_parts": invalid_parts}


test_content = content_test(CASES)
