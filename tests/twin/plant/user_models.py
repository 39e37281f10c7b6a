"""Model files of users, as edits of the shipped one: its pieces of physics, and all else it may hold."""

from typing import NamedTuple

# Where a piece of physics is put in.
COMPILER = "<compiler "
OPTION = '<option integrator="RK4" '
FLAGS = '<flag autoreset="disable" contact="disable"/>'
WORLD = "<worldbody>"
STATOR = '<geom name="stator" class="rotor_shell" mesh="stator" rgba="0.45 0.50 0.56 1"/>'
ALPHA = '<joint name="alpha" class="tilt_hinge" axis="1 0 0"/>'
BETA = '<joint name="beta" class="tilt_hinge" axis="0 1 0"/>'
GAMMA = '<joint name="gamma" axis="0 0 1"/>'
ROTOR = '<body name="rotor">'
INERTIAL = '<inertial pos="0 0 0" mass="1.6" diaginertia="2.219e-3 2.176e-3 2.256e-3"/>'
TIP = '<site name="shaft_tip" class="marker" pos="0 0 0.12"/>'
BALL = '<geom name="ball" class="rotor_shell" mesh="ball"/>'
MOUNT = '<geom name="payload" type="cylinder" size="0.009 0.006" rgba="0.95 0.75 0.15 1"/>'
EMPTY = '<inertial pos="0 0 0" mass="0" diaginertia="0 0 0"/>\n              ' + MOUNT
RING = 'diaginertia="1.1e-15 1.1e-15 1.1e-15"/>'
END = "</mujoco>"

Edits = tuple[tuple[str, str], ...]


def with_attributes(tag: str, attributes: str) -> Edits:
    return ((tag, tag.replace("/>", f" {attributes}/>")),)


def after(tag: str, addition: str) -> Edits:
    return ((tag, tag + addition),)


def at_the_end(section: str) -> Edits:
    return ((END, section + END),)


class Case(NamedTuple):
    """A piece of physics, what it is called, and the model without it where that is not the shipped one."""

    edits: Edits
    name: str
    without: Edits = ()


CONTACTS = ((FLAGS, '<flag autoreset="disable"/>'),)
COLLIDING = 'contype="1" conaffinity="1"'
ARM = '<geom name="arm" type="sphere" size="0.01" pos="0.05 0 0.1" {}/>'
POST = '<geom name="post" type="sphere" size="0.02" pos="{} -0.035 0.1" {}/>'
ANCHOR = '<site name="anchor" pos="0.1 0 0.1"/>'
LOAD = '<body name="load" pos="0.02 0 0.05" {}><geom type="box" size="0.01 0.01 0.01" mass="0.05"/></body>'
POINT = '<body name="point" pos="0.02 0 0.05"><inertial pos="0 0 0" mass="0.05" diaginertia="0 0 0"/></body>'
DISC = '<geom type="ellipsoid" size="0.05 0.03 0.04" {}/>'
PID = (
    '<extension><plugin plugin="mujoco.pid"><instance name="pid"><config key="kp" value="0.4"/>'
    '<config key="ki" value="1"/></instance></plugin></extension>'
)


def fluid(attributes: str) -> Edits:
    return ((OPTION, f"{OPTION}{attributes} "),)


def hinge(attributes: str) -> Edits:
    return with_attributes(GAMMA, attributes)


def spatial_tendon(attributes: str, site: str = "shaft_tip", between: str = "") -> Edits:
    path = f'<site site="anchor"/>{between}<site site="{site}"/>'
    return at_the_end(f"<tendon><spatial {attributes}>{path}</spatial></tendon>")


def fixed_tendon(attributes: str) -> Edits:
    joints = '<joint joint="gamma" coef="1"/><joint joint="alpha" coef="-1"/>'
    return at_the_end(f"<tendon><fixed {attributes}>{joints}</fixed></tendon>")


def actuator(inside: str, others: Edits = (), name: str = "actuator") -> Case:
    return Case(others + at_the_end(f"<actuator>{inside}</actuator>"), name)


def equality(inside: str, others: Edits = ()) -> Case:
    return Case(others + at_the_end(f"<equality>{inside}</equality>"), "equality")


