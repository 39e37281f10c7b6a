"""Loader of MJCF files: each is read once, checked by the engine's compiler, and none of its physics is lost.

A file gives three models. One has its sites, from which the actuator is read. The two models for simulation
have no sites, no sensors and no visual geoms, because each costs time in every stage of a step. The engine
decides which geoms are visual (`MjSpec.discard_visual`): those that neither collide nor are referenced; their
inertia stays.
"""

from __future__ import annotations

import codecs
import hashlib
import html
import os
import re
import time
from collections import OrderedDict
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import NamedTuple

import mujoco
import numpy as np

from spheretwin.models.base.errors import InputError, without_breaks
from spheretwin.models.base.files import regular_file
from spheretwin.models.base.mujoco_library import compiler_warnings, silence_warnings

PAYLOAD = "payload"
ROTOR = "rotor"

OTHER_GRAVITY = "gravity other than along -z"

# Share of the rotor's inertia that is not reported. The gimbal rings of the shipped model have 5e-13 of it,
# which the engine requires; the cross-check detects 1e-12.
NEGLIGIBLE = 1e-6

# Axes and points are exact in the MJCF; rotations from degrees have errors of 1e-15.
IDEAL_TOLERANCE = 1e-9

# Quaternions of quarter turns have errors of 1e-15.
QUARTER_TURN_TOLERANCE = 1e-12

MOST_MODELS = 8


@dataclass(frozen=True, eq=False)
class Mjcf:
    """Models of a file, shared: a user that changes one must copy it.

    Attributes
    ----------
    described : MjModel
        With sites: poses of poles, coils, shaft tip.
    bare, loaded : MjModel
        For simulation, without and with the body of the payload; the same model if anything else is attached
        to that body.
    warnings : tuple of str
        Warnings of the engine's compiler, one line each.
    stated_options : frozenset of str
        Attributes of the element `option` that the file states, such as timestep.
    """

    described: mujoco.MjModel
    bare: mujoco.MjModel
    loaded: mujoco.MjModel
    warnings: tuple[str, ...] = ()
    stated_options: frozenset[str] = frozenset()

    @cached_property
    def unknown_to_the_lagrangian(self) -> tuple[str, ...]:
        """Result of `beyond_three_hinges` for the loaded model."""
        return tuple(beyond_three_hinges(self.loaded))

    @cached_property
    def has_ideal_joint(self) -> bool:
        """True if `beyond_an_ideal_joint` returns nothing for the loaded model."""
        return not beyond_an_ideal_joint(self.loaded)


def read(path: Path) -> Mjcf:
    """Read a model file, or return the cached models if no file that it names has changed.

    Raises
    ------
    InputError
        The file is missing or invalid; the message of the engine is on one line.
    """
    try:
        if not path.exists():
            raise InputError(f"model: expected an MJCF file, received {path}, which does not exist")
        key = (path.resolve(), fingerprint(path))
    except OSError as error:  # an invalid file name, here or in the file
        raise InputError(f"model: expected an MJCF file, {without_breaks(error)}") from None
    if key not in _MODELS:
        _MODELS[key] = _read(path)
        while len(_MODELS) > MOST_MODELS:
            _MODELS.popitem(last=False)
    return _MODELS[key]


_MODELS: OrderedDict[tuple[Path, str], Mjcf] = OrderedDict()


def beyond_a_free_rotor(model: mujoco.MjModel) -> list[str]:
    """Return the names of physics beyond a rigid rotor on three ideal hinges under gravity along -z."""
    return beyond_three_hinges(model) + beyond_an_ideal_joint(model)


def beyond_three_hinges(model: mujoco.MjModel) -> list[str]:
    """Return the names of physics beyond rigid bodies on three hinges under gravity along -z.

    The engine computes all of it, the equations of motion none.
    """
    names = [name for name, present in _stages(model).items() if present]
    if np.any(model.dof_armature):
        names.append("armature")
    if np.any(model.opt.gravity[:2]) or model.opt.gravity[2] > 0:
        names.append(OTHER_GRAVITY)
    return names


