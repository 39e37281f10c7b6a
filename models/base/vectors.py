"""Vectors of four numbers: in compiled code one register each, in plain Python a NumPy array.

For loops that the compiler does not vectorise by itself, such as those with reads of a table. The operators
``+``, ``-``, ``*`` and `numpy.floor` act on each entry; a number is taken for all four. `store`,
`limited`, `side`, `cubic` and `like` also take a number in place of a vector, so that one formula serves
blocks of four columns and the columns that are left.
"""

from __future__ import annotations

import operator
from collections.abc import Callable
from typing import Any

import numpy as np
from llvmlite import ir
from numba import types
from numba.extending import lower_builtin, models, register_model, type_callable

from spheretwin.models.base.arrays import Array

WIDTH = 4

Vector = Any
"""A vector or, where a function takes either, a number."""


_NUMBER, _INDEX = ir.DoubleType(), ir.IntType(64)
_NUMBERS, _INDICES = ir.VectorType(_NUMBER, WIDTH), ir.VectorType(_INDEX, WIDTH)
_CONTRACT = ("contract",)  # a product and a sum may be fused, as in all compiled functions


class _VectorType(types.Type):
    def __init__(self) -> None:
        super().__init__(name="Vector")


_VECTOR = _VectorType()


@register_model(_VectorType)
class _VectorModel(models.PrimitiveModel):
    def __init__(self, manager: Any, kind: Any) -> None:
        super().__init__(manager, kind, _NUMBERS)


def vector(a: float, b: float, c: float, d: float) -> Vector:
    """Return the vector of four numbers."""
    return np.array([a, b, c, d])


def entry(x: Vector, number: int) -> float:
    """Return an entry, from 0."""
    return float(x[number])


def total(x: Vector) -> float:
    """Return the sum of the entries."""
    return float(x[0] + x[1] + (x[2] + x[3]))


def load(values: Array, first: int) -> Vector:
    """Return four entries of an array, which are not checked to exist."""
    return values[first : first + WIDTH].copy()


def store(vector: Vector, values: Array, first: int) -> None:
    """Write a vector into four entries of an array, which are not checked to exist, or a number into one."""
    values[first : first + np.size(vector)] = vector


def like(x: Vector, values: Array, first: int) -> Vector:
    """Return the entry `first` of an array if `x` is a number, four entries if it is a vector."""
    return load(values, first) if np.ndim(x) else values[first]


def limited(x: Vector, low: float, high: float) -> Vector:
    """Return `x` limited to a range."""
    return np.minimum(np.maximum(x, low), high)


def within(x: Vector, low: float, high: float) -> bool:
    """Return True if no entry is NaN or outside of a range."""
    return bool(np.all((low <= x) & (x <= high)))


def side(x: Vector) -> Vector:
    """Return 1 with the sign of `x`."""
    return np.copysign(1.0, x)


def cubic(table: Array, place: Vector) -> Vector:
    """Return the values of cubics that follow each other.

    Parameters
    ----------
    table : (n, 4) array
        Coefficients of 1, t, t², t³ of each cubic, t from 0 to 1.
    place : vector or number
        Number of a cubic plus t; from 0 to less than n, not checked.
    """
    row = np.trunc(place)
    t, of_row = place - row, table[np.asarray(row, dtype=np.int64)].T
    return of_row[0] + t * (of_row[1] + t * (of_row[2] + t * of_row[3]))


# Code of a call in compiled functions. It is included in the caller: an `overload` would be a function of its
# own, with a compilation of its own, for each operator and pair of types.

_SIGN, _ONE = 1 << 63, 0x3FF << 52


def _typed(function: Callable[..., Any], typer: Callable[..., Any]) -> None:
    """Let a function return the signature that `typer` returns for types of arguments."""
    type_callable(function)(lambda _: typer)


def _all_four(builder: Any, number: Any) -> Any:
    first = builder.insert_element(ir.Constant(_NUMBERS, ir.Undefined), number, ir.Constant(_INDEX, 0))
    return _arranged(builder, first, first, [0] * WIDTH)


