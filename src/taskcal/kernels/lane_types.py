"""What Numba is told of `lanes`: a number type of eight doubles, its sums and products, and its way from arrays and to them.

Numba's own loops over short arrays are vectorised only where its compiler proves that they do not overlap, which it cannot do
for the arrays of a walk; LLVM's vectors are what it would come to then.
"""

import operator
from typing import Any

import numpy as np
from llvmlite import ir
from numba import extending as numba_extending
from numba import types
from numba.core import cgutils, imputils
from numba.core.typeconv.castgraph import Conversion
from numba.core.typing.templates import ConcreteTemplate, signature
from numba.core.typing.templates import infer_global as numba_infer_global
from numba.np.arrayobj import make_array, populate_array

from taskcal.kernels.lanes import (
    LANES,
    angle_of,
    as_lanes,
    cosine_and_sine,
    least_of,
    square_root,
    total_of,
    unravel,
    where_less,
)

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
        """Unify with a number: a variable that begins as a number may go on as SIMD vectors."""
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
    """Address of a register's worth of a flat array."""
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


@extending.overload(unravel, strict=False)
def _unravel(rows: Any, out: Any, first: Any, n: Any) -> Any:
    def copy(rows, out, first, n):
        count = rows.shape[0] // LANES
        begin = first * count
        if first + LANES > n or count < LANES:
            for lane in range(min(LANES, n - first)):
                for k in range(count):
                    out[begin + lane * count + k] = rows[LANES * k + lane]
            return
        for k in range(0, count, LANES):
            row = min(k, count - LANES)  # what is left over goes together with some that went before
            _transpose(rows, LANES * row, out, begin + row, count)

    return copy


# What Numba is told of the functions of `lanes`: cosine and sine, square root, the angle of a direction, comparisons.
#
# All are sums and products of lanes with no branch, so that eight poses take no longer than one.


@extending.intrinsic
def _by_quadrant(typingctx: Any, quarters: Any, sine: Any, cosine: Any) -> Any:
    """Cosine and sine of an angle from those of what is left of it after so many quarters of a turn."""

    def generate(context: Any, builder: Any, sig: Any, values: Any) -> Any:
        quarters, sine, cosine = values
        turned = builder.fptosi(quarters, INTEGERS)
        one, two, up = (ir.Constant(INTEGERS, [k] * LANES) for k in (1, 2, 62))
        odd = builder.icmp_unsigned("!=", builder.and_(turned, one), ir.Constant(INTEGERS, [0] * LANES))

        def signed(value: Any, by: Any) -> Any:
            sign = builder.shl(builder.and_(by, two), up)
            return builder.bitcast(builder.xor(builder.bitcast(value, INTEGERS), sign), DOUBLES)

        return context.make_tuple(
            builder,
            sig.return_type,
            (
                signed(builder.select(odd, sine, cosine), builder.add(turned, one)),
                signed(builder.select(odd, cosine, sine), turned),
            ),
        )

    return types.UniTuple(lanes, 2)(quarters, sine, cosine), generate


ROUND = 1.5 * 2.0**52
"""Added and taken away again, it rounds to an integer."""

QUARTER = (1.5707963267341256, 6.077100506303966e-11, 2.0222662487959506e-21)
"""π/2 in three parts, the first two of 33 bits, so that up to 2²⁰ quarters are taken away exactly (Cody and Waite 1980)."""

SINE = (
    -1.66666666666666324e-01,
    8.33333333332248946e-03,
    -1.98412698298579493e-04,
    2.75573137070700677e-06,
    -2.50507602534068634e-08,
    1.58969099521155010e-10,
)
COSINE = (
    4.16666666666666019e-02,
    -1.38888888888741096e-03,
    2.48015872894767294e-05,
    -2.75573143513906633e-07,
    2.08757232129817483e-09,
    -1.13596475577881948e-11,
)
"""Minimax polynomials on ±π/4, from Sun's fdlibm (1993): sine r + r³·P(r²), cosine 1 − r²/2 + r⁴·Q(r²)."""


@extending.overload(cosine_and_sine, strict=False)
def _cosine_and_sine(angle: Any) -> Any:
    if angle is not lanes:
        return lambda angle: (np.cos(angle), np.sin(angle))
    (q1, q2, q3), (s1, s2, s3, s4, s5, s6), (c1, c2, c3, c4, c5, c6) = QUARTER, SINE, COSINE

    def of_lanes(angle):
        quarters = fused(angle, 0.6366197723675814, ROUND) - ROUND
        r = fused(quarters, -q3, fused(quarters, -q2, fused(quarters, -q1, angle)))
        z = r * r
        sine = r + r * z * (s1 + z * (s2 + z * (s3 + z * (s4 + z * (s5 + z * s6)))))
        cosine = 1.0 - 0.5 * z + z * z * (c1 + z * (c2 + z * (c3 + z * (c4 + z * (c5 + z * c6)))))
        return _by_quadrant(quarters, sine, cosine)

    return of_lanes


@extending.intrinsic
def _root(typingctx: Any, number: Any) -> Any:
    def generate(context: Any, builder: Any, sig: Any, values: Any) -> Any:
        kind = ir.FunctionType(DOUBLES, [DOUBLES])
        return builder.call(cgutils.get_or_insert_function(builder.module, kind, f"llvm.sqrt.v{LANES}f64"), values)

    return lanes(number), generate


