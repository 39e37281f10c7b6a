"""Equation of motion (1), state by state: MuJoCo and Pinocchio against the Lagrangian.

Every difference is divided by the size of the terms that make up what is compared, not by what is left of
them: terms of opposite sign may cancel to almost nothing, and rounding is relative to the terms. For the
same reason an acceleration is judged by the torque that it leaves over in the equation of motion: solving
for it multiplies any difference by the condition of M, which is (1 + sin β)/(1 - sin β) and so grows like
1/cos²β, to 130 at 80 degrees; the torque left over does not depend on it.
"""

from __future__ import annotations

from collections.abc import Callable
from contextlib import suppress
from pathlib import Path
from typing import Any, NamedTuple

import mujoco
import numpy as np

from spheretwin.crosscheck.equations import equations_of, symmetric
from spheretwin.crosscheck.pinocchio_models import model_of_bodies, model_of_file
from spheretwin.crosscheck.scale import scale_of
from spheretwin.models.actuator import Actuator
from spheretwin.models.base.arrays import Array
from spheretwin.models.base.checks import Check
from spheretwin.models.joint_chain import JointChain, chain_at, equations, fill_chain, fill_ideal
from spheretwin.models.kinematics import Triple, rate_jacobian, rotation, triple
from spheretwin.models.lagrangian import coriolis_matrix, gravity_torque, inertia_matrix, loaded_inertia
from spheretwin.models.mjcf import gravity, read
from spheretwin.plant.mass_properties import MassErrors, MassSection, mass_errors, true_model
from spheretwin.plant.mujoco_rotor import MujocoRotor

LARGEST_TILT_rad = np.radians(80)  # the hinges' range
SEED = 0
STEP_S = 5e-4  # of no effect here: nothing is stepped

ROTATION_BOUND = 1e-14
BIAS_BOUND = 1e-13

_ROUNDING = "rounding of three turns, each 2e-16 of a unit vector, with a margin of ten"
_RINGS = (
    "the share of the engine's gimbal rings in the inertia of the rotor, unless the equations of motion have"
    " them: the paper has none, MuJoCo none below 1e-15 kg·m²; the rest is rounding, near 1e-15"
)
_NO_RINGS = (
    "rounding, a few 1e-15, with a margin for other processors; the gimbal rings, isotropic and centred,"
    " add nothing here"
)


class PlantCase(NamedTuple):
    """A plant to compare."""

    name: str
    modelling_error: float
    payload_kg: float
    mass: MassErrors | None = None


CASES = (
    PlantCase("nominal", 0.0, 0.0),
    PlantCase("modelling error 0.2", 0.2, 0.0),
    PlantCase("payload 0.05 kg", 0.0, 0.05),
    PlantCase("both", 0.2, 0.05),
)

# A machine of the seed with all mass properties and hinges that the closed forms lack.
MASS = MassSection(
    centre_error_m=1e-3,
    product_error_kg_m2=5e-5,
    ring_inertia_kg_m2=((4e-4, 2e-4, 3e-4), (2e-4, 3e-4, 2e-4)),
    axis_tilt_error_rad=0.01,
    axis_offset_error_m=2e-4,
)


class States(NamedTuple):
    """States at which the dynamics are compared; one row for each."""

    q: Array  # (n, 3) rad
    qdot: Array  # (n, 3) rad/s
    qddot: Array  # (n, 3) rad/s², for inverse dynamics
    torque_q: Array  # (n, 3) N·m on the hinges, for forward dynamics
    torque_S: Array  # (n, 3) N·m on the rotor, stator frame, for forward dynamics


class Answers(NamedTuple):
    """Dynamics of an engine at these states."""

    R: Array  # (n, 3, 3)
    M: Array  # (n, 3, 3) kg·m²
    bias: Array  # (n, 3) N·m, C qdot + G
    torque: Array  # (n, 3) N·m, inverse dynamics
    qddot: Array  # (n, 3) rad/s², forward dynamics


class Dynamics(NamedTuple):
    """Checks, and every single difference: by engine, then by quantity."""

    checks: list[Check]
    differences: dict[str, dict[str, Array]]
    bounds: dict[str, float]


class _Quantity(NamedTuple):
    name: str
    compares: str
    bound: float
    ring_factor: float  # of the share of neglected rings that is added to the bound
    why: str