def pair(geom: str) -> Edits:
    return at_the_end(f'<contact><pair geom1="{geom}" geom2="post"/></contact>')


SERVO = '<position site="{}" refsite="anchor" kp="3" gear="1 0 0 0 0 0"/>'
GRAVITY = "gravity other than along -z"


ANCHORED = after(STATOR, ANCHOR)
EYE = after(MOUNT, '<site name="eye"/>')
LOADED = after(TIP, LOAD.format(""))
LOW = after(STATOR, ANCHOR.replace("0 0.1", "0 0.05"))
SPRING = 'stiffness="30"'
DRUM = '<geom geom="drum"/>'

CASES = {
    "frictionloss": Case(hinge('frictionloss="0.1"'), "frictionloss"),
    "stiffness": Case(hinge('stiffness="0.2"'), "stiffness"),
    "springref": Case(hinge('stiffness="0.2" springref="20"'), "stiffness", hinge('stiffness="0.2"')),
    "damping": Case(hinge('damping="0.05"'), "damping"),
    "damping of higher order": Case(hinge('damping="0 0.05"'), "damping"),
    "armature": Case(hinge('armature="0.001"'), "armature"),
    "limit margin": Case(with_attributes(ALPHA, 'margin="80"'), "limit margin"),
    "equality of joints": equality('<joint joint1="gamma" joint2="alpha" polycoef="0 0.5 0 0 0"/>'),
    "equality of bodies": equality(
        '<connect body1="rotor" body2="stator" anchor="0 0 0.03" solref="0.2 1"/>'
    ),
    "equality of sites": equality(
        '<connect site1="shaft_tip" site2="above" solref="0.2 1"/>',
        after(STATOR, '<site name="above" pos="0 0 0.12"/>'),
    ),
    "weld of the mount": equality('<weld body1="payload" body2="stator" solref="0.2 1"/>'),
    "weld to a mocap body": equality(
        '<connect body1="rotor" body2="held" anchor="0 0 0.1" solref="0.2 1"/>',
        after(WORLD, '<body name="held" mocap="true" pos="0 0 0.1"/>')
        + at_the_end('<keyframe><key qpos="0 0 1" mpos="0 0 1"/></keyframe>'),
    ),
    "fixed tendon": Case(fixed_tendon('stiffness="0.3" damping="0.01"'), "tendon"),
    "fixed tendon with a limit": Case(fixed_tendon('limited="true" range="-0.1 0.1"'), "tendon"),
    "spatial tendon": Case(ANCHORED + spatial_tendon('stiffness="30" springlength="0.01"'), "tendon"),
    "spatial tendon with friction": Case(ANCHORED + spatial_tendon('frictionloss="0.5"'), "tendon"),
    "spatial tendon with a limit": Case(ANCHORED + spatial_tendon('limited="true" range="0 0.09"'), "tendon"),
    "spatial tendon over what is only drawn": Case(
        LOW
        + after(STATOR, '<geom name="drum" type="sphere" size="0.105"/>')
        + spatial_tendon(SPRING, between=DRUM),
        "tendon",
        LOW + spatial_tendon(SPRING),
    ),
    "spatial tendon on the mount": Case(ANCHORED + EYE + spatial_tendon(SPRING, site="eye"), "tendon"),
    "density": Case(fluid('density="1000"'), "fluid"),
    "viscosity": Case(fluid('viscosity="5"'), "fluid"),
    "wind": Case(fluid('density="1000" wind="2 3 0"') + LOADED, "fluid", fluid('density="1000"') + LOADED),
    "drag of a shape that is only drawn": Case(
        fluid('viscosity="1"') + after(TIP, DISC.format('fluidshape="ellipsoid"')),
        "fluid",
        fluid('viscosity="1"') + after(TIP, DISC.format("")),
    ),
    "contact": Case(
        CONTACTS
        + after(TIP, ARM.format(COLLIDING + ' mass="0.02"'))
        + after(STATOR, POST.format(0.04, COLLIDING)),
        "contact",
    ),
    "contact on the mount": Case(
        CONTACTS + with_attributes(MOUNT, COLLIDING) + after(STATOR, POST.format(0, COLLIDING)), "contact"
    ),
    "pair of what is only drawn": Case(
        CONTACTS + after(TIP, ARM.format("")) + after(STATOR, POST.format(0.04, "")) + pair("arm"), "contact"
    ),
    "pair with the mount": Case(CONTACTS + after(STATOR, POST.format(0, "")) + pair("payload"), "contact"),
    "gravity aslant": Case(fluid('gravity="5 0 -9.81"') + LOADED, GRAVITY, LOADED),
    "gravity upwards": Case(fluid('gravity="0 0 9.81"') + LOADED, GRAVITY, LOADED),
    "gravity compensation": Case(after(TIP, LOAD.format('gravcomp="0.5"')), "gravity compensation", LOADED),
    "position servo": actuator('<position joint="gamma" kp="0.3" kv="0.01"/>'),
    "servo between sites": actuator(SERVO.format("shaft_tip"), ANCHORED),
    "servo on the mount": actuator(SERVO.format("eye"), ANCHORED + EYE),
    "bias of an actuator": actuator('<general joint="gamma" biastype="affine" biasprm="0.05 -0.2 0"/>'),
    "damping of an actuator": actuator('<motor joint="gamma" damping="0.02"/>'),
    "armature of an actuator": actuator('<motor joint="gamma" armature="0.001"/>'),
    "actuator with a state": actuator(
        '<general joint="gamma" dyntype="filter" dynprm="0.1" biastype="affine" biasprm="0.05"/>'
    ),
    "plugin": actuator(
        '<plugin joint="gamma" actdim="1" instance="pid"/>', ((COMPILER, f"{PID}{COMPILER}"),), "plugin"
    ),
}


