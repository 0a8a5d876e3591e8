"""Rotations as KUKA's and FANUC's controllers state them: three angles about z, y and x, in degrees."""

from math import atan2, copysign, cos, degrees, hypot, radians, sin

import numpy as np
from jaxtyping import Float

LOCKED = 1e-7
"""Cosine of B below which A and C turn about the same axis."""


def rotation(A: float, B: float, C: float) -> Float[np.ndarray, "3 3"]:
    """Rz(A)·Ry(B)·Rx(C) of angles in degrees.

    Of KUKA's they are A, B and C (KUKA System Software, data type FRAME), of FANUC's R, P and W.
    """
    a, b, c = radians(A), radians(B), radians(C)
    sa, ca, sb, cb, sc, cc = sin(a), cos(a), sin(b), cos(b), sin(c), cos(c)
    return np.array(
        [
            [ca * cb, ca * sb * sc - sa * cc, ca * sb * cc + sa * sc],
            [sa * cb, sa * sb * sc + ca * cc, sa * sb * cc - ca * sc],
            [-sb, cb * sc, cb * cc],
        ]
    )


def angles(
    R: Float[np.ndarray, "3 3"], near: tuple[float, float, float] = (0.0, 0.0, 0.0)
) -> tuple[float, float, float]:
    """A, B and C of a rotation, degrees: of the triples that describe it, the one nearest to some angles.

    They stay within half a turn, as controllers write them, where those angles do.
    """
    B = degrees(atan2(-R[2, 0], hypot(R[0, 0], R[1, 0])))
    if hypot(R[0, 0], R[1, 0]) < LOCKED:
        # R = Rz(A)·Ry(±90°)·Rx(C) depends on A ∓ C only: keep A
        rest = rotation(near[0], B, 0.0).T @ R
        return _within(_near((near[0], B, degrees(atan2(rest[2, 1], rest[1, 1]))), near), near)
    A, C = degrees(atan2(R[1, 0], R[0, 0])), degrees(atan2(R[2, 1], R[2, 2]))
    both = [_near((A, B, C), near), _near((A + 180.0, 180.0 - B, C + 180.0), near)]
    best = min(both, key=lambda triple: sum(abs(angle - old) for angle, old in zip(triple, near, strict=True)))
    return _within(best, near)


def _near(triple: tuple[float, float, float], near: tuple[float, float, float]) -> tuple[float, float, float]:
    """The same angles but for whole turns."""
    A, B, C = (angle + 360.0 * round((old - angle) / 360.0) for angle, old in zip(triple, near, strict=True))
    return A, B, C


def _within(triple: tuple[float, float, float], near: tuple[float, float, float]) -> tuple[float, float, float]:
    """The same angles, within half a turn where others are."""
    A, B, C = (
        angle - copysign(360.0, angle) if abs(angle) > 180.0 >= abs(old) else angle
        for angle, old in zip(triple, near, strict=True)
    )
    return A, B, C