@extending.overload(square_root, strict=False)
def _square_root(number: Any) -> Any:
    if number is lanes:
        return lambda number: _root(number)
    return lambda number: np.sqrt(number)


@extending.intrinsic
def _select(typingctx: Any, a: Any, b: Any, yes: Any, no: Any) -> Any:
    def generate(context: Any, builder: Any, sig: Any, values: Any) -> Any:
        a, b, yes, no = (v if k is lanes else same(builder, v) for v, k in zip(values, sig.args, strict=True))
        return builder.select(builder.fcmp_ordered("<", a, b), yes, no)

    return lanes(*(k if k is lanes else types.float64 for k in (a, b, yes, no))), generate


@extending.overload(where_less, strict=False)
def _where_less(a: Any, b: Any, yes: Any, no: Any) -> Any:
    if lanes in (a, b, yes, no):
        return lambda a, b, yes, no: _select(a, b, yes, no)
    return lambda a, b, yes, no: yes if a < b else no


@extending.intrinsic
def _least(typingctx: Any, numbers: Any) -> Any:
    def generate(context: Any, builder: Any, sig: Any, values: Any) -> Any:
        least = builder.extract_element(values[0], INDEX(0))
        for k in range(1, LANES):
            other = builder.extract_element(values[0], INDEX(k))
            least = builder.select(builder.fcmp_ordered("<", other, least), other, least)
        return least

    return types.float64(lanes), generate


@extending.overload(least_of, strict=False)
def _least_of(numbers: Any) -> Any:
    return lambda numbers: _least(numbers)


@extending.intrinsic
def _total(typingctx: Any, numbers: Any) -> Any:
    def generate(context: Any, builder: Any, sig: Any, values: Any) -> Any:
        double = ir.DoubleType()
        kind = ir.FunctionType(double, [double, DOUBLES])
        add = cgutils.get_or_insert_function(builder.module, kind, f"llvm.vector.reduce.fadd.v{LANES}f64")
        return builder.call(add, [ir.Constant(double, -0.0), values[0]], fastmath=("reassoc",))

    return types.float64(lanes), generate


@extending.overload(total_of, strict=False)
def _total_of(numbers: Any) -> Any:
    return lambda numbers: _total(numbers)


ARC = (
    (3.33333333333329318027e-01, 1.42857142725034663711e-01, 9.09088713343650656196e-02, 6.66107313738753120669e-02),
    (4.97687799461593236017e-02, 1.62858201153657823623e-02),
    (-1.99999999998764832476e-01, -1.11111104054623557880e-01, -7.69187620504482999495e-02),
    (-5.83357013379057348645e-02, -3.65315727442169155270e-02),
)
"""Minimax polynomial of (t − arctan t)/t up to 7/16, from fdlibm: the even powers of t², then the odd ones."""

HALF_ARC, EIGHTH, QUARTER_TURN, HALF_TURN = (
    (4.63647609000806093515e-01, 2.26987774529616870924e-17),
    (7.85398163397448278999e-01, 3.06161699786838301793e-17),
    (1.57079632679489655800e00, 6.12323399573676603587e-17),
    (3.14159265358979311600e00, 1.22464679914735317636e-16),
)
"""arctan ½, π/4, π/2 and π, each with what is left of it after rounding."""


@extending.overload(angle_of, strict=False)
def _angle_of(y: Any, x: Any) -> Any:
    if lanes not in (y, x):
        return lambda y, x: np.arctan2(y, x)
    ((a0, a2, a4, a6), (a8, a10), (a1, a3, a5), (a7, a9)) = ARC
    (half, half_rest), (eighth, eighth_rest), (quarter, quarter_rest), (turn, turn_rest) = (
        HALF_ARC,
        EIGHTH,
        QUARTER_TURN,
        HALF_TURN,
    )

    def of_lanes(y, x):
        up, along = where_less(y, 0.0, -y, y), where_less(x, 0.0, -x, x)
        longer, shorter = where_less(up, along, along, up), where_less(up, along, up, along)
        # arctan(s/l) = arctan c + arctan((s − c·l)/(l + c·s)), with c = 0, ½ or 1 so that little is left
        near, middle = 0.4375 * longer, 0.6875 * longer
        c = where_less(near, shorter, where_less(middle, shorter, 1.0, 0.5), 0.0)
        base = where_less(near, shorter, where_less(middle, shorter, eighth, half), 0.0)
        rest = where_less(near, shorter, where_less(middle, shorter, eighth_rest, half_rest), 0.0)
        t = (shorter - c * longer) / where_less(longer, 1e-300, 1.0, longer + c * shorter)
        z = t * t
        w = z * z
        even = z * (a0 + w * (a2 + w * (a4 + w * (a6 + w * (a8 + w * a10)))))
        odd = w * (a1 + w * (a3 + w * (a5 + w * (a7 + w * a9))))
        angle = base - ((t * (even + odd) - rest) - t)
        angle = where_less(along, up, quarter - (angle - quarter_rest), angle)
        angle = where_less(x, 0.0, turn - (angle - turn_rest), angle)
        return where_less(y, 0.0, -angle, angle)

    return of_lanes