# What a user's file may hold beside its physics: it moves nothing, and keeps no file from being read.
TUPLE = '<custom><tuple name="t"><element objtype="{}" objname="{}"/></tuple></custom>'

IDLE = {
    "no flags": ((FLAGS, ""),),
    "missing mesh that is only drawn": (("ball.obj", "nowhere.obj"),),
    "no options": ((OPTION + 'timestep="0.0005">', "<option>"),),
    "keyframes": at_the_end('<keyframe><key name="tilted" qpos="0.1 0.2 0.3" qvel="1 2 3"/></keyframe>'),
    "tuple of a site": at_the_end(TUPLE.format("site", "shaft_tip")),
    "tuple of the mount": at_the_end(TUPLE.format("body", "payload")),
    "tuple of a sensor": at_the_end(TUPLE.format("sensor", "alpha_position")),
    "sensors of sites": at_the_end(
        '<sensor><framepos objtype="site" objname="shaft_tip"/><accelerometer site="shaft_tip"/></sensor>'
    ),
    "camera at the mount": after(STATOR, '<camera mode="targetbody" target="payload"/>'),
    "light on the mount": after(MOUNT, '<light mode="targetbodycom" target="rotor"/>'),
    "exclusion of the mount": at_the_end('<contact><exclude body1="payload" body2="stator"/></contact>'),
    "wind without air": ((OPTION, f'{OPTION}wind="3 0 0" magnetic="0 0 1" '),),
    "solver": ((OPTION, f'{OPTION}solver="CG" cone="elliptic" iterations="3" impratio="10" '),),
    "flags": ((FLAGS, '<flag contact="disable" energy="enable" sleep="enable" limit="disable"/>'),),
}


def box(sizes, mass):
    return f'<geom type="box" size="{sizes}" mass="{mass}"/>'


BALL_INSIDE = '<geom type="sphere" size="0.03" mass="0.5" {}/>'
FORCED = (
    (COMPILER, '<compiler inertiafromgeom="true" '),
    (RING, RING + '<geom type="sphere" size="0.002" mass="1e-9"/>'),  # rings must have a mass
)

INERTIAS = {
    "sphere": ((INERTIAL, '<geom type="sphere" size="0.04" mass="1.5"/>'),),
    "box": ((INERTIAL, box("0.045 0.03 0.04", 1.5)),),
    "box and sphere": ((INERTIAL, box("0.03 0.04 0.045", 1.5) + BALL_INSIDE.format("")),),
    "axes in another order": ((INERTIAL, box("0.045 0.03 0.04", 1.5) + BALL_INSIDE.format("")),),
    "axes in a third order": ((INERTIAL, box("0.04 0.045 0.03", 1.5) + BALL_INSIDE.format("")),),
    "by force": FORCED + after(INERTIAL, box("0.03 0.04 0.045", 1.5)),
    "by force, axes in another order": FORCED
    + after(INERTIAL, box("0.045 0.03 0.04", 1.5) + BALL_INSIDE.format("")),
    "full matrix": ((INERTIAL, '<inertial pos="0 0 0" mass="1" fullinertia="1e-3 3e-3 2.5e-3 0 0 0"/>'),),
}


