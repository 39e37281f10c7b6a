"""C functions of the motion, traced from the equations of the model.

The functions of `models.kinematics`, `models.lagrangian` and `models.joint_chain` run once on symbols; what
they compute is written as C for a number type ``T``, with the names of `NAME`. Equal terms are computed once.
"""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Callable, Iterable, Mapping
from functools import cache
from typing import Any

from spheretwin.export.c_text import header
from spheretwin.models import joint_chain, kinematics, lagrangian
from spheretwin.models.lagrangian import InertiaEntries
from spheretwin.models.symbolic import on_symbols, turns_by

Outputs = Mapping[str, Any]
"""Terms or numbers by the C expression that they are assigned to."""

BINDING = {"+": 1, "-": 1, "*": 2, "/": 2}
"""Operators by precedence."""
LONGEST = 90
"""Characters of an expression above which a part of it has a name."""


class Term:
    """Number of generated code: a symbol, or an operation on terms and numbers.

    Parameters
    ----------
    operator : str
        ``+``, ``-``, ``*``, ``/`` or a function; the C expression of a symbol.
    operands : tuple
        Terms and numbers.
    is_real : bool
        True for a symbol of the type ``ST_NUMBER``, whatever ``T`` is.
    """

    is_real: bool
    __array_ufunc__ = None  # an operation with a number of NumPy is one of this class

    def __init__(self, operator: str, operands: tuple[Any, ...] = (), is_real: bool = False) -> None:
        self.operator, self.operands = operator, operands
        self.is_real = is_real or (
            bool(operands) and all(one.is_real for one in operands if isinstance(one, Term))
        )

    def __add__(self, other: Any) -> Any:
        return _operation("+", self, other)

    def __radd__(self, other: Any) -> Any:
        return _operation("+", other, self)

    def __sub__(self, other: Any) -> Any:
        return _operation("-", self, other)

    def __rsub__(self, other: Any) -> Any:
        return _operation("-", other, self)

    def __mul__(self, other: Any) -> Any:
        return _operation("*", self, other)

    def __rmul__(self, other: Any) -> Any:
        return _operation("*", other, self)

    def __truediv__(self, other: Any) -> Any:
        return _operation("/", self, other)

    def __rtruediv__(self, other: Any) -> Any:
        return _operation("/", other, self)

    def __neg__(self) -> Any:
        return _operation("-", 0.0, self)

    def __pow__(self, exponent: int) -> Any:
        assert exponent == 2
        return self * self


@cache
def _operation(operator: str, a: Any, b: Any) -> Any:
    """Return an operation; one with 0 or 1 is one of its operands."""
    if operator == "*" and 0 in (a, b):
        return 0.0
    if (operator == "+" and a == 0) or (operator == "*" and a == 1):
        return b
    if (operator in "+-" and b == 0) or (operator in "*/" and b == 1):
        return a
    if operator == "-" and a == 0:
        return Term("-", (b,))
    return Term(operator, (a, b))


@cache
def _called(function: str, *arguments: Any) -> Term:
    return Term(function, arguments)


_turns = turns_by(lambda angle: _called("COSINE", angle), lambda angle: _called("SINE", angle))


def _traced(function: Callable[..., Any]) -> Callable[..., Any]:
    """Return a function of the model on terms."""
    return on_symbols(
        function,
        turns=_turns,
        asin=lambda x: _called("ARC_SINE", x),
        atan2=lambda y, x: _called("ARC_TANGENT", y, x),
    )


def _vector(name: str, is_real: bool = False) -> tuple[Term, ...]:
    return tuple(Term(f"{name}[{i}]", (), is_real) for i in range(3))


def _filled(function: Callable[..., Any], *arguments: Any, results: int = 1) -> Any:
    """Return the vectors that a function of the model writes into its last arguments."""
    vectors = [[None] * 3 for _ in range(results)]
    _traced(function)(*arguments, *vectors)
    return vectors if results > 1 else vectors[0]


