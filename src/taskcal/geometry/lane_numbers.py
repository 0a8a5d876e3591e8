"""What Numba is told of `lanes`: a number type of eight doubles, its sums and products, and its way from arrays and to them.

Numba's own loops over short arrays are vectorised only where its compiler proves that they do not overlap, which it cannot do
for the arrays of a walk; LLVM's vectors are what it would come to then.
"""

import operator
from typing import Any

from llvmlite import ir
from numba import extending as numba_extending
from numba import types
from numba.core import cgutils, imputils
from numba.core.typeconv.castgraph import Conversion
from numba.core.typing.templates import ConcreteTemplate, signature
from numba.core.typing.templates import infer_global as numba_infer_global
from numba.np.arrayobj import make_array, populate_array

from taskcal.geometry.lanes import LANES, as_lanes, unravel

extending: Any = numba_extending
lowering: Any = imputils
infer_global: Any = numba_infer_global

DOUBLES = ir.VectorType(ir.DoubleType(), LANES)
INTEGERS = ir.VectorType(ir.IntType(64), LANES)
INDEX = ir.IntType(32)


class Lanes(types.Type):
    """Eight doubles; a number goes wherever lanes do, the same in each."""

    def __init__(self) -> None:
        super().__init__("Lanes")

    def can_convert_from(self, typingctx: Any, other: Any) -> Any:
        """A double or an integer becomes lanes."""
        return Conversion.safe if isinstance(other, types.Float | types.Integer | types.IntegerLiteral) else None

    def unify(self, typingctx: Any, other: Any) -> Any:
        """What begins as a number may go on as lanes."""
        return self if isinstance(other, types.Float) else None


lanes = Lanes()


class _Model(extending.models.PrimitiveModel):
    def __init__(self, dmm: Any, fe_type: Any):
        super().__init__(dmm, fe_type, DOUBLES)


extending.register_model(Lanes)(_Model)


def same(builder: Any, value: Any) -> Any:
    """Lanes that all hold one double."""
    one = builder.insert_element(ir.Constant(DOUBLES, ir.Undefined), value, INDEX(0))
    return builder.shuffle_vector(one, one, ir.Constant(ir.VectorType(INDEX, LANES), [0] * LANES))


@lowering.lower_cast(types.Float, Lanes)
@lowering.lower_cast(types.Integer, Lanes)
def _cast(context: Any, builder: Any, given: Any, wanted: Any, value: Any) -> Any:
    return same(builder, context.cast(builder, value, given, types.float64))


def _teach(operation: Any, instruction: str) -> None:
    """A binary operation of lanes with lanes and with a number, its rounding that of the processor's fused instructions."""
    pairs = ((lanes, lanes), (lanes, types.float64), (types.float64, lanes))

    class Template(ConcreteTemplate):
        cases = [signature(lanes, *pair) for pair in pairs]  # noqa: RUF012 - Numba reads it

    infer_global(operation)(Template)

    def lower(context: Any, builder: Any, sig: Any, values: Any) -> Any:
        a, b = (v if kind is lanes else same(builder, v) for v, kind in zip(values, sig.args, strict=True))
        return getattr(builder, instruction)(a, b, flags=("contract",))

    for pair in pairs:
        lowering.lower_builtin(operation, *pair)(lower)


for _operation, _instruction in (
    (operator.add, "fadd"),
    (operator.iadd, "fadd"),
    (operator.sub, "fsub"),
    (operator.isub, "fsub"),
    (operator.mul, "fmul"),
    (operator.truediv, "fdiv"),
):
    _teach(_operation, _instruction)


class _Negative(ConcreteTemplate):
    cases = [signature(lanes, lanes)]  # noqa: RUF012 - Numba reads it


infer_global(operator.neg)(_Negative)


@lowering.lower_builtin(operator.neg, lanes)
def _negate(context: Any, builder: Any, sig: Any, values: Any) -> Any:
    return builder.fneg(values[0])


@extending.intrinsic
def fused(typingctx: Any, a: Any, b: Any, c: Any) -> Any:
    """a·b + c, in one rounding where the processor can."""

    def generate(context: Any, builder: Any, sig: Any, values: Any) -> Any:
        kind = ir.FunctionType(DOUBLES, [DOUBLES] * 3)
        function = cgutils.get_or_insert_function(builder.module, kind, f"llvm.fmuladd.v{LANES}f64")
        terms = [v if k is lanes else same(builder, v) for v, k in zip(values, sig.args, strict=True)]
        return builder.call(function, terms)

    return lanes(a, b, c), generate