def beyond_an_ideal_joint(model: mujoco.MjModel) -> list[str]:
    """Return the names of mass properties and of hinges that the closed-form equations of motion lack.

    They are for hinges about x, y, z through the joint centre, rings without mass, and a rotor with its
    centre of mass there and with its own axes as principal axes.
    """
    data = mujoco.MjData(model)
    mujoco.mj_kinematics(model, data)
    names = [f"mass of body {name}" for name in _other_masses(model, data)]
    for hinge, axis in enumerate(np.eye(3) if model.njnt == 3 else ()):
        if not np.allclose([data.xaxis[hinge] - axis, data.xanchor[hinge]], 0.0, atol=IDEAL_TOLERANCE):
            names.append(f"tilt or offset of hinge {model.joint(hinge).name}")
    if ROTOR in _body_names(model):
        rotor = model.body(ROTOR).id
        if np.any(np.abs(model.body_ipos[rotor]) > IDEAL_TOLERANCE):
            names.append("centre of mass off the joint centre")
        if abs(model.body_iquat[rotor][0]) <= 1 - IDEAL_TOLERANCE:
            names.append("products of inertia")
    return names


def gravity(option: mujoco.MjOption) -> tuple[float, float, float]:
    """Return the gravity of a model's options, m/s²; 0 if its flag is off."""
    if option.disableflags & mujoco.mjtDisableBit.mjDSBL_GRAVITY:
        return 0.0, 0.0, 0.0
    x, y, z = option.gravity.tolist()
    return x, y, z


def idle_stages(model: mujoco.MjModel) -> int:
    """Return the disable bits of the stages of a step that a model does not need, a tenth of the step's time.

    A run ends when a hinge reaches its range, so that a limit without a margin needs no solver. Sensors do
    not affect the motion.
    """
    holds, bits = _stages(model), mujoco.mjtDisableBit
    # The damping of an actuator is not among its forces: it is computed with that of the joints.
    passive = ("tendon", "fluid", "gravity compensation", "actuator", "plugin", "flex", "plasticity")
    needed_by = {
        bits.mjDSBL_CONSTRAINT: ("frictionloss", "equality", "tendon", "contact", "flex", "limit margin"),
        bits.mjDSBL_SPRING: ("stiffness", *passive),
        bits.mjDSBL_DAMPER: ("damping", *passive),
        bits.mjDSBL_ACTUATION: ("actuator",),
    }
    idle = int(bits.mjDSBL_SENSOR)
    for stage, names in needed_by.items():
        if not any(holds[name] for name in names):
            idle |= int(stage)
    return idle


def _stages(model: mujoco.MjModel) -> dict[str, bool]:
    """Return the kinds of physics, and whether a model has each."""
    contact_off = bool(model.opt.disableflags & mujoco.mjtDisableBit.mjDSBL_CONTACT)
    touching = np.any(model.geom_contype[:, None] & model.geom_conaffinity[None, :])
    limited = model.jnt_limited.astype(bool)
    return {
        "frictionloss": bool(np.any(model.dof_frictionloss)),
        "stiffness": bool(np.any(model.jnt_stiffness) or np.any(model.jnt_stiffnesspoly)),
        "damping": bool(np.any(model.dof_damping) or np.any(model.dof_dampingpoly)),
        "limit margin": bool(np.any(model.jnt_margin[limited])),
        "equality": model.neq > 0,
        "tendon": model.ntendon > 0,
        "actuator": model.nactuator > 0,
        "contact": not contact_off and bool(touching or model.npair),
        "fluid": bool(model.opt.density or model.opt.viscosity),
        "gravity compensation": model.ngravcomp > 0,
        "plugin": model.nplugin > 0,
        "flex": model.nflex > 0,
        "plasticity": model.nplastic > 0,
    }


def _other_masses(model: mujoco.MjModel, data: mujoco.MjData) -> Iterator[str]:
    """Yield the names of moving bodies with relevant inertia, except rotor and payload."""
    rotor = model.body(ROTOR).inertia.max() if ROTOR in _body_names(model) else 0.0
    for i, name in enumerate(_body_names(model)):
        moves = model.body_weldid[i] != 0
        # Upper bound of the rotational inertia about the joint centre; a point mass has only that of its
        # position.
        size = model.body_inertia[i].max() + model.body_mass[i] * np.sum(data.xipos[i] ** 2)
        if moves and name not in (ROTOR, PAYLOAD) and size > NEGLIGIBLE * rotor:
            yield name or f"number {i}"


def _body_names(model: mujoco.MjModel) -> list[str]:
    return [model.body(i).name for i in range(model.nbody)]


