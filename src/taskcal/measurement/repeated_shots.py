"""Shots of one pose, averaged."""

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np
from jaxtyping import Bool, Float

from taskcal.errors import FileError, shown
from taskcal.geometry import se3
from taskcal.measurement.readings import Readings
from taskcal.measurement.tracker import TrackerNoise
from taskcal.tabular.faults import Faults

SAME_POSE_RAD = 1e-4
"""Largest difference of joints, radians or metres, of one pose: what a controller reports of a robot at rest."""

RETURN_M = 1e-3
"""Distance of two returns to one pose, metres. Data sheets of industrial robots state a repeatability (ISO 9283:1998, RP) of 0.02
to 0.5 mm: a radius about the mean, so that two returns are up to twice as far apart."""

SIGMAS = 10.0
"""Standard uncertainties of a coordinate between two shots of one pose. The distance of two shots is √2 times a Maxwell variable:
beyond ten in fewer than one of a thousand million pairs."""

COARSEST_M = 1e-3
"""Standard uncertainty of a coordinate that shots themselves may show, metres: cameras and motion capture. Beyond it they are of
several poses."""

MIN_REPEATED = 3
"""Poses with several shots, from which their scatter is learnt; one of three may hold two poses."""

TURNED_RAD = float(np.radians(2.0))
"""Rotation between two shots of one pose: instruments of six degrees of freedom scatter by hundredths of a degree, cameras by
tenths."""


def average_shots(readings: Readings, metres: float = 1e-3) -> Readings:
    """Readings with one row for each id: rows of one id are shots of one pose, and their positions and rotations are averaged.

    The scatter of the shots about their means is noted.

    Args:
        readings: one row for each shot.
        metres: that one unit of positions is likely to be, where they state none.

    Raises:
        FileError: rows of one id have different joints, or their shots are too far apart for one pose.
    """
    if readings.ids is None or len(set(readings.ids)) == len(readings.ids):
        return readings
    groups = rows_by_id(readings.ids)
    numbers = {name: pose for pose, name in enumerate(groups)}
    pose_of = [numbers[name] for name in readings.ids]
    refuse_other_joints(readings, groups)
    for name, values in readings.points.items():
        refuse_two_poses(readings, name, values, groups, metres)
    _refuse_turned(readings, groups)
    points = {
        name: np.stack([mean_of_seen(values[rows]) for rows in groups.values()])
        for name, values in readings.points.items()
    }
    first = readings.take(np.array([rows[0] for rows in groups.values()]))

    seen = _seen(readings)
    counted = seen | ~np.isin(pose_of, np.array(pose_of)[seen])

    def mean_rotations(R: Float[np.ndarray, "n 3 3"]) -> Float[np.ndarray, "poses 3 3"]:
        sums = np.zeros((len(groups), 3, 3))
        # a lost beam has no orientation of its own
        np.add.at(sums, pose_of, R * counted[:, None, None])
        return se3.nearest_rotation(sums)

    turned, angles = readings.rotations, readings.open_angles
    most = max(len(rows) for rows in groups.values())
    note = f"{len(readings)} rows are {len(groups)} poses measured up to {most} times, and averaged"
    if readings.length_unit_stated:
        note += f"; the shots scatter by {_scatter(readings, groups) * 1e3:.4f} mm per axis"
    return replace(
        first,
        points=points,
        rotations=None if turned is None else mean_rotations(turned),
        other_rotations={name: mean_rotations(R) for name, R in readings.other_rotations.items()},
        open_angles=None if angles is None else angles.mapped(mean_rotations),
        notes=(*readings.notes, note),
    )


def rows_by_id(ids: tuple[str, ...]) -> dict[str, list[int]]:
    """The rows of each id, in the order in which the ids come first."""
    groups: dict[str, list[int]] = {}
    for row, name in enumerate(ids):
        groups.setdefault(name, []).append(row)
    return groups


def refuse_other_joints(readings: Readings, groups: dict[str, list[int]]) -> None:
    """See that rows of one id are of one pose.

    Raises:
        FileError: some have different joints.
    """
    if readings.q is None:
        return
    faults = Faults()
    for name, rows in groups.items():
        for row in rows[1:]:
            if np.abs(readings.q[row] - readings.q[rows[0]]).max() > SAME_POSE_RAD:
                line = int(readings.lines[rows[0]])
                message = f"id '{shown(name)}' stands in line {line} already; give each row its own"
                with faults.collecting():
                    raise FileError(readings.path, message, line=int(readings.lines[row]), column="id")
    faults.raise_any()


