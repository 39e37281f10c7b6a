"""Config attributes of the plugin, voltages as controls, and what a model may lack."""

from pathlib import Path

import mujoco
import numpy as np
import pytest

from spheretwin import mujoco_plugin, scenario
from spheretwin.models import actuator as actuators
from spheretwin.models import magnetics
from tests.requirements import needs_compiled_functions

pytestmark = needs_compiled_functions

TEXT = mujoco_plugin.EXAMPLE.read_text().replace('"actuator.xml"', f'"{actuators.MJCF_PATH}"')
SECOND = Path(scenario.__file__).parent / "shipped" / "ventusff"
INSTANCE = '<instance name="coils"/>'
ACTUATOR = 'instance="coils" tendon="hinges"'


def configured(text=TEXT, **attributes):
    keys = "".join(f'<config key="{key}" value="{value}"/>' for key, value in attributes.items())
    return text.replace(INSTANCE, f'<instance name="coils">{keys}</instance>')


def compiled(text):
    return mujoco.MjModel.from_xml_string(text)


def forward(model, ctrl, q=(0.3, -0.2, 0.4), qdot=(3.0, 2.0, 1.0), **more):
    """Return the data of a moving rotor after a forward computation."""
    data = mujoco.MjData(model)
    for name, values in {"ctrl": ctrl, "qpos": q, "qvel": qdot, **more}.items():
        getattr(data, name)[:] = values
    mujoco.mj_forward(model, data)
    return data


def with_actuators(**attributes):
    """The example with attributes of each actuator, without a range of its control."""
    given = " ".join([ACTUATOR, *(f'{name}="{value}"' for name, value in attributes.items())])
    return TEXT.replace(ACTUATOR, given).replace('ctrlrange="-8 8"', "")


def test_gains_scale_the_torque_of_each_group(actuator):
    gain, current = np.linspace(0.9, 1.1, 18), np.linspace(-3, 3, 18)
    data = forward(compiled(configured(gain=" ".join(map(str, gain)))), current)
    expected = magnetics.torque_matrix(data.qpos, actuator) @ (gain * current)
    # Sums of 18 products below 0.1 N·m in another order.
    np.testing.assert_allclose(data.sensor("coil_torque").data, expected, rtol=0, atol=1e-15)


def test_a_curve_replaces_the_shipped_one(tmp_path):
    curve = tmp_path / "curve.csv"
    text = actuators.TORQUE_CURVE_PATH.read_text().splitlines()
    head = text.index("phi_deg,torque_Nm_per_A")
    halved = [f"{phi},{float(torque) / 2!r}" for phi, torque in (row.split(",") for row in text[head + 1 :])]
    curve.write_text("\n".join([text[head], *halved]))
    torques = [
        forward(compiled(configured(**attributes)), np.linspace(-3, 3, 18)).qfrc_actuator
        for attributes in ({"curve": curve}, {"gain": 0.5})
    ]
    # The spline of halved samples is half of the spline, within its rounding.
    np.testing.assert_allclose(*torques, rtol=0, atol=1e-14)


def test_an_actuator_with_a_torque_field_has_its_torque():
    second = actuators.load(SECOND / "actuator.xml")
    first = TEXT.index("  <actuator>\n")
    lines = "".join(f'<plugin name="group_{j}" {ACTUATOR}/>' for j in range(len(second.groups)))
    text = TEXT[:first] + f"<actuator>{lines}</actuator>" + TEXT[TEXT.index("</actuator>") + 11 :]
    text = text.replace(f"{actuators.MJCF_PATH}", f"{SECOND}/actuator.xml")
    current = np.linspace(-1, 1, len(second.groups))
    data = forward(compiled(configured(text, curve=SECOND / "torque_field.csv")), current)
    expected = magnetics.torque_matrix(data.qpos, second) @ current
    # Sums of 8 products below 0.1 N·m in another order.
    np.testing.assert_allclose(data.sensor("coil_torque").data, expected, rtol=0, atol=1e-15)


def test_voltages_drive_currents_through_resistance_and_inductance():
    resistance_ohm = np.linspace(5.7, 8.3, 18)
    coils = {"resistance_ohm": " ".join(map(repr, resistance_ohm.tolist())), "inductance_H": 0.5e-3}
    text = configured(with_actuators(actdim=1), input="voltage", **coils)
    data = forward(compiled(text), 12.0, act=np.linspace(-1, 1, 18))
    emf_V = data.sensor("coil_emf").data
    # Quotients of about 2e4 A/s, rounded four times.
    np.testing.assert_allclose(data.act_dot, (12.0 - resistance_ohm * data.act - emf_V) / 0.5e-3, rtol=1e-14)
    np.testing.assert_array_equal(data.sensor("coil_current").data, data.act)