class _Terms(NamedTuple):
    """Terms of the equations of motion at the states."""

    R: Array  # (n, 3, 3)
    torque_q: Array  # (n, 3) N·m on the hinges, for forward dynamics
    M: Array  # (n, 3, 3) kg·m²
    C: Array  # (n, 3, 3) kg·m²/s
    bias: Array  # (n, 3) N·m, C qdot + G
    G: Array  # (n, 3) N·m


QUANTITIES = (
    _Quantity(
        "orientation R", "R_SR(q); Frobenius norm of the difference over √3", ROTATION_BOUND, 0, _ROUNDING
    ),
    _Quantity(
        "inertia matrix M", "M(q); Frobenius norm of the difference over that of M", BIAS_BOUND, 1, _RINGS
    ),
    _Quantity("bias C q̇ + G", "C q̇ + G; difference over |C||q̇| + |G|", BIAS_BOUND, 0, _NO_RINGS),
    _Quantity(
        "inverse dynamics", "M q̈ + C q̇ + G; difference over |M||q̈| + |C||q̇| + |G|", BIAS_BOUND, 1, _RINGS
    ),
    _Quantity(
        "forward dynamics",
        "torque that the engine's q̈ leaves over in (1), over the sum of its terms",
        BIAS_BOUND,
        1,
        _RINGS,
    ),
)


def compare(mjcf: Path, actuator: Actuator, count: int) -> Dynamics:
    """Compare both engines with the Lagrangian at random states, for every case.

    Parameters
    ----------
    mjcf : Path
        Model file that the engines read.
    actuator : Actuator
        Its inertia is what the Lagrangian has.
    count : int
        States a case.
    """
    states, motion = random_states(count), equations_of(mjcf, actuator)
    is_general = bool(motion.joint["on"][0])
    bounds = {
        quantity.name: quantity.bound + quantity.ring_factor * motion.neglected for quantity in QUANTITIES
    }
    checks: list[Check] = []
    differences: dict[str, dict[str, Array]] = {}
    pinocchio = ask_pinocchio_about_chain if is_general else ask_pinocchio
    for engine, answers in (("MuJoCo", ask_mujoco), ("Pinocchio", pinocchio)):
        try:
            by_case = [_differences(mjcf, actuator, case, states, answers, is_general) for case in CASES]
        except ImportError:
            checks += [_not_installed(engine, quantity, bounds[quantity.name]) for quantity in QUANTITIES]
            continue
        checks += [
            _check(engine, quantity, bounds[quantity.name], [case[quantity.name] for case in by_case])
            for quantity in QUANTITIES
        ]
        differences[engine] = {
            quantity.name: np.concatenate([case[quantity.name] for case in by_case])
            for quantity in QUANTITIES
        }
    return Dynamics([*checks, *_general_joint(mjcf, actuator, states)], differences, bounds)


def random_states(count: int) -> States:
    """Tilts to 80 degrees, rates to 50 rad/s, and accelerations and torques that weigh as much as they do."""
    generator = np.random.default_rng(SEED)

    def uniform(*most: float) -> Array:
        return generator.uniform(-np.array(most), most, size=(count, 3))

    return States(
        q=uniform(LARGEST_TILT_rad, LARGEST_TILT_rad, np.pi),
        qdot=uniform(50, 50, 50),
        qddot=uniform(2500, 2500, 2500),
        torque_q=uniform(5, 5, 5),
        torque_S=uniform(5, 5, 5),
    )


def ask_mujoco(mjcf: Path, case: PlantCase, states: States) -> Answers:
    """Answers of MuJoCo, from its public functions."""
    rotor = MujocoRotor([_compiled(mjcf, case)], STEP_S, "RK4")
    model, data, body = rotor.model, rotor.data, rotor.model.body("rotor").id
    answers = _empty(len(states.q))
    axes = np.eye(3)
    for i in range(len(states.q)):
        data.qpos[:], data.qvel[:] = states.q[i], states.qdot[i]
        data.qfrc_applied[:], data.xfrc_applied[body, 3:] = states.torque_q[i], states.torque_S[i]
        mujoco.mj_forward(model, data)
        answers.R[i] = data.xmat[body].reshape(3, 3)
        answers.bias[i] = data.qfrc_bias
        answers.qddot[i] = data.qacc
        for axis in range(3):
            mujoco.mj_mulM(model, data, answers.M[i, axis], axes[axis])
        data.qacc[:] = states.qddot[i]
        mujoco.mj_inverse(model, data)
        answers.torque[i] = data.qfrc_inverse
    return answers


