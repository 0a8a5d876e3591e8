"""Eight poses at a time: numbers of the compiled kernels that hold one value for each of them, in a register of the processor.

A kernel that is written for one pose is compiled for eight at once where its arrays are `as_lanes`. Every lane is computed as every
other, so that what comes out for a pose does not depend on the poses beside it. What stands here says what each function does;
`lane_types` tells the compiler how.
"""

from functools import cache
from itertools import accumulate
from math import prod
from typing import Any

import numpy as np

LANES = 8
"""Poses at a time, as many as the widest registers of today's processors hold."""


def cosine_and_sine(angle: Any) -> Any:
    """Both, of a number or of lanes, which are right to the last digit but one up to 10⁵ radians."""
    return np.cos(angle), np.sin(angle)


def square_root(number: Any) -> Any:
    """Square root of a number or of SIMD vectors, rounded correctly; not a number where it is negative."""
    return np.sqrt(number)


def angle_of(y: Any, x: Any) -> Any:
    """Angle of the direction (x, y) from the x axis, −π to π, of numbers or of lanes, which are right to the last digit but one."""
    return np.arctan2(y, x)


def where_less(a: Any, b: Any, yes: Any, no: Any) -> Any:
    """`yes` where a < b, else `no`, of numbers or of lanes; `no` where a or b is not a number."""
    return np.where(a < b, yes, no)


def least_of(numbers: Any) -> Any:
    """The least of all lanes, none of which may be other than a number."""
    return np.min(numbers)


def total_of(numbers: Any) -> Any:
    """The sum over all lanes, in an order that suits the processor."""
    return np.sum(numbers)


def as_lanes(array: Any) -> Any:
    """The array (…, LANES) as one of lanes (…), in the same memory; where nothing is compiled, its last axis are the lanes."""
    return array


def unravel(rows: Any, out: Any, first: Any, n: Any) -> None:
    """Copy numbers of lanes, lane by lane, to where the pose of each has its own; all arrays are flat.

    Args:
        rows: so many numbers, each of all lanes.
        out: the same numbers of n poses, pose by pose.
        first: the pose of the first lane; lanes beyond n are left out.
        n: poses.
    """
    poses, count = min(LANES, n - first), len(rows) // LANES
    out.reshape(n, count)[first : first + poses] = rows.reshape(count, LANES).T[:poses]


def allocate_lanes(*shapes: tuple[int, ...]) -> list[np.ndarray]:
    """Arrays of lanes, (…, LANES) for each shape, of zeros, which begin where a register does: none lies across two lines."""
    size, places = _places(shapes)
    memory = np.zeros(size)
    begin = -memory.__array_interface__["data"][0] % (8 * LANES)
    return [np.ndarray(shape, buffer=memory, offset=begin + first) for shape, first in places]


@cache
def _places(shapes: tuple[tuple[int, ...], ...]) -> tuple[int, tuple[tuple[tuple[int, ...], int], ...]]:
    """Doubles that arrays of lanes need, one behind the other, with the shape and the first byte of each."""
    ends = tuple(accumulate((LANES * prod(shape) for shape in shapes), initial=0))
    return ends[-1] + LANES, tuple(((*shape, LANES), 8 * end) for shape, end in zip(shapes, ends, strict=False))