@extending.intrinsic
def _view(typingctx: Any, array: Any) -> Any:
    kind = types.Array(lanes, array.ndim - 1, "C", aligned=False)

    def generate(context: Any, builder: Any, sig: Any, values: Any) -> Any:
        given = make_array(array)(context, builder, values[0])
        out = make_array(kind)(context, builder)
        size = 8 * LANES
        shape = cgutils.unpack_tuple(builder, given.shape, array.ndim)[:-1]
        strides = cgutils.unpack_tuple(builder, given.strides, array.ndim)[:-1]
        data = builder.bitcast(given.data, DOUBLES.as_pointer())
        populate_array(out, data, shape, strides, size, given.meminfo, given.parent)
        context.nrt.incref(builder, kind, out._getvalue())
        return out._getvalue()

    return kind(array), generate


@extending.overload(as_lanes, strict=False)
def _as_lanes(array: Any) -> Any:
    return lambda array: _view(array)


def _address(context: Any, builder: Any, kind: Any, array: Any, index: Any) -> Any:
    """Of a register's worth of a flat array."""
    data = make_array(kind)(context, builder, array).data
    return builder.bitcast(builder.gep(data, [index]), DOUBLES.as_pointer())


@extending.intrinsic
def _transpose(typingctx: Any, source: Any, i: Any, target: Any, j: Any, stride: Any) -> Any:
    """Eight rows of lanes of a flat array from number i on, lane by lane to the numbers from j, j + stride, … on of another."""

    def generate(context: Any, builder: Any, sig: Any, values: Any) -> Any:
        source, i, target, j, stride = values
        begin = _address(context, builder, sig.args[0], source, i)
        rows = [builder.load(builder.gep(begin, [INDEX(k)]), align=8) for k in range(LANES)]
        for half in (1, 2, 4):
            low = [k + LANES - half if k & half else k for k in range(LANES)]
            high = [k + LANES if k & half else k + half for k in range(LANES)]
            for k in (k for k in range(LANES) if not k & half):
                pair = rows[k], rows[k + half]
                rows[k], rows[k + half] = (
                    builder.shuffle_vector(*pair, ir.Constant(ir.VectorType(INDEX, LANES), mask))
                    for mask in (low, high)
                )
        for row in rows:
            builder.store(row, _address(context, builder, sig.args[2], target, j), align=8)
            j = builder.add(j, stride)
        return context.get_dummy_value()

    return types.void(source, types.intp, target, types.intp, types.intp), generate


@extending.intrinsic
def _stream(typingctx: Any, source: Any, i: Any, target: Any, j: Any) -> Any:
    """A register's worth of numbers past the caches."""

    def generate(context: Any, builder: Any, sig: Any, values: Any) -> Any:
        source, i, target, j = values
        value = builder.load(_address(context, builder, sig.args[0], source, i), align=8)
        store = builder.store(value, _address(context, builder, sig.args[2], target, j), align=8 * LANES)
        store.set_metadata("nontemporal", builder.module.add_metadata([INDEX(1)]))
        return context.get_dummy_value()

    return types.void(source, types.intp, target, types.intp), generate


@extending.overload(unravel, strict=False)
def _unravel(rows: Any, turned: Any, out: Any, first: Any, n: Any) -> Any:
    def copy(rows, turned, out, first, n):
        count = rows.shape[0] // LANES
        begin, streamed = first * count, turned.shape[0] > 0
        if first + LANES > n or count < LANES:
            for lane in range(min(LANES, n - first)):
                for k in range(count):
                    out[begin + lane * count + k] = rows[LANES * k + lane]
            return
        for k in range(0, count, LANES):
            row = min(k, count - LANES)  # what is left over goes together with some that went before
            if streamed:
                _transpose(rows, LANES * row, turned, row, count)
            else:
                _transpose(rows, LANES * row, out, begin + row, count)
        if streamed:
            for k in range(0, LANES * count, LANES):
                _stream(turned, k, out, begin + k)

    return copy
