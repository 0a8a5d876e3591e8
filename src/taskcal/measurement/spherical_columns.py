"""Positions as an instrument turns to them: an azimuth, an elevation or a zenith angle, and a range."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from jaxtyping import Float

from taskcal.measurement.stated_units import stated_units
from taskcal.measurement.units import ANGLES, LENGTHS, UNITS, split_unit
from taskcal.tabular.layout import Laid
from taskcal.tabular.packed_rows import with_columns
from taskcal.tabular.table import Table

_AZIMUTH = (
    "azimuth",
    "azimuth angle",
    "az",
    "azim",
    "azimut",
    "horizontal angle",
    "hor angle",
    "h angle",
    "horizontalwinkel",
)
_CLOCKWISE = ("hz", "hz angle", "hz winkel")
"""What theodolites turn, clockwise seen from above."""
_ELEVATION = ("elevation", "elevation angle", "elev", "el", "höhenwinkel", "hoehenwinkel")
_ZENITH = ("zenith", "zenith angle", "zenitwinkel", "zenitdistanz", "zenithdistanz", "zenit", "ze")
_EITHER = ("v", "vertical", "vertical angle", "v angle", "vertikalwinkel", "v winkel", "phi", "φ")
"""Counted from the horizontal by some and from the zenith by others; beside Hz theodolites count it from the zenith."""
_RANGE = (
    "range", "distance", "dist", "d", "r", "radius", "slope distance", "slope dist", "sd", "distanz", "entfernung",
    "schrägdistanz", "schraegdistanz", "schrägstrecke", "strecke",
)  # fmt: skip
_THETA = ("theta", "θ")


@dataclass(frozen=True, kw_only=True)
class _Directed:
    """The columns of one target."""

    target: str
    azimuth: int
    clockwise: bool
    polar: int
    from_zenith: bool
    range: int


def with_positions(laid: Laid) -> Laid:
    """The table with columns ``x y z`` in place of angles and ranges; what was taken is noted.

    x points along azimuth zero and z upwards. An azimuth turns counter-clockwise seen from above; ``Hz`` clockwise.

    Raises:
        FileError: the unit of an angle is not stated, or whether it is counted from the horizontal.
    """
    if not any(laid.table.header):
        return laid
    parted = [split_unit(name) for name in laid.table.header]
    if any(text in ("x", "x coordinate", "x koordinate") or text.endswith(" x") for text, _ in parted):
        return laid
    directed = _directed(laid.table, [text for text, _ in parted])
    for columns in directed:
        units = [parted[k][1] or UNITS.get(laid.units[k]) for k in (columns.azimuth, columns.polar, columns.range)]
        laid = _replaced(laid, columns, units)
    return laid


def _directed(table: Table, texts: Sequence[str]) -> list[_Directed]:
    """The columns of each target that has all three."""
    by_target: dict[str, dict[str, int]] = {}
    for k, text in enumerate(texts):
        for kind, names in (
            ("azimuth", _AZIMUTH), ("clockwise", _CLOCKWISE), ("elevation", _ELEVATION), ("zenith", _ZENITH), ("either", _EITHER),
            ("range", _RANGE), ("theta", _THETA),
        ):  # fmt: skip
            name = next((n for n in sorted(names, key=len, reverse=True) if text == n or text.endswith(f" {n}")), None)
            if name is not None:
                by_target.setdefault(text[: len(text) - len(name)].strip(), {}).setdefault(kind, k)
                break
    out: list[_Directed] = []
    for target, at in by_target.items():
        turned = at.get("azimuth", at.get("clockwise"))
        if "range" not in at:
            continue
        polar = next((at[kind] for kind in ("elevation", "zenith") if kind in at), None)
        if polar is None and "clockwise" in at:
            polar = at.get("either")
        if turned is not None and polar is not None:
            zenith = "elevation" not in at
            clockwise = "azimuth" not in at
            out.append(
                _Directed(
                    target=target,
                    azimuth=turned,
                    clockwise=clockwise,
                    polar=polar,
                    from_zenith=zenith,
                    range=at["range"],
                )
            )
        elif "either" in at and (turned is not None or "theta" in at):
            name = table.header[at["either"]]
            message = (
                "is counted from the horizontal by some instruments and from the zenith by others; name it elevation or zenith, "
                "the angle about the vertical azimuth"
            )
            raise table.header_error(f"'{name}' {message}", name)
    return out


def _replaced(laid: Laid, columns: _Directed, units: Sequence[str | None]) -> Laid:
    """The table with one target's position in place of its angles and range."""
    table, header = laid.table, laid.table.header
    angle = stated_units(laid.preamble).angle
    scales: list[float] = []
    for k, unit in zip((columns.azimuth, columns.polar), units[:2], strict=True):
        unit = unit or angle
        if unit not in ANGLES:
            what = "the unit of the angle is not stated" if unit is None else f"'{unit}' is no unit of an angle"
            raise table.header_error(f"{what}; name the column {header[k]}_deg, _rad or _gon", header[k])
        scales.append(ANGLES[unit])
    if units[2] is not None and units[2] not in LENGTHS:
        raise table.header_error(
            f"'{units[2]}' is no unit of length; known: {', '.join(LENGTHS)}", header[columns.range]
        )
    cells = [table.numbers(header[k], empty=True) for k in (columns.azimuth, columns.polar, columns.range)]
    points = _cartesian(columns, cells[0] * scales[0], cells[1] * scales[1], cells[2])
    prefix, unit = columns.target and f"{columns.target} ", f" {units[2]}" if units[2] else ""
    names = dict(
        zip((columns.azimuth, columns.polar, columns.range), (f"{prefix}{a}{unit}" for a in "xyz"), strict=True)
    )
    axis = {k: i for i, k in enumerate(names)}
    rows = with_columns(table.rows, {k: map(_text, points[:, i]) for k, i in axis.items()})
    note = (
        f"{', '.join(header[k] for k in names)} are read as an azimuth that turns "
        f"{'clockwise' if columns.clockwise else 'counter-clockwise'} seen from above, an angle from the "
        f"{'zenith' if columns.from_zenith else 'horizontal'} and a range"
    )
    replaced = replace(table, header=tuple(names.get(k, name) for k, name in enumerate(header)), rows=rows)
    return replace(
        laid,
        table=replaced,
        units=tuple("" if k in names else under for k, under in enumerate(laid.units)),
        notes=(*laid.notes, note),
    )


def _cartesian(
    columns: _Directed, azimuth: np.ndarray, polar: np.ndarray, distance: np.ndarray
) -> Float[np.ndarray, "rows 3"]:
    """x, y and z in the unit of the range; NaN where the beam was lost."""
    elevation = np.pi / 2 - polar if columns.from_zenith else polar
    turned = -azimuth if columns.clockwise else azimuth
    level = distance * np.cos(elevation)
    points = np.stack([level * np.cos(turned), level * np.sin(turned), distance * np.sin(elevation)], axis=1)
    points[distance == 0.0] = np.nan
    return points


def _text(value: float) -> str:
    return "" if np.isnan(value) else repr(float(value))
