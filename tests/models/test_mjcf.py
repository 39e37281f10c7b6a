"""Model files: read once, read again when anything they name has changed, and no stage off that is needed."""

import os
import shutil
from itertools import product

import mujoco
import numpy as np
import pytest

from spheretwin import scenario as scenarios
from spheretwin.models import actuator as actuators
from spheretwin.models import mjcf
from spheretwin.models.base.errors import InputError
from spheretwin.plant.mass_properties import true_model
from spheretwin.plant.mujoco_rotor import MujocoRotor
from spheretwin.simulation import simulate

TEXT = actuators.MJCF_PATH.read_text(encoding="utf-8")
INERTIAL = '<inertial pos="0 0 0" mass="1.6" diaginertia="2.219e-3 2.176e-3 2.256e-3"/>'
GAMMA = '<joint name="gamma" axis="0 0 1"/>'


def inertia(path):
    return actuators.load(path).inertia


def edited_unnoticed(path, old, new):
    """Change a file, but neither its size nor the time of its last change."""
    before, text = path.stat(), path.read_text(encoding="utf-8")
    assert old in text
    path.write_text(text.replace(old, new), encoding="utf-8")
    os.utime(path, ns=(before.st_atime_ns, before.st_mtime_ns))
    assert (path.stat().st_size, path.stat().st_mtime_ns) == (before.st_size, before.st_mtime_ns)


def test_a_file_is_read_once(tmp_path, monkeypatch):
    (path := tmp_path / "mine.xml").write_text(TEXT)
    original = mjcf.read(path)
    assert mjcf.read(path) is original
    (tmp_path / "other.xml").write_text(TEXT)  # a neighbour that the file does not name
    path.touch()
    assert mjcf.read(path) is original
    monkeypatch.chdir(tmp_path)
    assert mjcf.read(path.relative_to(tmp_path)) is original
    assert mjcf.read(tmp_path / "other.xml") is not original
    edited_unnoticed(path, "2.219e-3", "2.220e-3")
    assert inertia(path)[0] == 2.220e-3


def test_a_fingerprint_without_a_second_look_at_the_files_misses_no_change(tmp_path, monkeypatch):
    """All files count as settled at once: what is known of them is used from the second call on."""
    monkeypatch.setattr(mjcf, "SETTLED_s", -1.0)
    mesh = '<asset><mesh name="part" file="part.obj"/></asset>'
    (path := tmp_path / "mine.xml").write_text(TEXT.replace("</mujoco>", f"{mesh}</mujoco>"))
    (link := tmp_path / "link.xml").symlink_to(path)
    reads = []
    real = mjcf._texts_and_sources
    monkeypatch.setattr(mjcf, "_texts_and_sources", lambda of: (reads.append(of), real(of))[1])
    found = [mjcf.fingerprint(link)]
    assert mjcf.fingerprint(link) == found[0]
    assert len(reads) == 1

    def changed(change):
        change()
        found.append(mjcf.fingerprint(link))
        assert found[-1] not in found[:-1]
        assert mjcf.fingerprint(link) == found[-1]

    changed(lambda: path.write_text(path.read_text() + "<!-- -->"))
    changed(lambda: (tmp_path / "part.obj").write_text("v 0 0 0"))
    changed(lambda: (tmp_path / "part.obj").write_text("v 0 0 0\nv 1 1 1"))
    shutil.copy(path, other := tmp_path / "other.xml")
    other.write_text(other.read_text() + "<!-- of the other -->")
    link.unlink()
    changed(lambda: link.symlink_to(other))
    assert len(reads) == 5


def test_only_so_many_files_are_kept(tmp_path):
    paths = [tmp_path / f"{number}.xml" for number in range(mjcf.MOST_MODELS + 1)]
    for path in paths:
        path.write_text(TEXT)
    first = mjcf.read(paths[0])
    for path in paths[1:]:
        mjcf.read(path)
    assert mjcf.read(paths[-1]) is mjcf.read(paths[-1])
    assert mjcf.read(paths[0]) is not first


