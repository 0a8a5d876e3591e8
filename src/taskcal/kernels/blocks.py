"""Poses side by side: what a loop has to be so that the compiler turns it into SIMD vectors.

Kernels work on blocks of poses. Each number of a block is a row of memory, with one place for each pose, and what is done to it
is a loop along rows without a branch. The compiler vectorises such a loop if it can prove, or check in a few comparisons, that
no row which is written overlaps another one. So a loop reads and writes few arrays, and rows of one array at constant distances:
``T[k * BLOCK + i]``, with k a number in the source. Every place is computed as every other, so that the result of a pose does
not depend on the poses beside it.
"""

from taskcal.kernels.compiled import inlined, part

BLOCK = 32
"""Poses in a block; of 8 to 64, 32 and 64 were fastest on AVX2 (149 and 132 ns a pose for walk and columns, 221 with 16), and a
campaign of few poses fills the smaller one."""

ROUND = 1.5 * 2.0**52
"""Added and taken away again, it rounds to an integer."""

QUARTER_1, QUARTER_2, QUARTER_3 = 1.5707963267341256, 6.077100506303966e-11, 2.0222662487959506e-21
"""π/2 in three parts, the first two of 33 bits, so that up to 2²⁰ quarters are taken away exactly (Cody and Waite 1980)."""

S1, S2, S3 = -1.66666666666666324e-01, 8.33333333332248946e-03, -1.98412698298579493e-04
S4, S5, S6 = 2.75573137070700677e-06, -2.50507602534068634e-08, 1.58969099521155010e-10
C1, C2, C3 = 4.16666666666666019e-02, -1.38888888888741096e-03, 2.48015872894767294e-05
C4, C5, C6 = -2.75573143513906633e-07, 2.08757232129817483e-09, -1.13596475577881948e-11
"""Minimax polynomials on ±π/4, from Sun's fdlibm (1993): sine r + r³·P(r²), cosine 1 − r²/2 + r⁴·Q(r²)."""


@inlined
def cosine_and_sine(angle):
    """Both, right to the last digit but one up to 10⁵ radians."""
    quarters = (angle * 0.6366197723675814 + ROUND) - ROUND
    r = ((angle - quarters * QUARTER_1) - quarters * QUARTER_2) - quarters * QUARTER_3
    z = r * r
    sine = r + r * z * (S1 + z * (S2 + z * (S3 + z * (S4 + z * (S5 + z * S6)))))
    cosine = 1.0 - 0.5 * z + z * z * (C1 + z * (C2 + z * (C3 + z * (C4 + z * (C5 + z * C6)))))
    turned = quarters - 4.0 * ((0.25 * quarters + ROUND) - ROUND)  # −2 to 2, whose cosine and sine are 0, 1 or −1
    c, s = 1.0 - abs(turned), turned * (2.0 - abs(turned))
    return c * cosine - s * sine, s * cosine + c * sine


A0, A2, A4 = 3.33333333333329318027e-01, 1.42857142725034663711e-01, 9.09088713343650656196e-02
A6, A8, A10 = 6.66107313738753120669e-02, 4.97687799461593236017e-02, 1.62858201153657823623e-02
A1, A3, A5 = -1.99999999998764832476e-01, -1.11111104054623557880e-01, -7.69187620504482999495e-02
A7, A9 = -5.83357013379057348645e-02, -3.65315727442169155270e-02
"""Minimax polynomial of (t − arctan t)/t up to 7/16, from fdlibm: the even powers of t², then the odd ones."""

HALF_ARC, HALF_ARC_REST = 4.63647609000806093515e-01, 2.26987774529616870924e-17
EIGHTH, EIGHTH_REST = 7.85398163397448278999e-01, 3.06161699786838301793e-17
QUARTER, QUARTER_REST = 1.57079632679489655800e00, 6.12323399573676603587e-17
HALF, HALF_REST = 3.14159265358979311600e00, 1.22464679914735317636e-16
"""arctan ½, π/4, π/2 and π, each with what is left of it after rounding."""


@inlined
def angle_of(y, x):
    """Angle of the direction (x, y) from the x axis, −π to π, right to the last digit but one."""
    up, along = abs(y), abs(x)
    longer, shorter = (along, up) if up < along else (up, along)
    # arctan(s/l) = arctan c + arctan((s − c·l)/(l + c·s)), with c = 0, ½ or 1 so that little is left
    c, base, rest = 0.0, 0.0, 0.0
    if 0.4375 * longer < shorter:
        c, base, rest = 0.5, HALF_ARC, HALF_ARC_REST
    if 0.6875 * longer < shorter:
        c, base, rest = 1.0, EIGHTH, EIGHTH_REST
    t = (shorter - c * longer) / (1.0 if longer < 1e-300 else longer + c * shorter)
    z = t * t
    w = z * z
    even = z * (A0 + w * (A2 + w * (A4 + w * (A6 + w * (A8 + w * A10)))))
    odd = w * (A1 + w * (A3 + w * (A5 + w * (A7 + w * A9))))
    angle = base - ((t * (even + odd) - rest) - t)
    angle = QUARTER - (angle - QUARTER_REST) if along < up else angle
    angle = HALF - (angle - HALF_REST) if x < 0.0 else angle
    return -angle if y < 0.0 else angle


@part
def take_block(rows, first, out):
    """Copy some rows of an array to the places of a block, its last row to the places beyond it."""
    for i in range(BLOCK):
        row = min(first + i, rows.shape[0] - 1)
        for k in range(rows.shape[1]):
            out[k, i] = rows[row, k]