def _read(path: Path) -> Mjcf:
    silence_warnings()
    mujoco.mj_clearCache(mujoco.mj_getCache())  # the engine's cache misses a mesh edited within a second
    with compiler_warnings() as lines:
        compiled = _compiled(path)
    for model in compiled:
        _turn_principal_axes_back(model)
    if lost := missing_meshes(mujoco.MjSpec.from_file(str(path)), path):
        lines.append(f"recordings do not draw {', '.join(lost)}: no such files below {path.parent.resolve()}")
    texts, _ = _texts_and_sources(path)
    return Mjcf(*compiled, tuple(f"model {path}: {line}" for line in lines), _stated_options(texts.values()))


_COMMENT = re.compile(rb"<!--.*?-->", re.DOTALL)
_OPTION = re.compile(rb"<option\b([^>]*)>")
_ATTRIBUTE = re.compile(rb"([A-Za-z_]+)\s*=")


def _stated_options(texts: Iterable[bytes]) -> frozenset[str]:
    """Return the attributes of the elements `option`: the compiled model does not tell them from defaults."""
    options = [option for text in texts for option in _OPTION.findall(_COMMENT.sub(b"", text))]
    return frozenset(name.decode() for option in options for name in _ATTRIBUTE.findall(option))


def missing_meshes(spec: mujoco.MjSpec, path: Path) -> dict[str, str]:
    """Return the meshes whose file is missing: file, and name. No run needs one that is only drawn."""
    folder = path.parent / spec.meshdir
    return {
        mesh.file: mesh.name or Path(mesh.file).stem
        for mesh in spec.meshes
        if mesh.file and not any((folder / name).is_file() for name in (mesh.file, Path(mesh.file).name))
    }


def _compiled(path: Path) -> tuple[mujoco.MjModel, mujoco.MjModel, mujoco.MjModel]:
    """Return the models of a file: described, bare, loaded."""
    try:
        spec = mujoco.MjSpec.from_file(str(path))
        if spec.compiler.inertiafromgeom != mujoco.mjtInertiaFromGeom.mjINERTIAFROMGEOM_TRUE:
            spec.discard_visual()  # an error in that case: visual geoms define the inertia
        described = spec.compile()
        for sensor in list(spec.sensors):
            spec.delete(sensor)
        if not (spec.tendons or spec.equalities or spec.actuators or spec.plugins):  # they may refer to sites
            for site in list(spec.sites):
                spec.delete(site)
        loaded = spec.compile()
    except ValueError as error:
        raise InputError(f"model {path}: expected valid MJCF, {without_breaks(error)}") from None
    return described, _without_mount(spec, loaded), loaded


# Elements that can be attached to a body, or refer to one.
_HANGING = ("njnt", "ngeom", "nsite", "ncam", "nlight", "nflex", "nskin", "neq", "nwrap", "nactuator",
            "npair", "nexclude", "ntupledata", "ngravcomp")  # fmt: skip


def _without_mount(spec: mujoco.MjSpec, loaded: mujoco.MjModel) -> mujoco.MjModel:
    """Return the model without the body of the payload, or with it if its removal would remove anything else.

    Elements that refer to a deleted body are deleted silently.
    """
    mount = spec.body(PAYLOAD)
    if not mount or mount.bodies:
        return loaded
    spec.delete(mount)
    try:
        bare = spec.compile()
    except ValueError:  # some references are not deleted, and become invalid
        return loaded
    alone = all(getattr(bare, size) == getattr(loaded, size) for size in _HANGING)
    return bare if alone else loaded


def _turn_principal_axes_back(model: mujoco.MjModel) -> None:
    """Restore the order of the rotor's principal axes if it is a permutation of its own axes.

    The compiler sorts the principal inertias that it computes, greatest first.
    """
    if ROTOR not in _body_names(model):
        return
    rotor, R = model.body(ROTOR).id, np.empty(9)
    mujoco.mju_quat2Mat(R, model.body_iquat[rotor])
    turned = np.abs(R.reshape(3, 3))
    order = np.round(turned)
    if np.allclose(turned, order, rtol=0, atol=QUARTER_TURN_TOLERANCE):
        model.body_inertia[rotor] = order @ model.body_inertia[rotor]
        model.body_iquat[rotor] = 1, 0, 0, 0