def test_a_broken_file_is_read_after_its_correction(tmp_path):
    (path := tmp_path / "mine.xml").write_text(TEXT.replace("</mujoco>", ""))
    for _ in range(2):
        with pytest.raises(InputError, match="expected valid MJCF"):
            mjcf.read(path)
    path.write_text(TEXT)
    assert inertia(path)[0] == 2.219e-3


def included(folder, inner, name="rotor.xml", comment=""):
    """A model whose rotor's inertia stands in another file, named `inner`."""
    (folder / inner).parent.mkdir(parents=True, exist_ok=True)
    (folder / inner).write_text(f"<mujoco>{comment}{INERTIAL}</mujoco>")
    (path := folder / "mine.xml").write_text(TEXT.replace(INERTIAL, f'<include file="{name}"/>'))
    return path


@pytest.mark.parametrize(
    ("inner", "name", "middle"),
    [
        ("rotor.xml", "rotor.xml", None),
        ("parts/rotor.xml", "parts/rotor.xml", None),
        ("rotor", "rotor", None),
        ("R&D/rotor.xml", "R&amp;D/rotor.xml", None),
        ("../rotor.xml", "../rotor.xml", None),
        ("inner.inc", "middle.inc", "middle.inc"),
        ("inner.inc", "parts/middle.part", "parts/middle.part"),
    ],
)
def test_an_edited_include_is_read_again(tmp_path, inner, name, middle):
    """Of the file, or of another file that it includes."""
    (folder := tmp_path / "model").mkdir()
    path = included(folder, inner, name)
    if middle:
        (folder / middle).parent.mkdir(exist_ok=True)
        # A byte-order mark and white space come before the first tag.
        text = f'\ufeff\n <mujoco><include file="{inner}"/></mujoco>'
        (folder / middle).write_text(text, encoding="utf-8")
    assert mjcf.read(path) is mjcf.read(path)
    edited_unnoticed(folder / inner, "2.219e-3", "2.220e-3")
    assert inertia(path)[0] == 2.220e-3


def test_text_that_moves_from_one_include_to_the_next_is_a_change(tmp_path):
    mass, size = 'mass="1.6"', 'mass="1.7"'
    first = included(tmp_path, "a.xml", "a.xml")
    include = '<include file="a.xml"/>'
    first.write_text(first.read_text().replace(include, f'{include}<!-- file="b.xml" file="c.xml" -->'))
    (tmp_path / "b.xml").write_text(f"<mujoco/>{mass}{size}")
    (tmp_path / "c.xml").write_text("<mujoco/>")
    original = mjcf.read(first)
    (tmp_path / "b.xml").write_text(f"<mujoco/>{mass}")
    (tmp_path / "c.xml").write_text(f"{size}<mujoco/>")
    assert mjcf.read(first) is not original


def test_files_that_name_each_other_are_looked_into_once(tmp_path):
    (folder := tmp_path / "parts").mkdir()
    names = '<!-- file="../mine.xml" file="rotor.xml" -->'
    path = included(tmp_path, "parts/rotor.xml", "parts/rotor.xml", names)
    assert inertia(path)[0] == 2.219e-3
    (folder / "loop.xml").symlink_to("loop.xml")
    (folder / "rotor.xml").write_text(f'<mujoco><!-- file="loop.xml" -->{INERTIAL}</mujoco>')
    assert inertia(path)[0] == 2.219e-3


CUBE = "".join(f"v {x}.00 {y}.00 {z}.00\n" for z, y, x in product((-1, 1), repeat=3))
CUBE += "".join(f"f {face}\n" for face in ("1 3 4 2", "5 6 8 7", "1 2 6 5", "3 7 8 4", "1 5 7 3", "2 4 8 6"))
HEAVY = '<geom type="mesh" mesh="cube" mass="1.5"/>'
ASSET = '<mesh name="cube" file="{}" scale="0.04 0.04 0.04"/>'


def with_a_heavy_mesh(folder, directories, mesh, assets):
    """A model whose rotor has the inertia of a mesh, and the mesh, beside those that are only drawn."""
    shutil.copytree(actuators.FOLDER / "assets", (folder / mesh).parent, dirs_exist_ok=True)
    (folder / mesh).write_text(CUBE)
    text = TEXT.replace(INERTIAL, HEAVY).replace('meshdir="assets"', directories)
    (path := folder / "mine.xml").write_text(text.replace("<asset>", f"<asset>{assets}"))
    return path, folder / mesh