OBLIQUE = '<geom type="box" size="0.03 0.04 0.045" pos="1e-3 0 2e-3" euler="10 20 0" mass="1.4"/>'

# Mass properties and hinges that the closed-form equations of motion lack, and their names.
GENERAL = {
    "body on the rotor": (after(TIP, LOAD.format("")), "mass of body load"),
    "body on a ring": (after(ALPHA, LOAD.format("")), "mass of body load"),
    "body without a name": (after(TIP, LOAD.format("").replace('name="load" ', "")), "mass of body number"),
    "point mass": (after(TIP, POINT), "mass of body point"),
    "body on the mount": (after(MOUNT, LOAD.format("")), "mass of body load"),
    "rings with inertia": (
        ((RING, 'diaginertia="2e-4 1e-4 1.5e-4"/>'), ("2.3e-12", "0.2"), ("4.3e-12", "0.2")),
        "mass of body outer_ring",
    ),
    "rotor off its centre": (((INERTIAL, INERTIAL.replace("0 0 0", "1e-3 -2e-3 1e-3")),), "centre of mass"),
    "full inertia": (((INERTIAL, '<inertial pos="0 0 0" mass="1.6" fullinertia="2.2e-3 2.3e-3 2.1e-3 1e-4'
                      ' -2e-4 5e-5"/>'),), "products of inertia"),
    "oblique box": (((INERTIAL, OBLIQUE),), "products of inertia"),
    "tilted hinge": (((BETA, BETA.replace("0 1 0", "0.01 1 -0.02")),), "tilt or offset of hinge beta"),
    "distant hinge": (((BETA, BETA.replace("/>", ' pos="2e-4 0 -3e-4"/>')),), "tilt or offset of hinge beta"),
}  # fmt: skip

ON_THE_MOUNT = {
    "nothing": ((), ""),
    "site": ((), '<site name="eye"/>'),
    "body": ((), LOAD.format("")),
    "shape in a fluid": (fluid('viscosity="1"'), DISC.format('fluidshape="ellipsoid"')),
}


REFUSED = {
    "ref": hinge('ref="10"'),
    "mass of the mount": ((EMPTY, MOUNT.replace("/>", ' mass="0.05"/>')),),
    "inertia of the mount": (
        (EMPTY, EMPTY.replace('"0 0 0"/>', '"1e-3 1e-3 1e-3"/>').replace('pos="1e-3 1e-3 1e-3"', "")),
    ),
    "rotor turned on its hinge": ((ROTOR, '<body name="rotor" euler="0 0 30">'),),
    "rotor off its hinges": ((ROTOR, '<body name="rotor" pos="0 0 0.01">'),),
    "hinge of another direction": ((BETA, BETA.replace("0 1 0", "0.2 1 0")),),
    "hinge against its direction": ((BETA, BETA.replace("0 1 0", "0 -1 0")),),
    "hinge far from the centre": ((BETA, BETA.replace("/>", ' pos="0.01 0 0"/>')),),
    "fourth joint": after(TIP, LOAD.format("").replace("><geom", '><joint axis="1 0 0"/><geom')),
    "joint of the mount": ((EMPTY, '<joint axis="1 0 0"/>' + MOUNT.replace("/>", ' mass="0.05"/>')),),
    "missing mesh that is heavy":
        (("ball.obj", "nowhere.obj"), (INERTIAL, ""), *with_attributes(BALL, 'mass="1"')),
    "missing mesh that collides":
        (("shaft.obj", "nowhere.obj"), ('mesh="shaft"', f'mesh="shaft" {COLLIDING}')),
    "name that no mesh can have": (("pole.obj", "x" * 5000 + ".obj"),),
    "missing include": after(WORLD, '<include file="nowhere.xml"/>'),
}  # fmt: skip