_NAMED_FILE = re.compile(rb"""\bfile\s*=\s*["']([^"']+)["']|"torque_file"\s+data\s*=\s*"([^"]+)\"""")
_FOLDERS = re.compile(rb"""\b(?:meshdir|texturedir|assetdir)\s*=\s*["']([^"']+)["']""")
_OTHER_KINDS = (".obj", ".stl", ".msh", ".png", ".ktx", ".skn")


class _FileStates(NamedTuple):
    """Fingerprint of a file, and the states of all files that it depends on, also of missing ones."""

    digest: str
    states: dict[str, tuple[int, ...] | None]


_FINGERPRINTS: dict[str, _FileStates] = {}

SETTLED_s = 2.0
"""Age from which on a change of a file has another change time: file systems count it in steps."""


def fingerprint(path: Path) -> str:
    """Return a digest of a file and its includes, and of the change times of the other files they name.

    It is computed again if the state of any of these files has changed.
    """
    place = os.path.abspath(path)
    seen = _FINGERPRINTS.get(place)
    if seen and all(_state(source) == state for source, state in seen.states.items()):
        return seen.digest
    texts, sources = _texts_and_sources(path)
    places = [place, *map(str, texts), *map(str, sources)]
    states = {source: _state(source) for source in places}
    digest = hashlib.sha256()
    for source, text in sorted(texts.items()):
        digest.update(f"{source} {len(text)} ".encode(errors="surrogateescape") + text)
    for source in sorted(_files(sources)):
        digest.update(f"{source} {states[str(source)]} ".encode(errors="surrogateescape"))
    newest_ns = max(state[CHANGED] for state in states.values() if state)
    if time.time_ns() - newest_ns > 1e9 * SETTLED_s:
        _FINGERPRINTS[place] = _FileStates(digest.hexdigest(), states)
    return digest.hexdigest()


CHANGED = 2


def _state(source: Path | str) -> tuple[int, ...] | None:
    """Return inode, times and size of a file; None if there is none.

    A copy can keep the modification time and the size, but neither the inode nor its change time.
    """
    try:
        state = os.stat(source)
    except (OSError, ValueError):
        return None
    return state.st_ino, state.st_mtime_ns, state.st_ctime_ns, state.st_size


def contents_digest(path: Path) -> str:
    """Return a digest of the contents of a file and of all files that it names, without paths and times."""
    texts, sources = _texts_and_sources(path)
    contents = {hashlib.sha256(content).digest() for content in texts.values()}
    contents |= {hashlib.sha256(source.read_bytes()).digest() for source in _files(sources)}
    return hashlib.sha256(b"".join(sorted(contents))).hexdigest()


def _texts_and_sources(path: Path) -> tuple[dict[Path, bytes], set[Path]]:
    """Return the texts of a model and its includes, and the places of every file that they name."""
    texts = {path.resolve(): regular_file(path).read_bytes()}
    sources = _sources(path, texts)
    while includes := {source.resolve() for source in _files(sources) if _is_xml(source)} - texts.keys():
        texts |= {source: source.read_bytes() for source in includes}
        sources = _sources(path, texts)
    return texts, sources


def _sources(path: Path, texts: Mapping[Path, bytes]) -> set[Path]:
    """Return the places of the files that the texts of a model name, in all folders that may be searched."""
    references = (name for text in texts.values() for names in _NAMED_FILE.findall(text) for name in names)
    names = {_decoded(name) for name in references if name}
    names |= {os.path.basename(name) for name in names}  # strippath
    folders = {path.parent.resolve(), *(source.parent for source in texts)}
    below = {_decoded(name) for text in texts.values() for name in _FOLDERS.findall(text)}
    folders |= {folder / name for folder in folders for name in below}
    return {folder / name for folder in folders for name in names}


def _files(sources: set[Path]) -> set[Path]:
    """Return the files that exist."""
    return {regular_file(source) for source in sources if source.exists() and not source.is_dir()}


def _is_xml(source: Path) -> bool:
    """Return True for XML: an include may have any suffix except those of meshes and images."""
    if source.suffix.lower() in _OTHER_KINDS:
        return False
    with source.open("rb") as file:
        return file.read(64).removeprefix(codecs.BOM_UTF8).lstrip().startswith(b"<")


def _decoded(name: bytes) -> str:
    return html.unescape(name.decode("utf-8", errors="surrogateescape"))