Q, V, TORQUE, J = _vector("q"), _vector("v"), _vector("torque"), _vector("J", is_real=True)
MASS_MATRIX = InertiaEntries._make(Term(f"M->{name}") for name in InertiaEntries._fields)


def _entries(name: str, vector: Iterable[Any]) -> Outputs:
    return {f"{name}[{i}]": entry for i, entry in enumerate(vector)}


def _rows(name: str, rows: Iterable[Iterable[Any]]) -> Outputs:
    return {f"{name}[{i}][{j}]": entry for i, row in enumerate(rows) for j, entry in enumerate(row)}


def _inertia(M: InertiaEntries) -> Outputs:
    return {f"M->{name}": entry for name, entry in zip(M._fields, M, strict=True)}


def _rotation() -> str:
    rows = _traced(kinematics.rotation_rows)(Q)
    return _function("rotation", "const T q[3], T R[3][3]", "R_SR", _rows("R", rows))


def plant_motion(joint: Any) -> str:
    """Return the header of the motion of a plant.

    Parameters
    ----------
    joint : JointChain
        An ideal joint has the inertia and the weight moment of the parameters; the numbers of a general one
        are constants of the code.
    """
    inertia, weight = _vector("p->inertia_kg_m2", is_real=True), Term("p->weight_moment_Nm", (), True)
    torque_S, is_general = _vector("torque_S"), bool(joint.on)
    if is_general:
        coil_q, coil_v = _filled(joint_chain.ideal_pose, joint, Q, V, results=2)
        on_hinges = _filled(joint_chain.hinge_torque, joint, Q, torque_S)
    else:
        coil_q, coil_v = Q, V
        on_hinges = _filled(kinematics.generalised_torque, Q, torque_S)
    acceleration = _traced(joint_chain.acceleration_at)(joint, inertia, weight, Q, V, TORQUE)
    functions = [
        _rotation(),
        _function(
            "solve_inertia", "const NAME(inertia) *M, const T torque[3], T x[3]",
            "Solution x of M x = torque; M may be the sum of an inertia matrix and a diagonal one",
            _entries("x", _traced(lagrangian.solve_inertia)(MASS_MATRIX, TORQUE, is_general)),
        ),
        _function(
            "mass_matrix", "const st_parameters *p, const T q[3], NAME(inertia) *M",
            "Inertia matrix at a pose, kg m^2", _inertia(_traced(joint_chain.inertia_at)(joint, inertia, Q)),
        ),
        _function(
            "hinge_acceleration",
            "const st_parameters *p, const T q[3], const T v[3], const T torque[3], T acceleration[3]",
            "Accelerations of the hinges under a torque on them, rad/s^2",
            _entries("acceleration", acceleration),
        ),
        _function(
            "coil_motion", "const T q[3], const T v[3], T coil_q[3], T coil_v[3]",
            "Angles and rates of ideal hinges with the orientation of the rotor",
            {**_entries("coil_q", coil_q), **_entries("coil_v", coil_v)},
        ),
        _function(
            "hinge_torque_of", "const T q[3], const T torque_S[3], T torque[3]",
            "Torque on the hinges of a torque on the rotor in frame S", _entries("torque", on_hinges),
        ),
        _function(
            "angular_velocity", "const T q[3], const T v[3], T rate_S[3]",
            "Angular velocity of the rotor in frame S, of ideal hinges",
            _entries("rate_S", _filled(kinematics.angular_velocity, Q, V)),
        ),
    ]  # fmt: skip
    return _header(functions)