def _arranged(builder: Any, first: Any, second: Any, places: list[int]) -> Any:
    """Return entries of two vectors; those of the second one are counted from four on."""
    mask = ir.Constant(ir.VectorType(ir.IntType(32), WIDTH), places)
    return builder.shuffle_vector(first, second, mask)


def _address(context: Any, builder: Any, kind: Any, array: Any, first: Any) -> Any:
    return builder.gep(context.make_array(kind)(context, builder, array).data, [first])


def _load(context: Any, builder: Any, signature: Any, given: Any) -> Any:
    address = _address(context, builder, signature.args[-2], *given[-2:])
    if signature.return_type is not _VECTOR:
        return builder.load(address)
    return builder.load(builder.bitcast(address, _NUMBERS.as_pointer()), align=8)


_typed(load, lambda values, first: _VECTOR(values, types.intp))
lower_builtin(load, types.Array, types.Integer)(_load)
_typed(like, lambda x, values, first: x(x, values, types.intp))
lower_builtin(like, types.Any, types.Array, types.Integer)(_load)


def _store(context: Any, builder: Any, signature: Any, given: Any) -> Any:
    address = _address(context, builder, signature.args[1], *given[1:])
    if signature.args[0] is _VECTOR:
        address = builder.bitcast(address, _NUMBERS.as_pointer())
    builder.store(given[0], address, align=8)
    return context.get_dummy_value()


_typed(store, lambda vector, values, first: types.void(vector, values, types.intp))
lower_builtin(store, types.Any, types.Array, types.Integer)(_store)


def _vector(context: Any, builder: Any, signature: Any, given: Any) -> Any:
    made = ir.Constant(_NUMBERS, ir.Undefined)
    for place, number in enumerate(given):
        made = builder.insert_element(made, number, ir.Constant(_INDEX, place))
    return made


_typed(vector, lambda a, b, c, d: _VECTOR(*[types.float64] * WIDTH))
lower_builtin(vector, *[types.Float] * WIDTH)(_vector)


def _entry(context: Any, builder: Any, signature: Any, given: Any) -> Any:
    return builder.extract_element(*given)


_typed(entry, lambda x, number: types.float64(x, types.intp))
lower_builtin(entry, _VectorType, types.Integer)(_entry)


def _total(context: Any, builder: Any, signature: Any, given: Any) -> Any:
    a, b, c, d = (builder.extract_element(given[0], ir.Constant(_INDEX, place)) for place in range(WIDTH))
    first, second = builder.fadd(a, b, flags=_CONTRACT), builder.fadd(c, d, flags=_CONTRACT)
    return builder.fadd(first, second, flags=_CONTRACT)


_typed(total, lambda x: types.float64(x))
lower_builtin(total, _VectorType)(_total)


def _floor(context: Any, builder: Any, signature: Any, given: Any) -> Any:
    name, kind = f"llvm.floor.v{WIDTH}f64", ir.FunctionType(_NUMBERS, [_NUMBERS])
    known = builder.module.globals.get(name)  # llvmlite names no functions of vectors by itself
    return builder.call(known or ir.Function(builder.module, kind, name), given)


_typed(np.floor, lambda x: x(x) if x is _VECTOR else None)
lower_builtin(np.floor, _VectorType)(_floor)


def _limited(context: Any, builder: Any, signature: Any, given: Any) -> Any:
    x, low, high = given
    if signature.return_type is _VECTOR:
        low, high = _all_four(builder, low), _all_four(builder, high)
    above = builder.select(builder.fcmp_ordered("<", x, low), low, x)
    return builder.select(builder.fcmp_ordered(">", above, high), high, above)


_typed(limited, lambda x, low, high: x(x, types.float64, types.float64))
lower_builtin(limited, types.Any, types.Float, types.Float)(_limited)