def test_a_locked_rotor_reaches_the_current_of_ohm_s_law_exponentially():
    model = compiled(configured(with_actuators(actdim=1), input="voltage"))
    model.opt.timestep = 1e-4
    model.dof_armature[:] = 1e9
    data, time_constant_s = mujoco.MjData(model), 0.9e-3 / 1.3
    data.ctrl[:] = voltage_V = np.linspace(-6, 6, 18)
    mujoco.mj_step(model, data, nstep=10)
    expected = voltage_V / 1.3 * (1 - np.exp(-data.time / time_constant_s))
    # RK4 of a decay: (h/τ)^5/120 of the distance a step, 5e-7, over ten steps.
    np.testing.assert_allclose(data.act, expected, rtol=0, atol=5e-6 * 6 / 1.3)


def test_a_dyntype_makes_currents_follow_the_controls():
    model = compiled(with_actuators(dyntype="filter", dynprm=0.0007))
    data = mujoco.MjData(model)
    data.ctrl[:] = 1.0
    mujoco.mj_step(model, data, nstep=2)
    mujoco.mj_forward(model, data)
    np.testing.assert_array_equal(data.sensor("coil_current").data, data.act)
    # RK4 of a decay: (h/τ)^5/120 of the distance a step, 1.5e-3, over two steps.
    np.testing.assert_allclose(data.act, 1 - np.exp(-1e-3 / 0.7e-3), rtol=0, atol=3e-3)


def test_controls_are_clamped_to_their_range():
    ctrl = np.linspace(-5, 5, 18)
    data = forward(compiled(TEXT.replace('ctrlrange="-8 8"', 'ctrlrange="-2 1"')), ctrl)
    np.testing.assert_array_equal(data.sensor("coil_current").data, np.clip(ctrl, -2, 1))


INVALID = {
    "input": (configured(input="amps"), "input: expected current or voltage"),
    "gains": (configured(gain="1 2"), "gain: expected one number or 18, received 2"),
    "text": (configured(gain="a"), "gain: expected one number or one for each group"),
    "hinge": (configured(hinges="alpha beta delta"), 'expected a joint named "delta"'),
    "order": (configured(hinges="beta alpha gamma"), "hinges: expected beta as hinge number 1 of three"),
    "poles": (configured(poles="magnet_"), 'expected sites named "magnet_…", received none'),
    "sites": (configured(coils="pole_"), 'sites: expected those named "pole_…" in the body stator'),
    "curve": (configured(curve="none.csv"), "torque curve none.csv: expected a readable text file"),
    "resistances": (configured(resistance_ohm="1 2"), "resistance_ohm: expected one number or 18"),
    "resistance": (configured(resistance_ohm=-1), "resistance_ohm: expected a number above 0"),
    "states": (configured(input="voltage"), 'actuators: expected actdim="1" and no dyntype'),
    "sensor": (TEXT.replace("coil_emf", "volts"), "sensor: expected a name that ends with current, emf"),
    "actuators": (TEXT.replace("group_03", "x").replace(
        f'    <plugin name="x" {ACTUATOR} ctrlrange="-8 8"/>\n', ""), "expected 18 actuators"),
    "transmission": (TEXT.replace('tendon="hinges"', 'joint="alpha"'), "expected a fixed tendon over the"),
    "delay": (TEXT.replace(ACTUATOR, f'{ACTUATOR} delay="0.001" nsample="4"'), "expected no delay"),
}  # fmt: skip


@pytest.mark.parametrize(("text", "message"), INVALID.values(), ids=INVALID)
def test_an_invalid_model_is_refused_in_one_line(text, message):
    with pytest.raises(ValueError, match=r"spheretwin\.coils: ") as refused:
        compiled(text)
    # MuJoCo puts the line below its own, and repeats it.
    own = {line for line in f"{refused.value}".splitlines() if line.startswith("spheretwin.coils: ")}
    assert len(own) == 1
    assert message in own.pop()


def test_an_unknown_attribute_is_refused_by_name():
    with pytest.raises(ValueError, match="unrecognized attribute 'plugin:resistance'"):
        compiled(configured(resistance=1))


def test_names_follow_the_prefix_of_an_attachment(actuator):
    spec = mujoco.MjSpec()
    spec.option.timestep, spec.option.integrator = 5e-4, mujoco.mjtIntegrator.mjINT_RK4
    for prefix, x in (("left_", -0.3), ("right_", 0.3)):
        child = mujoco.MjSpec.from_file(str(mujoco_plugin.EXAMPLE))
        spec.attach(child, prefix=prefix, frame=spec.worldbody.add_frame(pos=[x, 0, 0]))
    model, random = spec.compile(), np.random.default_rng()
    data = forward(model, random.uniform(-3, 3, 36), random.uniform(-1, 1, 6), random.normal(size=6))
    for half, name in enumerate(("left_", "right_")):
        q, current = data.qpos[3 * half :][:3], data.ctrl[18 * half :][:18]
        expected = magnetics.torque_matrix(q, actuator) @ current
        # Sums of 18 products below 0.1 N·m in another order.
        np.testing.assert_allclose(data.sensor(f"{name}coil_torque").data, expected, rtol=0, atol=1e-15)