def controller_motion() -> str:
    """Return the header of the motion of a nominal model."""
    torque_q, torque_S, rates = _vector("torque_q"), _vector("torque_S"), _vector("acceleration")
    at = _turns(Q)
    acceleration = _traced(lagrangian.acceleration_entries)(at, V, TORQUE, J, 0.0)
    M, C = _traced(lagrangian.inertia_entries)(at, J), _traced(lagrangian.coriolis_rows)(at, V, J)
    a, b, c = rates
    inertial = (
        M.alpha * a + M.alpha_beta * b + M.alpha_gamma * c,
        M.alpha_beta * a + M.beta * b,
        M.alpha_gamma * a + M.gamma * c,
    )
    torque = [of + row[0] * V[0] + row[1] * V[1] + row[2] * V[2] for of, row in zip(inertial, C, strict=True)]
    motion = "const ST_NUMBER J[3], const T q[3], const T v[3], const T "
    functions = [
        _rotation(),
        _function(
            "acceleration", f"{motion}torque[3], T acceleration[3]",
            "Accelerations of the hinges under a torque on them, rad/s^2",
            _entries("acceleration", acceleration),
        ),
        _function(
            "motion_torque", f"{motion}acceleration[3], T torque[3]",
            "Torque on the hinges of a motion, N m", _entries("torque", torque),
        ),
        _function(
            "generalised_torque", "const T q[3], const T torque_S[3], T torque_q[3]",
            "Torque on the hinges of a torque on the rotor in frame S: E^T torque_S",
            _entries("torque_q", _filled(kinematics.generalised_torque, Q, torque_S)),
        ),
        _function(
            "cartesian_torque", "const T q[3], const T torque_q[3], T torque_S[3]",
            "Torque on the rotor in frame S of a torque on the hinges: E^-T torque_q",
            _entries("torque_S", _filled(kinematics.cartesian_torque, Q, torque_q)),
        ),
    ]  # fmt: skip
    return _header(functions)


def _header(functions: Iterable[str]) -> str:
    _operation.cache_clear()
    _called.cache_clear()
    return header(["/* Motion of the rotor, included once for each type of numbers T. */", *functions])


def _function(name: str, arguments: str, comment: str, outputs: Outputs) -> str:
    """Return the C function that assigns terms to its results."""
    lines = _statements(outputs)
    text = "\n".join(lines)
    names = [re.sub(r"\[.*", "", one).split("*")[-1].split()[-1] for one in arguments.split(", ")]
    unused = [f"    (void){one};" for one in names if not re.search(rf"\b{one}\b", text)]
    constants = [line for line in lines if line.startswith("    const ")]
    assignments = lines[len(constants) :]
    return "\n".join(
        [
            f"\n/* {comment}. */",
            f"static inline void NAME({name})({arguments})",
            "{",
            *constants,
            *unused,
            *assignments,
            "}",
        ]
    )


def _statements(outputs: Outputs) -> list[str]:
    """Return the constants with shared terms, then the assignments of the outputs."""
    uses: Counter[Term] = Counter()
    names: dict[Term, str] = {}
    lines: list[str] = []

    def count(term: Any) -> None:
        if isinstance(term, Term):
            uses[term] += 1
            if uses[term] == 1:
                for operand in term.operands:
                    count(operand)

    def text(term: Any, least: int = 0) -> str:
        """Return an expression, in parentheses if its operator binds less than this."""
        if not isinstance(term, Term):
            return f"ST_C({float(term)!r})"
        if not term.operands:
            return term.operator
        if term in names:
            return names[term]
        binding = BINDING.get(term.operator, 3)
        if binding == 3:
            expression = f"{term.operator}({', '.join(map(text, term.operands))})"
        elif len(term.operands) == 1:
            binding, expression = 0, f"-{text(term.operands[0], 3)}"
        else:
            left, right = term.operands
            expression = f"{text(left, binding)} {term.operator} {text(right, binding + 1)}"
        if uses[term] == 1 and len(expression) < LONGEST:
            return f"({expression})" if binding < least else expression
        names[term] = f"t{len(names)}"
        lines.append(f"    const {'ST_NUMBER' if term.is_real else 'T'} {names[term]} = {expression};")
        return names[term]

    for term in outputs.values():
        count(term)
    assigned = [f"    {place} = {text(term)};" for place, term in outputs.items()]
    return lines + assigned
