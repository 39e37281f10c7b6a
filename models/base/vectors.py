"""Vectors of four numbers: in compiled code one register each, in plain Python a NumPy array.

For loops that the compiler does not vectorise by itself, such as those with reads of a table. The operators
``+``, ``-``, ``*`` and `numpy.floor` act on each entry; a number is taken for all four. `store`,
`limited`, `side`, `cubic` and `like` also take a number in place of a vector, so that one formula serves
blocks of four columns and the columns that are left.
"""

from __future__ import annotations

import operator
from collections.abc import Callable
from math import copysign
from typing import Any

import numba
import numpy as np
from llvmlite import ir
from numba.core.cgutils import get_or_insert_function
from numba.extending import intrinsic, models, register_model
from numpy.typing import NDArray

from spheretwin.models.base.compiled import implements

WIDTH = 4

Vector = Any
"""A vector or, where a function takes either, a number."""

Array = NDArray[np.float64]

_NUMBER, _INDEX = ir.DoubleType(), ir.IntType(64)
_NUMBERS, _INDICES = ir.VectorType(_NUMBER, WIDTH), ir.VectorType(_INDEX, WIDTH)
_CONTRACT = ("contract",)  # a product and a sum may be fused, as in all compiled functions


class _VectorType(numba.types.Type):
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


@implements(total)
def _compiled_total(x: Any) -> Callable[..., Any]:
    def call(x: Any) -> Any:
        return _entry(x, 0) + _entry(x, 1) + (_entry(x, 2) + _entry(x, 3))

    return call


@implements(np.floor)
def _compiled_floor(x: Any) -> Callable[..., Any] | None:
    def call(x: Any) -> Any:
        return _floor(x)

    return call if x is _VECTOR else None


@implements(load)
def _compiled_load(values: Any, first: Any) -> Callable[..., Any]:
    def call(values: Any, first: Any) -> Any:
        return _load(values, first)

    return call


@implements(store)
def _compiled_store(vector: Any, values: Any, first: Any) -> Callable[..., Any]:
    def call(vector: Any, values: Any, first: Any) -> None:
        _store(vector, values, first)

    def call_number(vector: Any, values: Any, first: Any) -> None:
        values[first] = vector

    return call if vector is _VECTOR else call_number


@implements(like)
def _compiled_like(x: Any, values: Any, first: Any) -> Callable[..., Any]:
    def call(x: Any, values: Any, first: Any) -> Any:
        return _load(values, first)

    def call_number(x: Any, values: Any, first: Any) -> Any:
        return values[first]

    return call if x is _VECTOR else call_number


@implements(limited)
def _compiled_limited(x: Any, low: Any, high: Any) -> Callable[..., Any]:
    def call(x: Any, low: Any, high: Any) -> Any:
        return _limited(x, low, high)

    def call_number(x: Any, low: Any, high: Any) -> Any:
        return min(max(x, low), high)

    return call if x is _VECTOR else call_number


@implements(within)
def _compiled_within(x: Any, low: Any, high: Any) -> Callable[..., Any]:
    def call(x: Any, low: Any, high: Any) -> Any:
        return _within(x, low, high)

    return call


@implements(side)
def _compiled_side(x: Any) -> Callable[..., Any]:
    def call(x: Any) -> Any:
        return _side(x)

    def call_number(x: Any) -> Any:
        return copysign(1.0, x)

    return call if x is _VECTOR else call_number


@implements(cubic)
def _compiled_cubic(table: Any, place: Any) -> Callable[..., Any]:
    def call(table: Any, place: Any) -> Any:
        return _cubic(table, place)

    def call_number(table: Any, place: Any) -> Any:
        row = np.uint64(np.int64(place))  # unsigned: no check for an index below 0 is compiled in
        t = place - np.float64(row)
        return table[row, 0] + t * (table[row, 1] + t * (table[row, 2] + t * table[row, 3]))

    return call if place is _VECTOR else call_number


@implements(vector)
def _compiled_vector(a: Any, b: Any, c: Any, d: Any) -> Callable[..., Any]:
    def call(a: Any, b: Any, c: Any, d: Any) -> Any:
        return _vector(a, b, c, d)

    return call


@implements(entry)
def _compiled_entry(x: Any, number: Any) -> Callable[..., Any]:
    def call(x: Any, number: Any) -> Any:
        return _entry(x, number)

    return call


def _all_four(builder: Any, number: Any) -> Any:
    first = builder.insert_element(ir.Constant(_NUMBERS, ir.Undefined), number, ir.Constant(_INDEX, 0))
    return _arranged(builder, first, first, [0] * WIDTH)


def _arranged(builder: Any, first: Any, second: Any, places: list[int]) -> Any:
    """Return entries of two vectors; those of the second one are counted from four on."""
    mask = ir.Constant(ir.VectorType(ir.IntType(32), WIDTH), places)
    return builder.shuffle_vector(first, second, mask)


def _address(context: Any, builder: Any, kind: Any, array: Any, first: Any) -> Any:
    data = context.make_array(kind)(context, builder, array).data
    return builder.bitcast(builder.gep(data, [first]), _NUMBERS.as_pointer())


def _build_load(typing: Any, values: Any, first: Any) -> tuple[Any, Callable[..., Any]]:
    def build(context: Any, builder: Any, signature: Any, given: Any) -> Any:
        return builder.load(_address(context, builder, signature.args[0], *given), align=8)

    return _VECTOR(values, numba.types.intp), build


