"""What Numba is told of the functions of `lanes`: cosine and sine, square root, the angle of a direction, comparisons.

All are sums and products of lanes with no branch, so that eight poses take no longer than one.
"""

from typing import Any

import numpy as np
from llvmlite import ir
from numba import types
from numba.core import cgutils

from taskcal.geometry.lane_numbers import DOUBLES, INDEX, INTEGERS, extending, fused, lanes, same
from taskcal.geometry.lanes import LANES, angle_of, cosine_and_sine, least_of, square_root, total_of, where_less


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
