"""Whether the numbers of a Denavit–Hartenberg table are in the units of its columns, as far as they tell."""

from collections.abc import Sequence

import numpy as np
from jaxtyping import Bool, Float

from taskcal.tabular.column_groups import ColumnGroups

LENGTHS = ("a_mm", "d_mm")
ANGLES = ("alpha_deg", "theta_offset_deg")
LIMITS = ("lower_deg", "upper_deg")

SMALLEST_ROBOT_MM = 20.0
"""Millimetres that all links are long together: Mecademic's Meca500, among the smallest on the market, has 460; a table in
metres has 0.5 to 10."""

LONGEST_LINK_MM = 1e5
"""Millimetres: 100 m, the travel of the longest gantries."""

NEARLY_PARALLEL_DEG = 0.3
"""Between axes that were built parallel, and calibrated: their common normal, and with it a and d, may be anywhere."""

TWO_PI = 2.0 * np.pi

USUAL_ANGLES_RAD = np.radians([30.0, 45.0, 60.0, 90.0, 120.0, 135.0, 150.0, 180.0, 270.0, 360.0])
"""Angles that robots are built with; in radians nobody means them by degrees."""

ROUNDING_RAD = 2e-3
"""Of an angle in radians written with two or three digits."""

MAX_SMALL_TWIST = 0.7
"""A design's smallest twist in radians (40°); in degrees, one between this and 2π is no design's and too much for a defect."""


def check_units(columns: ColumnGroups) -> None:
    """Refuse lengths and angles that no industrial robot has.

    Lengths are in metres where all of them together make no robot. Angles are in radians where none exceeds a turn in
    radians, and one is a twist, or a usual offset, in radians. A table of zeros, parallel or small twists passes.

    Raises:
        FileError: with line, column, value, the unit that was probably meant and what would work.
    """
    _lengths(columns)
    _angles(columns, ANGLES)
    if LIMITS[0] in columns:
        _angles(columns, LIMITS)


def _lengths(columns: ColumnGroups) -> None:
    values = columns.side_by_side(LENGTHS)
    row, k = _largest(values)
    longest = abs(values[row, k])
    twist = np.abs(columns.numbers("alpha_deg"))
    if longest > LONGEST_LINK_MM and not np.any((twist > 0.0) & (twist < NEARLY_PARALLEL_DEG)):
        raise columns.error(
            f"{values[row, k]:g} mm is longer than any link of a robot; it is probably in micrometres: give millimetres",
            row,
            LENGTHS[k],
        )
    total = float(np.abs(values).sum())
    if 0.0 < total < SMALLEST_ROBOT_MM:
        raise columns.error(
            f"{values[row, k]:g} mm is the longest of all lengths, which add up to {total:.3g} mm: too small for a robot; they are "
            f"probably in metres: give millimetres, here {values[row, k] * 1e3:g}",
            row,
            LENGTHS[k],
        )


def _angles(columns: ColumnGroups, names: Sequence[str]) -> None:
    values = columns.side_by_side(names)
    row, k = _largest(values)
    if names == ANGLES and abs(values[row, k]) > 360.0:
        raise columns.error(
            f"{values[row, k]:g}° is more than a turn; is it in milliradians? Give degrees from -360 to 360",
            row,
            names[k],
        )
    if abs(values[row, k]) > TWO_PI * (1.0 + ROUNDING_RAD):
        return
    size = np.abs(values)
    usual: Bool[np.ndarray, "rows columns"] = np.any(np.abs(size[..., None] - USUAL_ANGLES_RAD) < ROUNDING_RAD, axis=2)
    radians = size > 0.0 if names == LIMITS else usual
    if names == ANGLES:
        radians[:, 0] |= size[:, 0] > MAX_SMALL_TWIST
    if not radians.any():
        return
    row, k = (int(i[0]) for i in np.nonzero(radians))
    raise columns.error(
        f"{values[row, k]:g} is probably in radians, as no angle of {' and '.join(names)} exceeds 2π: give degrees, here "
        f"{np.degrees(values[row, k]):.6g}",
        row,
        names[k],
    )


def _largest(values: Float[np.ndarray, "rows columns"]) -> tuple[int, int]:
    row, k = np.unravel_index(int(np.abs(values).argmax()), values.shape)
    return int(row), int(k)