def _build_store(typing: Any, vector: Any, values: Any, first: Any) -> tuple[Any, Callable[..., Any]]:
    def build(context: Any, builder: Any, signature: Any, given: Any) -> Any:
        target = _address(context, builder, signature.args[1], *given[1:])
        builder.store(given[0], target, align=8)
        return context.get_dummy_value()

    return numba.types.void(vector, values, numba.types.intp), build


def _build_vector(typing: Any, a: Any, b: Any, c: Any, d: Any) -> tuple[Any, Callable[..., Any]]:
    def build(context: Any, builder: Any, signature: Any, given: Any) -> Any:
        made = ir.Constant(_NUMBERS, ir.Undefined)
        for place, number in enumerate(given):
            made = builder.insert_element(made, number, ir.Constant(_INDEX, place))
        return made

    return _VECTOR(numba.float64, numba.float64, numba.float64, numba.float64), build


def _build_entry(typing: Any, x: Any, number: Any) -> tuple[Any, Callable[..., Any]]:
    def build(context: Any, builder: Any, signature: Any, given: Any) -> Any:
        return builder.extract_element(*given)

    return numba.float64(x, numba.types.intp), build


def _build_floor(typing: Any, x: Any) -> tuple[Any, Callable[..., Any]]:
    def build(context: Any, builder: Any, signature: Any, given: Any) -> Any:
        kind = ir.FunctionType(_NUMBERS, [_NUMBERS])
        return builder.call(get_or_insert_function(builder.module, kind, f"llvm.floor.v{WIDTH}f64"), given)

    return _VECTOR(x), build


def _build_limited(typing: Any, x: Any, low: Any, high: Any) -> tuple[Any, Callable[..., Any]]:
    def build(context: Any, builder: Any, signature: Any, given: Any) -> Any:
        x, low, high = given[0], _all_four(builder, given[1]), _all_four(builder, given[2])
        above = builder.select(builder.fcmp_ordered("<", x, low), low, x)
        return builder.select(builder.fcmp_ordered(">", above, high), high, above)

    return _VECTOR(x, numba.float64, numba.float64), build


def _build_within(typing: Any, x: Any, low: Any, high: Any) -> tuple[Any, Callable[..., Any]]:
    def build(context: Any, builder: Any, signature: Any, given: Any) -> Any:
        x, low, high = given[0], _all_four(builder, given[1]), _all_four(builder, given[2])
        inside = builder.and_(builder.fcmp_ordered("<=", low, x), builder.fcmp_ordered("<=", x, high))
        bits = builder.bitcast(inside, ir.IntType(WIDTH))
        return builder.icmp_unsigned("==", bits, ir.Constant(ir.IntType(WIDTH), 2**WIDTH - 1))

    return numba.boolean(x, numba.float64, numba.float64), build


def _build_side(typing: Any, x: Any) -> tuple[Any, Callable[..., Any]]:
    def build(context: Any, builder: Any, signature: Any, given: Any) -> Any:
        bits = builder.bitcast(given[0], _INDICES)
        of_sign, of_one = (ir.Constant(_INDICES, [bit] * WIDTH) for bit in (1 << 63, 0x3FF << 52))
        return builder.bitcast(builder.or_(builder.and_(bits, of_sign), of_one), _NUMBERS)

    return _VECTOR(x), build


def _build_cubic(typing: Any, table: Any, place: Any) -> tuple[Any, Callable[..., Any]]:
    """Four rows are loaded as they are and transposed: a read of each number would take twice the time."""

    def build(context: Any, builder: Any, signature: Any, given: Any) -> Any:
        row = builder.fptosi(given[1], _INDICES)
        t = builder.fsub(given[1], builder.sitofp(row, _NUMBERS), flags=_CONTRACT)
        rows = []
        for entry in range(WIDTH):
            first = builder.shl(
                builder.extract_element(row, ir.Constant(_INDEX, entry)), ir.Constant(_INDEX, 2)
            )
            rows.append(builder.load(_address(context, builder, signature.args[0], given[0], first), align=8))
        value, *others = reversed(_transposed(builder, rows))
        for coefficient in others:
            product = builder.fmul(t, value, flags=_CONTRACT)
            value = builder.fadd(coefficient, product, flags=_CONTRACT)
        return value

    return _VECTOR(table, place), build


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


_load: Any = intrinsic(_build_load)
_store: Any = intrinsic(_build_store)
_vector: Any = intrinsic(_build_vector)
_entry: Any = intrinsic(_build_entry)
_floor: Any = intrinsic(_build_floor)
_limited: Any = intrinsic(_build_limited)
_within: Any = intrinsic(_build_within)
_side: Any = intrinsic(_build_side)
_cubic: Any = intrinsic(_build_cubic)


def _overload_operator(of_python: Callable[..., Any], of_builder: str) -> None:
    def build_operation(typing: Any, x: Any, y: Any) -> tuple[Any, Callable[..., Any]]:
        def build(context: Any, builder: Any, signature: Any, given: Any) -> Any:
            operands = [
                value if kind is _VECTOR else _all_four(builder, value)
                for value, kind in zip(given, signature.args, strict=True)
            ]
            return getattr(builder, of_builder)(*operands, flags=_CONTRACT)

        kinds = (kind if kind is _VECTOR else numba.float64 for kind in (x, y))
        return _VECTOR(*kinds), build

    operation: Any = intrinsic(build_operation)

    @implements(of_python)
    def implementation(x: Any, y: Any) -> Callable[..., Any] | None:
        def call(x: Any, y: Any) -> Any:
            return operation(x, y)

        return call if x is _VECTOR or y is _VECTOR else None


for _of_python, _of_builder in ((operator.add, "fadd"), (operator.sub, "fsub"), (operator.mul, "fmul")):
    _overload_operator(_of_python, _of_builder)