@pytest.mark.parametrize("split", [False, True], ids=["one file", "include"])
@pytest.mark.parametrize(
    ("directories", "name", "mesh"),
    [
        ('meshdir="meshes"', "cube.obj", "meshes/cube.obj"),
        ('assetdir="meshes"', "cube.obj", "meshes/cube.obj"),
        ('meshdir="meshes" texturedir="images"', "cube.obj", "meshes/cube.obj"),
        ('meshdir=".."', "cube.obj", "../cube.obj"),
        ('meshdir="meshes" strippath="true"', "elsewhere/cube.obj", "meshes/cube.obj"),
        ("", "cube.obj", "cube.obj"),
    ],
)
def test_an_edited_mesh_is_read_again(tmp_path, directories, name, mesh, split):
    (folder := tmp_path / "model").mkdir()
    asset, include = ASSET.format(name), '<include file="more.xml"/>'
    path, mesh = with_a_heavy_mesh(folder, directories, mesh, include if split else asset)
    (folder / "more.xml").write_text(f"<mujoco>{asset}</mujoco>")
    # A cube of 80 mm: m a²/6; its corners are single precision in the engine.
    np.testing.assert_allclose(inertia(path), 1.5 * 0.08**2 / 6, rtol=1e-6)
    edited_unnoticed(mesh, "1.00", "0.50")
    np.testing.assert_allclose(inertia(path), 1.5 * 0.04**2 / 6, rtol=1e-6)


def test_a_run_does_not_change_what_is_kept():
    original = mjcf.read(actuators.MJCF_PATH)

    def numbers():
        return [
            (model.body_inertia.copy(), model.body_mass.copy(), model.opt.timestep, model.opt.disableflags)
            for model in (original.described, original.bare, original.loaded)
        ]

    before = numbers()
    for payload_kg in (0.0, 0.05):
        MujocoRotor([true_model(original, 0.2, payload_kg, 1.62)], 1e-3, "Euler")
    for ours, theirs in zip(before, numbers(), strict=True):
        np.testing.assert_equal(ours, theirs)


def bytes_of_a_run(path=None):
    changes = {"duration": 0.5} | ({"plant.mjcf": str(path)} if path else {})
    return simulate(scenarios.load("nutation", changes)).telemetry.values.tobytes()


def test_a_copy_of_the_shipped_model_runs_the_same_bytes(tmp_path):
    shipped = bytes_of_a_run()
    copy = shutil.copy(actuators.MJCF_PATH, tmp_path / "copy.xml")
    for path in (copy, actuators.MJCF_PATH, actuators.FOLDER / "scene.xml"):
        assert bytes_of_a_run(path) == shipped


ROTOR = """
<mujoco>
  {extension}
  <option {option}><flag {flag}/></option>
  <worldbody>
    <site name="anchor" pos="0 0 1"/>
    <geom name="floor" type="plane" size="1 1 1" contype="0" conaffinity="0"/>
    <body name="rotor" {body}>
      <joint name="hinge" axis="0 1 0" {joint}/>
      <geom name="ball" size="0.1" {geom}/>
      <site name="tip" pos="0 0 0.2"/>
    </body>
  </worldbody>
  {sections}
</mujoco>
"""
EDGES = {"extension": "", "option": "", "flag": "", "body": "", "joint": "", "sections": "",
         "geom": 'contype="0" conaffinity="0"'}  # fmt: skip