def _within(context: Any, builder: Any, signature: Any, given: Any) -> Any:
    x, low, high = given[0], _all_four(builder, given[1]), _all_four(builder, given[2])
    inside = builder.and_(builder.fcmp_ordered("<=", low, x), builder.fcmp_ordered("<=", x, high))
    bits = builder.bitcast(inside, ir.IntType(WIDTH))
    return builder.icmp_unsigned("==", bits, ir.Constant(ir.IntType(WIDTH), 2**WIDTH - 1))


_typed(within, lambda x, low, high: types.boolean(x, types.float64, types.float64))
lower_builtin(within, _VectorType, types.Float, types.Float)(_within)


def _side(context: Any, builder: Any, signature: Any, given: Any) -> Any:
    if signature.return_type is _VECTOR:
        number, index = _NUMBERS, _INDICES
        sign, one = (ir.Constant(index, [bit] * WIDTH) for bit in (_SIGN, _ONE))
    else:
        number, index = _NUMBER, _INDEX
        sign, one = ir.Constant(index, _SIGN), ir.Constant(index, _ONE)
    bits = builder.and_(builder.bitcast(given[0], index), sign)
    return builder.bitcast(builder.or_(bits, one), number)


_typed(side, lambda x: x(x))
lower_builtin(side, types.Any)(_side)


def _cubic(context: Any, builder: Any, signature: Any, given: Any) -> Any:
    """Four rows are loaded as they are and transposed: a read of each number would take twice the time."""
    table, place = given
    four = signature.return_type is _VECTOR
    number, index = (_NUMBERS, _INDICES) if four else (_NUMBER, _INDEX)
    row = builder.fptosi(place, index)
    t = builder.fsub(place, builder.sitofp(row, number), flags=_CONTRACT)
    entries = [builder.extract_element(row, ir.Constant(_INDEX, k)) for k in range(WIDTH)] if four else [row]
    rows = []
    for entry in entries:
        first = builder.shl(entry, ir.Constant(_INDEX, 2))
        address = _address(context, builder, signature.args[0], table, first)
        rows.append(builder.load(builder.bitcast(address, _NUMBERS.as_pointer()), align=8))
    of_place = (
        _transposed(builder, rows)
        if four
        else [builder.extract_element(rows[0], ir.Constant(_INDEX, k)) for k in range(WIDTH)]
    )
    value, *others = reversed(of_place)
    for coefficient in others:
        value = builder.fadd(coefficient, builder.fmul(t, value, flags=_CONTRACT), flags=_CONTRACT)
    return value


def _transposed(builder: Any, rows: list[Any]) -> list[Any]:
    even, odd = (
        [_arranged(builder, rows[k], rows[k + 1], places) for k in (0, 2)]
        for places in ([0, 4, 2, 6], [1, 5, 3, 7])
    )
    return [
        _arranged(builder, first, second, places)
        for places in ([0, 1, 4, 5], [2, 3, 6, 7])
        for first, second in (even, odd)
    ]


_typed(cubic, lambda table, place: place(table, place))
lower_builtin(cubic, types.Array, types.Any)(_cubic)


def _implement_operator(of_python: Callable[..., Any], of_builder: str) -> None:
    def build(context: Any, builder: Any, signature: Any, given: Any) -> Any:
        operands = [
            value if kind is _VECTOR else _all_four(builder, value)
            for value, kind in zip(given, signature.args, strict=True)
        ]
        return getattr(builder, of_builder)(*operands, flags=_CONTRACT)

    def typer(x: Any, y: Any) -> Any:
        kinds = (kind if kind is _VECTOR else types.float64 for kind in (x, y))
        return _VECTOR(*kinds) if x is _VECTOR or y is _VECTOR else None

    _typed(of_python, typer)
    for kinds in ((_VectorType, _VectorType), (_VectorType, types.Float), (types.Float, _VectorType)):
        lower_builtin(of_python, *kinds)(build)


for _of_python, _of_builder in ((operator.add, "fadd"), (operator.sub, "fsub"), (operator.mul, "fmul")):
    _implement_operator(_of_python, _of_builder)