def refuse_two_poses(
    readings: Readings,
    target: str,
    values: Float[np.ndarray, "n 3"],
    groups: Mapping[str, Sequence[int]],
    metres: float = 1e-3,
) -> None:
    """See that the shots of each pose are as near as one pose and one instrument leave them.

    The limit is `RETURN_M` plus `SIGMAS` standard uncertainties: those that the file states, or else those of the default
    `TrackerNoise`, or what the median pose shows up to `COARSEST_M`.

    Args:
        readings: whose rows they are.
        target: whose positions they are, as columns name it.
        values: positions in the unit of the readings; NaN where the target was not seen.
        groups: rows of each pose.
        metres: as of `average_shots`.

    Raises:
        FileError: two shots of a pose are farther apart.
    """
    scale = 1.0 if readings.length_unit_stated else metres
    stated = readings.uncertainty.get(target.casefold(), readings.uncertainty.get(""))
    seen = {name: [row for row in rows if not np.isnan(values[row, 0])] for name, rows in groups.items()}
    several = {name: scale * values[rows] for name, rows in seen.items() if len(rows) > 1}
    if not several:
        return
    own = [np.sqrt(np.sum((p - p.mean(axis=0)) ** 2) / (3 * (len(p) - 1))) for p in several.values()]
    shown_by_shots = min(float(np.median(own)), COARSEST_M) if len(own) >= MIN_REPEATED else 0.0
    faults = Faults()
    for name, points in several.items():
        # the farthest shot from the mean, and the farthest from that
        first = int(np.argmax(np.linalg.norm(points - points.mean(axis=0), axis=1)))
        away = np.linalg.norm(points - points[first], axis=1)
        second = int(np.argmax(away))
        if away[second] <= RETURN_M:
            continue
        if stated is None:
            sigma = max(float(np.sqrt(np.trace(TrackerNoise().covariance(points[first])) / 3)), shown_by_shots)
        else:
            sigma = scale * float(stated[seen[name]].max())
        limit = RETURN_M + SIGMAS * sigma
        if away[second] > limit:
            with faults.collecting():
                raise _two_poses(
                    readings, name, sorted((seen[name][first], seen[name][second])), away[second], limit, sigma
                )
    faults.raise_any()


def _two_poses(
    readings: Readings, name: str, rows: Sequence[int], distance: float, limit: float, sigma: float
) -> FileError:
    lines = [int(readings.lines[row]) for row in rows]
    message = (
        f"pose '{shown(name, 40)}' has shots {distance * 1e3:.1f} mm apart, in lines {lines[0]} and {lines[1]}; one pose has at "
        f"most {limit * 1e3:.1f} mm: {RETURN_M * 1e3:.0f} mm between two returns of a robot (ISO 9283), and {SIGMAS:.0f} standard "
        f"uncertainties of {sigma * 1e3:.3f} mm; give each pose its own id or header, each target its name in a column 'target', "
        "or state the uncertainty (u_mm)"
    )
    return FileError(readings.path, message, line=lines[1])


def _refuse_turned(readings: Readings, groups: Mapping[str, Sequence[int]]) -> None:
    """See that shots of one pose have one orientation, by the convention under which they differ least where it is open.

    Raises:
        FileError: two are turned by more than `TURNED_RAD`.
    """
    turned = [] if readings.rotations is None else [readings.rotations]
    if readings.open_angles is not None:
        turned += readings.open_angles.meanings.values()
    if not turned:
        return
    seen = _seen(readings)
    for name, rows in groups.items():
        kept = [row for row in rows if seen[row]]
        if len(kept) < 2:
            continue
        traces = np.array([np.einsum("ij,nij->n", R[kept[0]], R[kept]) for R in turned])
        angles = np.arccos(np.clip((traces - 1.0) / 2.0, -1.0, 1.0)).min(axis=0)
        if angles.max() > TURNED_RAD:
            first, line = (int(readings.lines[row]) for row in (kept[0], kept[int(np.argmax(angles))]))
            message = (
                f"pose '{shown(name, 40)}' has shots turned by {np.degrees(angles.max()):.1f}°, in lines {first} and {line}; one "
                f"pose has at most {np.degrees(TURNED_RAD):.0f}°; give each pose an id of its own"
            )
            raise FileError(readings.path, message, line=line)


def _seen(readings: Readings) -> Bool[np.ndarray, " n"]:
    """Rows in which a target was seen; all where there are no positions."""
    if not readings.points:
        return np.ones(len(readings), dtype=bool)
    return np.any([~np.isnan(values[:, 0]) for values in readings.points.values()], axis=0)


def mean_of_seen(points: Float[np.ndarray, "shots 3"]) -> Float[np.ndarray, "3"]:
    """Mean of the shots that saw the target; NaN where none did."""
    seen = points[~np.isnan(points[:, 0])]
    return seen.mean(axis=0) if len(seen) else np.full(3, np.nan)


def _scatter(readings: Readings, groups: dict[str, list[int]]) -> float:
    """Pooled standard deviation of shots about their means, per axis, metres."""
    squares, freedom = 0.0, 0
    for values in readings.points.values():
        for rows in groups.values():
            seen = values[rows][~np.isnan(values[rows][:, 0])]
            if len(seen) > 1:
                squares += float(np.sum((seen - seen.mean(axis=0)) ** 2))
                freedom += 3 * (len(seen) - 1)
    return float(np.sqrt(squares / freedom)) if freedom else 0.0