COLLIDING = 'contype="1" conaffinity="1"'
PAIR = '<contact><pair geom1="ball" geom2="floor"/></contact>'
EQUALITY = '<equality><joint joint1="hinge"/></equality>'
FIXED_TENDON = '<tendon><fixed><joint joint="hinge" coef="1"/></fixed></tendon>'
SPATIAL_TENDON = '<tendon><spatial><site site="anchor"/><site site="tip"/></spatial></tendon>'
MOTOR = '<actuator><motor joint="hinge"/></actuator>'
PLUGIN = '<actuator><plugin joint="hinge" instance="pid"/></actuator>'
PID = '<extension><plugin plugin="mujoco.pid"><instance name="pid"/></plugin></extension>'
FLEX = (
    '<deformable><flex name="f" dim="1" body="rotor world" vertex="0 0 0 0 0 1" element="0 1"/></deformable>'
)
BITS = (f"mjDSBL_{name}" for name in ("CONSTRAINT", "SPRING", "DAMPER", "ACTUATION"))
CONSTRAINT, SPRING, DAMPER, ACTUATION = (int(getattr(mujoco.mjtDisableBit, name)) for name in BITS)
PASSIVE = SPRING | DAMPER

NEEDED = {
    "nothing": ({}, [], 0),
    "limit": ({"joint": 'limited="true" range="-1 1"'}, [], 0),
    "limit margin": ({"joint": 'limited="true" range="-1 1" margin="0.1"'}, ["limit margin"], CONSTRAINT),
    "margin of no limit": ({"joint": 'limited="false" range="-1 1" margin="0.1"'}, [], 0),
    "frictionloss": ({"joint": 'frictionloss="0.1"'}, ["frictionloss"], CONSTRAINT),
    "stiffness": ({"joint": 'stiffness="1"'}, ["stiffness"], SPRING),
    "stiffness of higher order": ({"joint": 'stiffness="0 1"'}, ["stiffness"], SPRING),
    "damping": ({"joint": 'damping="1"'}, ["damping"], DAMPER),
    "damping of higher order": ({"joint": 'damping="0 1"'}, ["damping"], DAMPER),
    "armature": ({"joint": 'armature="1"'}, ["armature"], 0),
    "equality": ({"sections": EQUALITY}, ["equality"], CONSTRAINT),
    "fixed tendon": ({"sections": FIXED_TENDON}, ["tendon"], CONSTRAINT | PASSIVE),
    "spatial tendon": ({"sections": SPATIAL_TENDON}, ["tendon"], CONSTRAINT | PASSIVE),
    "actuator": ({"sections": MOTOR}, ["actuator"], ACTUATION | PASSIVE),
    "plugin": ({"extension": PID, "sections": PLUGIN}, ["actuator", "plugin"], ACTUATION | PASSIVE),
    "contact": ({"geom": COLLIDING}, ["contact"], CONSTRAINT),
    "contact switched off": ({"geom": COLLIDING, "flag": 'contact="disable"'}, [], 0),
    "pair": ({"sections": PAIR}, ["contact"], CONSTRAINT),
    "pair switched off": ({"sections": PAIR, "flag": 'contact="disable"'}, [], 0),
    "density": ({"option": 'density="1"'}, ["fluid"], PASSIVE),
    "viscosity": ({"option": 'viscosity="1"'}, ["fluid"], PASSIVE),
    "wind": ({"option": 'wind="1 0 0"'}, [], 0),
    "gravity compensation": ({"body": 'gravcomp="1"'}, ["gravity compensation"], PASSIVE),
    "gravity": ({"option": 'gravity="1 0 0"'}, ["gravity other than along -z"], 0),
    "flex": ({"sections": FLEX}, ["flex"], CONSTRAINT | PASSIVE),
}  # fmt: skip


@pytest.mark.parametrize(("parts", "names", "needed"), NEEDED.values(), ids=NEEDED)
def test_a_stage_is_switched_off_only_where_it_has_nothing_to_do(parts, names, needed):
    model = mujoco.MjModel.from_xml_string(ROTOR.format(**EDGES | parts))
    idle = mjcf.idle_stages(model)
    every = CONSTRAINT | SPRING | DAMPER | ACTUATION | int(mujoco.mjtDisableBit.mjDSBL_SENSOR)
    assert idle == every & ~needed
    assert mjcf.beyond_a_free_rotor(model) == names


def test_the_shipped_model_needs_no_stage():
    original = mjcf.read(actuators.MJCF_PATH)
    for model in (original.bare, original.loaded):
        for bit in (CONSTRAINT, SPRING, DAMPER, ACTUATION):
            assert mjcf.idle_stages(model) & bit