def ask_pinocchio(mjcf: Path, case: PlantCase, states: States) -> Answers:
    """Answers of Pinocchio, from the same model file; errors are those of `model_of_file`."""
    model, joint = model_of_file(mjcf, case.modelling_error, case.payload_kg)
    E = np.array([rate_jacobian(q) for q in states.q])
    return _pinocchio_answers(model, joint, states, states.torque_q + _times(_turned(E), states.torque_S))


def ask_pinocchio_about_chain(mjcf: Path, case: PlantCase, states: States) -> Answers:
    """Answers of Pinocchio, from the axes and bodies of the compiled model."""
    model = _compiled(mjcf, case)
    chain, joint = model_of_bodies(model)
    return _pinocchio_answers(chain, joint, states, _chain_terms(model, states).torque_q)


def _pinocchio_answers(model: Any, joint: int, states: States, torque_q: Array) -> Answers:
    """Return the answers of a model of Pinocchio; `torque_q` is all torque of the forward dynamics."""
    import pinocchio  # of the test group: nothing else needs it

    data = model.createData()
    answers = _empty(len(states.q))
    for i, (q, qdot, torque) in enumerate(zip(states.q, states.qdot, torque_q, strict=True)):
        # A hinge without range is a point on the circle to Pinocchio.
        pose = q if model.nq == 3 else np.array([q[0], q[1], np.cos(q[2]), np.sin(q[2])])
        answers.torque[i] = pinocchio.rnea(model, data, pose, qdot, states.qddot[i])
        answers.qddot[i] = pinocchio.aba(model, data, pose, qdot, torque)
        answers.bias[i] = pinocchio.nonLinearEffects(model, data, pose, qdot)
        upper = np.triu(pinocchio.crba(model, data, pose))
        answers.M[i] = upper + np.triu(upper, 1).T
        pinocchio.forwardKinematics(model, data, pose)
        answers.R[i] = data.oMi[joint].rotation
    return answers


def _differences(
    mjcf: Path,
    actuator: Actuator,
    case: PlantCase,
    states: States,
    ask: Callable[[Path, PlantCase, States], Answers],
    is_general: bool,
) -> dict[str, Array]:
    """Relative differences by quantity, one entry a state."""
    said = ask(mjcf, case, states)
    if is_general:
        R, torque, M, C, bias, G = _chain_terms(_compiled(mjcf, case), states)
    else:
        R, torque, M, C, bias, G = _closed_terms(mjcf, actuator, case, states)
    bias_size = _norm(C) * _norm(states.qdot) + _norm(G)
    left_over = _times(M, said.qddot) + bias - torque
    return {
        "orientation R": _norm(said.R - R) / np.sqrt(3),
        "inertia matrix M": _norm(said.M - M) / _norm(M),
        "bias C q̇ + G": _norm(said.bias - bias) / bias_size,
        "inverse dynamics": _norm(said.torque - _times(M, states.qddot) - bias)
        / (_norm(M) * _norm(states.qddot) + bias_size),
        "forward dynamics": _norm(left_over) / (_norm(M) * _norm(said.qddot) + bias_size + _norm(torque)),
    }


def _closed_terms(mjcf: Path, actuator: Actuator, case: PlantCase, states: States) -> _Terms:
    """Return the terms of an ideal joint, in closed form."""
    gravity_m_s2 = -gravity(read(mjcf).described.opt)[2]
    height_m = float(actuator.payload_mount_m[2])
    inertia = loaded_inertia((1 + case.modelling_error) * actuator.inertia, case.payload_kg, height_m)
    joint = JointChain.filled(fill_ideal, inertia, case.payload_kg * gravity_m_s2 * height_m)[0]
    pairs = list(zip(states.q, states.qdot, strict=True))
    E = np.array([rate_jacobian(q) for q, _ in pairs])
    C = np.array([coriolis_matrix(q, qdot, joint.inertia) for q, qdot in pairs])
    G = np.array([gravity_torque(q, joint.weight_moment) for q, _ in pairs])
    return _Terms(
        R=np.array([rotation(q) for q, _ in pairs]),
        torque_q=states.torque_q + _times(_turned(E), states.torque_S),
        M=np.array([inertia_matrix(q, joint.inertia) for q, _ in pairs]),
        C=C,
        bias=_times(C, states.qdot) + G,
        G=G,
    )


def _chain_terms(model: mujoco.MjModel, states: States) -> _Terms:
    """Return the terms of a general joint."""
    chain = JointChain.filled(fill_chain, model)[0]
    rows = [_chain_row(chain, triple(q), qdot) for q, qdot in zip(states.q, states.qdot, strict=True)]
    R, axes, M, C, bias, G = (np.array(term) for term in zip(*rows, strict=True))
    return _Terms(R, states.torque_q + _times(axes, states.torque_S), M, C, bias, G)


def _chain_row(chain: Any, q: Triple, qdot: Array) -> tuple[Any, ...]:
    """Return R, the axes of the hinges, M, C, bias and G at a state.

    The bias without gravity is ``C(q, qdot) qdot`` with Christoffel's C, bilinear and symmetric in the rates:
    columns of C follow from it by polarisation.
    """
    (_, _, rotor), axes, _ = chain_at(chain, q)
    M, bias = equations(chain, q, triple(qdot))
    weightless = chain.copy()
    weightless["gravity"] = 0.0

    def inertial(rates: Array) -> Array:
        return np.array(equations(weightless, q, triple(rates))[1])

    columns = [0.5 * (inertial(qdot + e) - inertial(qdot) - inertial(e)) for e in np.eye(3)]
    G = equations(chain, q, (0.0, 0.0, 0.0))[1]
    return np.array(rotor[:3]).T, axes, symmetric(M), np.array(columns).T, bias, G


def _compiled(mjcf: Path, case: PlantCase) -> mujoco.MjModel:
    return true_model(read(mjcf), case.modelling_error, case.payload_kg, None, case.mass)


def _general_joint(mjcf: Path, actuator: Actuator, states: States) -> list[Check]:
    """Compare MuJoCo and Pinocchio with the equations of motion of a general joint."""
    scale = scale_of(actuator)
    mass = MassSection(**{name: scale.field(f"plant.mass.{name}", value) for name, value in MASS})
    case = PlantCase("general joint", 0.2, 0.05, mass_errors(mass, SEED))
    terms = _chain_terms(_compiled(mjcf, case), states)
    qddot_of = {"MuJoCo": ask_mujoco(mjcf, case, states).qddot}
    with suppress(ImportError):
        qddot_of["Pinocchio"] = ask_pinocchio_about_chain(mjcf, case, states).qddot
    return [
        Check(
            name=f"forward dynamics of a general joint: {engine}",
            compares=f"torque that the q̈ of {engine} leaves over in the equations of motion of tilted and"
            " distant hinges, rings with inertia and a rotor with any inertia and centre of mass, over the"
            " sum of its terms",
            states=len(states.q),
            value=_largest_left_over(terms, qddot),
            bound=BIAS_BOUND,
            why="rounding, a few 1e-15, with a margin for other processors",
        )
        for engine, qddot in qddot_of.items()
    ]


def _largest_left_over(terms: _Terms, qddot: Array) -> float:
    """Return the largest share of the torque that accelerations (n, 3) leave over."""
    inertial = _times(terms.M, qddot)
    left_over = _norm(inertial + terms.bias - terms.torque_q)
    return float((left_over / (_norm(inertial) + _norm(terms.bias) + _norm(terms.torque_q))).max())


def _check(engine: str, quantity: _Quantity, bound: float, by_case: list[Array]) -> Check:
    worst = {case.name: float(np.max(values)) for case, values in zip(CASES, by_case, strict=True)}
    return Check(
        name=f"{quantity.name}: {engine}",
        compares=f"{engine} with the Lagrangian, {quantity.compares}",
        states=sum(len(values) for values in by_case),
        value=float(np.max(list(worst.values()))),
        bound=bound,
        why=quantity.why,
        detail=worst,
    )


def _not_installed(engine: str, quantity: _Quantity, bound: float) -> Check:
    why = f"{engine} is not installed; it is the extra opinion of the test group"
    return Check(f"{quantity.name}: {engine}", f"{engine} with the Lagrangian, {quantity.compares}", 0,
                 None, bound, why)  # fmt: skip


def _empty(count: int) -> Answers:
    matrices, vectors = np.empty((2, count, 3, 3)), np.empty((3, count, 3))
    return Answers(matrices[0], matrices[1], *vectors)


def _turned(matrices: Array) -> Array:
    return matrices.transpose(0, 2, 1)


def _times(matrices: Array, vectors: Array) -> Array:
    return np.einsum("nij,nj->ni", matrices, vectors)


def _norm(values: Array) -> Array:
    """Euclidean norm of every vector, Frobenius norm of every matrix."""
    return np.sqrt(np.sum(values**2, axis=tuple(range(1, values.ndim))))
