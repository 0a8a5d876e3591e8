"""Accuracy and repeatability of a pose that was approached several times: ISO 9283:1998, clause 7.2."""

import re
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from itertools import combinations, pairwise
from pathlib import Path
from typing import Any

import numpy as np
from jaxtyping import Float, Int

from taskcal.campaigns.campaign import Campaign
from taskcal.errors import CampaignError, UnknownName
from taskcal.geometry import polyline, se3
from taskcal.short_repr import short_repr
from taskcal.tables.forms import read_csv
from taskcal.tables.table import POSITION, QUATERNION, Table


@short_repr
@dataclass(frozen=True, eq=False, kw_only=True)
class PosePerformance:
    """Performance at one commanded pose, over cycles in one direction of approach."""

    barycentre: Float[np.ndarray, " 3"]
    """Mean of the attained positions, metres."""
    distances: Float[np.ndarray, " cycles"]
    """Distance l of each attained position from the barycentre, metres."""
    offset: Float[np.ndarray, " 3"] | None
    """Barycentre less commanded position (AP_x, AP_y, AP_z), metres; None without a command."""
    orientation: Float[np.ndarray, "3 3"] | None
    """Mean of the attained orientations; None where positions were measured."""
    angles: Float[np.ndarray, "cycles 3"] | None
    """Rotations from the mean orientation to each attained one, about the frame's axes, radians."""
    turn: Float[np.ndarray, " 3"] | None
    """Rotation from the commanded to the mean orientation about the frame's axes, radians; no Euler angles."""

    @property
    def cycles(self) -> int:
        """Number of cycles."""
        return len(self.distances)

    @property
    def accuracy(self) -> float | None:
        """Positioning accuracy AP_p, metres (7.2.1); None without a command."""
        return None if self.offset is None else float(np.linalg.norm(self.offset))

    @property
    def repeatability(self) -> float | None:
        """Positioning repeatability RP_l, metres (7.2.2); None for a single cycle."""
        return float(mean_and_three_deviations(self.distances)) if self.cycles > 1 else None

    @property
    def orientation_repeatability(self) -> Float[np.ndarray, " 3"] | None:
        """Three deviations of each rotation, to be read as ±, radians; the standard's (7.2.2) are of Euler angles."""
        return None if self.angles is None or self.cycles < 2 else 3.0 * self.angles.std(axis=0, ddof=1)

    def summary(self) -> dict[str, float | int]:
        """The figures in millimetres and degrees."""
        out: dict[str, float | int] = {"cycles": self.cycles}
        if self.accuracy is not None and self.offset is not None:
            out["AP_p_mm"] = self.accuracy * 1e3
            out |= {f"AP_{axis}_mm": float(value) * 1e3 for axis, value in zip("xyz", self.offset, strict=True)}
        out |= in_degrees("AP", self.turn)
        if self.repeatability is not None:
            out["RP_l_mm"] = self.repeatability * 1e3
        return out | in_degrees("RP", self.orientation_repeatability)


@short_repr
@dataclass(frozen=True, eq=False, kw_only=True)
class DirectionVariation:
    """Multi-directional pose accuracy variation of one command (7.2.3)."""

    position: float
    """Largest distance between two barycentres (vAP_p), metres."""
    rotation: Float[np.ndarray, " 3"] | None
    """Largest angle between two mean orientations about each axis, radians; None for positions."""

    def summary(self) -> dict[str, float]:
        """The variation in millimetres and degrees."""
        return {"vAP_p_mm": self.position * 1e3} | in_degrees("vAP", self.rotation)


def assess_pose(
    attained: Float[np.ndarray, "cycles 3"],
    commanded: Float[np.ndarray, " 3"] | None = None,
    *,
    rotations: Float[np.ndarray, "cycles 3 3"] | None = None,
    commanded_rotation: Float[np.ndarray, "3 3"] | None = None,
) -> PosePerformance:
    """Accuracy and repeatability of one pose (ISO 9283:1998, 7.2.1 and 7.2.2).

    Instead of the standard's differences of Euler angles a, b, c, orientations are compared by the rotation vector from one to
    the other in the axes of the frame, which depends on no sequence of angles; it is named rx, ry, rz.

    Args:
        attained: measured positions, in the frame of the command, metres.
        commanded: commanded position, metres; without it only the repeatability is known.
        rotations: measured orientations, in the same frame.
        commanded_rotation: commanded orientation.

    Raises:
        CampaignError: there is no cycle, or a measurement is not a number.
    """
    if not len(attained):
        raise CampaignError("a pose needs at least one cycle")
    if not np.isfinite(attained).all():
        cycle = int(np.flatnonzero(~np.isfinite(attained).all(axis=1))[0])
        raise CampaignError(f"the position measured in cycle {cycle} is not a number; leave the cycle out")
    barycentre = attained.mean(axis=0)
    orientation = angles = turn = None
    if rotations is not None:
        orientation, angles = mean_orientation(rotations)
        turn = None if commanded_rotation is None else se3.log(orientation @ commanded_rotation.T)
    return PosePerformance(
        barycentre=barycentre,
        distances=np.linalg.norm(attained - barycentre, axis=1),
        offset=None if commanded is None else barycentre - commanded,
        orientation=orientation,
        angles=angles,
        turn=turn,
    )


def compare_directions(poses: Sequence[PosePerformance]) -> DirectionVariation:
    """Multi-directional pose accuracy variation (ISO 9283:1998, 7.2.3).

    Args:
        poses: one commanded pose, approached from two or more directions.

    Raises:
        CampaignError: there is only one direction.
    """
    if len(poses) < 2:
        raise CampaignError(f"directions of approach are compared with each other; {len(poses)} is too few, give two")
    position = max(float(np.linalg.norm(h.barycentre - k.barycentre)) for h, k in combinations(poses, 2))
    orientations = [pose.orientation for pose in poses if pose.orientation is not None]
    rotation = None
    if len(orientations) == len(poses):
        pairs = [np.abs(se3.log(h @ k.T)) for h, k in combinations(orientations, 2)]
        rotation = np.max(pairs, axis=0)
    return DirectionVariation(position=position, rotation=rotation)


def mean_and_three_deviations(distances: Float[np.ndarray, "cycles ..."]) -> Float[np.ndarray, "..."]:
    """The radius l̄ + 3 S_l of clauses 7.2.2 and 8.3, over the first axis."""
    return np.asarray(distances.mean(axis=0) + 3.0 * distances.std(axis=0, ddof=1))


def mean_orientation(
    rotations: Float[np.ndarray, "cycles *b 3 3"],
) -> tuple[Float[np.ndarray, "*b 3 3"], Float[np.ndarray, "cycles *b 3"]]:
    """The rotation nearest to the mean of the matrices, and the rotation vectors from it to each, radians."""
    mean = se3.nearest_rotation(rotations.mean(axis=0))
    return mean, se3.log(rotations @ np.swapaxes(mean, -1, -2))


def in_degrees(symbol: str, angles: Float[np.ndarray, " 3"] | None) -> dict[str, float]:
    """Rotations about x, y, z for a summary, degrees; nothing where they are not known.

    They are called rx, ry, rz and not a, b, c: those of the standard are differences of Euler angles.
    """
    if angles is None:
        return {}
    return {
        f"{symbol}_{axis}_deg": float(np.degrees(value)) for axis, value in zip(("rx", "ry", "rz"), angles, strict=True)
    }


# Reading measured cycles from CSV: poses approached, or paths passed, again and again.

_POINT = "x_mm y_mm z_mm, qx qy qz qw"
_COMMAND = "command_x_mm …, command_qx …"
_COMMANDED = "command_"


@short_repr
@dataclass(frozen=True, eq=False, kw_only=True)
class PoseCycles:
    """One commanded pose, approached from one direction again and again."""

    pose: str
    """Its name."""
    direction: str
    """Name of the direction of approach; empty where the file names none."""
    cycles: tuple[str, ...]
    """Name of every cycle."""
    attained: Float[np.ndarray, "cycles 3"]
    """Measured positions, in the frame of the command, metres."""
    rotations: Float[np.ndarray, "cycles 3 3"] | None
    """Measured orientations; None for positions."""
    commanded: Float[np.ndarray, " 3"] | None
    """Commanded position, metres; None where the file has none."""
    commanded_rotation: Float[np.ndarray, "3 3"] | None
    """Commanded orientation."""


@short_repr
@dataclass(frozen=True, eq=False, kw_only=True)
class PathCycles:
    """A commanded path, and passes along it."""

    sections: tuple[str, ...]
    """Name of every commanded point, in order."""
    commanded: Float[np.ndarray, "points 3"]
    """Commanded points, metres."""
    commanded_rotations: Float[np.ndarray, "points 3 3"] | None
    """Commanded orientations."""
    cycles: tuple[str, ...]
    """Name of every pass."""
    attained: tuple[Float[np.ndarray, "_ 3"], ...]
    """Samples of each pass in order, in the frame of the command, metres."""
    rotations: tuple[Float[np.ndarray, "_ 3 3"], ...] | None
    """Measured orientations; None for positions."""


def read_pose_cycles(path: str | Path) -> tuple[PoseCycles, ...]:
    """Read poses measured in cycles.

    Columns: ``pose``, ``cycle``, optionally ``direction``; measured ``x_mm y_mm z_mm``, optionally ``qx qy qz qw``; the
    command as ``command_x_mm …`` and ``command_qx …``, the same in all rows of a pose. Letter case does not matter.

    Args:
        path: the CSV.

    Returns:
        one entry for each pose and direction, in the file's order.

    Raises:
        FileError: with file, line, column and remedy, for anything that cannot be read as such.
    """
    columns = _columns(path)
    if "section" in columns and "pose" not in columns:
        raise columns.header_error(
            "has 'section' in place of 'pose': it holds passes along a path; read it as such (--path)"
        )
    poses, cycles = _names(columns, "pose"), _names(columns, "cycle")
    directions = _names(columns, "direction") if "direction" in columns else [""] * len(poses)
    attained, rotations = columns.points(), _rotations(columns)
    commanded = columns.points(_COMMANDED) if columns.together([_COMMANDED + name for name in POSITION]) else None
    commanded_rotations = _rotations(columns, _COMMANDED)
    columns.refuse_unused(f"it may have pose, cycle, direction, {_POINT}, {_COMMAND}")
    commands = _commands(columns)
    first_of_pose: dict[str, int] = {}
    groups: dict[tuple[str, str], dict[str, int]] = {}
    for row, (pose, direction, cycle) in enumerate(zip(poses, directions, cycles, strict=True)):
        _check_same_command(columns, commands, row, first_of_pose.setdefault(pose, row), f"pose '{pose}'")
        group = groups.setdefault((pose, direction), {})
        if cycle in group:
            where = f"pose '{pose}'" + (f" from direction '{direction}'" if direction else "")
            message = (
                f"cycle '{cycle}' of {where} is in line {columns.lines[group[cycle]]} already; give each its own name"
            )
            raise columns.error(message, row, "cycle")
        group[cycle] = row
    for (pose, _), group in groups.items():
        rows = list(group.values())
        at = np.median(attained[rows], axis=0) if commanded is None else commanded[rows[0]]
        _refuse_lost(columns, attained, rows, at[None], f"where pose '{pose}' is")
    out: list[PoseCycles] = []
    for (pose, direction), group in groups.items():
        rows = list(group.values())
        out.append(
            PoseCycles(
                pose=pose,
                direction=direction,
                cycles=tuple(group),
                attained=attained[rows],
                rotations=None if rotations is None else rotations[rows],
                commanded=None if commanded is None else commanded[rows[0]],
                commanded_rotation=None if commanded_rotations is None else commanded_rotations[rows[0]],
            )
        )
    return tuple(out)


def read_path_cycles(path: str | Path, commanded: str | Path | None = None) -> PathCycles:
    """Read passes along a path.

    Columns: ``cycle``; measured ``x_mm y_mm z_mm``, optionally ``qx qy qz qw``; rows of a pass in its order. The commanded
    path is in the same file, as ``section`` and ``command_x_mm …`` (``command_qx …``), the same in all rows of a section;
    or it is a file of its own with ``x_mm y_mm z_mm`` (``qx qy qz qw``), and samples may lie anywhere along it.

    Args:
        path: the CSV of the passes.
        commanded: the CSV of the commanded path, where it is a file of its own.

    Raises:
        FileError: with file, line, column and remedy, for anything that cannot be read as such.
    """
    columns = _columns(path)
    cycles = _names(columns, "cycle")
    passes: dict[str, list[int]] = {}
    for row, cycle in enumerate(cycles):
        passes.setdefault(cycle, []).append(row)
    attained, rotations = columns.points(), _rotations(columns)
    if commanded is None:
        names, path_points, path_rotations = _sections(columns, passes)
    else:
        columns.refuse_unused(f"it may have cycle, {_POINT}")
        own = _columns(commanded)
        path_points, path_rotations = own.points(), _rotations(own)
        own.refuse_unused(f"it may have {_POINT}")
        names = tuple(str(number) for number in range(len(path_points)))
    lonely = [rows[0] for rows in passes.values() if len(rows) < 2]
    if lonely:
        message = f"pass '{cycles[lonely[0]]}' has one row; a pass needs two or more"
        raise columns.error(message, lonely[0], "cycle")
    _refuse_lost(columns, attained, range(len(attained)), path_points, "the path")
    return PathCycles(
        sections=names,
        commanded=path_points,
        commanded_rotations=path_rotations,
        cycles=tuple(passes),
        attained=tuple(attained[rows] for rows in passes.values()),
        rotations=None if rotations is None else tuple(rotations[rows] for rows in passes.values()),
    )


def _sections(
    columns: Table, passes: dict[str, list[int]]
) -> tuple[tuple[str, ...], Float[np.ndarray, "points 3"], Float[np.ndarray, "points 3 3"] | None]:
    """The commanded path that the rows of the first pass say, after a look at all others."""
    if "section" not in columns:
        message = "has no column 'section'; give it and command_x_mm, command_y_mm, command_z_mm, or the path as a file of its own"
        raise columns.header_error(f"{message} (--command)")
    sections, commanded = _names(columns, "section"), columns.points(_COMMANDED)
    rotations = _rotations(columns, _COMMANDED)
    columns.refuse_unused(f"it may have section, cycle, {_POINT}, {_COMMAND}")
    commands = _commands(columns)
    first_pass, *_ = passes.values()
    place = {sections[row]: row for row in first_pass}
    for cycle, rows in passes.items():
        row_of_section: dict[str, int] = {}
        for row in rows:
            name = sections[row]
            if name in row_of_section:
                line = columns.lines[row_of_section[name]]
                message = f"section '{name}' of pass '{cycle}' is in line {line} already; give each its own name"
                raise columns.error(message, row, "section")
            if name not in place:
                message = f"the first pass has no section '{name}'; it says the path, so it must have all"
                raise columns.error(message, row, "section")
            row_of_section[name] = row
            _check_same_command(columns, commands, row, place[name], f"section '{name}'")
    rows = list(place.values())
    return tuple(place), commanded[rows], None if rotations is None else rotations[rows]


def _columns(path: str | Path) -> Table:
    columns = read_csv(path)
    if not len(columns):
        raise columns.error("has no measurements below its header")
    return columns


def _names(columns: Table, column: str) -> list[str]:
    """Names in a column, none of them empty."""
    names = columns.texts(column)
    if "" in names:
        raise columns.error(f"the cell is empty; name the {column}", names.index(""), column)
    return names


LOST_FROM_M = 1e-3
"""Distance from where a point is commanded or measured else, metres, from which on zeros and nines are no measurement."""


def _refuse_lost(
    columns: Table,
    attained: Float[np.ndarray, "rows 3"],
    rows: Iterable[int],
    near: Float[np.ndarray, "points 3"],
    others: str,
) -> None:
    """See that no row has what instruments write in place of a point that they did not see.

    Raises:
        FileError: three zeros, or the same nines, far from all points where it may be, and from between two of a path.
    """
    between = float(np.linalg.norm(np.diff(near, axis=0), axis=1).max(initial=0.0))
    for row in rows:
        x, y, z = (f"{abs(value):g}" for value in np.round(attained[row] * 1e3, 6))
        if not (x == y == z and (x == "0" or _NINES.fullmatch(x))):
            continue
        off = float(np.linalg.norm(near - attained[row], axis=1).min())
        if off > LOST_FROM_M + between:
            message = (
                f"{x} in all three coordinates, {off * 1e3:.0f} mm from {others}, is no measurement but a lost beam: leave out the "
                "row, or measure it again"
            )
            raise columns.error(message, row, POSITION[0])


_NINES = re.compile(r"9{4,}(?:\.9*)?")
"""What an instrument writes for a point that it did not see."""


def _rotations(columns: Table, prefix: str = "") -> Float[np.ndarray, "rows 3 3"] | None:
    if not columns.together([prefix + name for name in QUATERNION]):
        return None
    return se3.from_quaternion(columns.quaternions([prefix + name for name in QUATERNION]))


def _commands(columns: Table) -> dict[str, Float[np.ndarray, " rows"]]:
    """The numbers of the command, by their columns."""
    return {name: columns.numbers(name) for name in columns.header if name.lower().startswith(_COMMANDED)}


def _check_same_command(
    columns: Table, commands: Mapping[str, Float[np.ndarray, " rows"]], row: int, first: int, what: str
) -> None:
    """See that two rows have one command.

    Raises:
        FileError: a cell of the first row says another.
    """
    for name, numbers in commands.items():
        if numbers[row] != numbers[first]:
            other = f"{numbers[first]:g} in line {columns.lines[first]}"
            message = f"{numbers[row]:g} is another command for {what} than {other}; give one command"
            raise columns.error(message, row, name)


# Accuracy and repeatability of the distance between two poses: ISO 9283:1998, clause 7.3.


@short_repr
@dataclass(frozen=True, eq=False, kw_only=True)
class DistancePerformance:
    """Performance of the distance between two commanded positions."""

    attained: Float[np.ndarray, " cycles"]
    """Attained distance D of each cycle, metres."""
    components: Float[np.ndarray, "cycles 3"]
    """Attained distances along the frame's axes, not negative, metres."""
    commanded: Float[np.ndarray, " 3"]
    """Commanded distances along the axes, not negative, metres."""

    @property
    def cycles(self) -> int:
        """Number of cycles in which both positions were measured."""
        return len(self.attained)

    @property
    def accuracy(self) -> float:
        """Distance accuracy AD_p: mean attained less commanded distance, metres (7.3.2)."""
        return float(self.attained.mean() - np.linalg.norm(self.commanded))

    @property
    def offset(self) -> Float[np.ndarray, " 3"]:
        """Distance accuracy along the axes AD_x, AD_y, AD_z, metres (7.3.2)."""
        return self.components.mean(axis=0) - self.commanded

    @property
    def repeatability(self) -> float | None:
        """Distance repeatability RD, which is to be read as ±, metres (7.3.3); None for a single cycle."""
        return float(3.0 * self.attained.std(ddof=1)) if self.cycles > 1 else None

    @property
    def axis_repeatability(self) -> Float[np.ndarray, " 3"] | None:
        """Distance repeatability along the axes RD_x, RD_y, RD_z, ±, metres (7.3.3)."""
        return 3.0 * self.components.std(axis=0, ddof=1) if self.cycles > 1 else None

    def summary(self) -> dict[str, float | int]:
        """The figures in millimetres."""
        out: dict[str, float | int] = {"cycles": self.cycles, "AD_p_mm": self.accuracy * 1e3}
        out |= {f"AD_{axis}_mm": float(value) * 1e3 for axis, value in zip("xyz", self.offset, strict=True)}
        if self.repeatability is not None and self.axis_repeatability is not None:
            out["RD_p_mm"] = self.repeatability * 1e3
            repeatabilities = zip("xyz", self.axis_repeatability, strict=True)
            out |= {f"RD_{axis}_mm": float(value) * 1e3 for axis, value in repeatabilities}
        return out


def assess_distance(
    first: Float[np.ndarray, "cycles 3"],
    second: Float[np.ndarray, "cycles 3"],
    commanded_first: Float[np.ndarray, " 3"],
    commanded_second: Float[np.ndarray, " 3"],
) -> DistancePerformance:
    """Accuracy and repeatability of the distance between two positions (ISO 9283:1998, 7.3.2 and 7.3.3).

    It needs no common frame of measurements and commands, but for the components along the axes.

    Args:
        first: measured first positions, a row for each cycle, metres.
        second: measured second positions, of the same cycles, metres.
        commanded_first: commanded first position, metres.
        commanded_second: commanded second position, metres.

    Raises:
        CampaignError: there is no cycle.
    """
    if not len(first):
        raise CampaignError("a distance needs at least one cycle in which both positions were measured")
    apart = first - second
    return DistancePerformance(
        attained=np.linalg.norm(apart, axis=1),
        components=np.abs(apart),
        commanded=np.abs(commanded_first - commanded_second),
    )


# Everything that ISO 9283:1998, clauses 7.2 and 7.3, says of a set of poses measured in cycles.


@short_repr
@dataclass(frozen=True, eq=False, kw_only=True)
class CyclePerformance:
    """Poses, directions of approach, and distances."""

    poses: Mapping[tuple[str, str], PosePerformance]
    """By pose and direction of approach."""
    directions: Mapping[str, DirectionVariation]
    """By pose, for those approached from several directions."""
    distances: Mapping[tuple[str, str, str], DistancePerformance]
    """By first pose, second pose and direction of approach."""

    def summary(self) -> dict[str, list[dict[str, Any]]]:
        """All of it in millimetres and degrees; a direction is named where there is one."""
        return {
            "poses": [
                {"pose": pose, **_direction(direction), **of_pair.summary()}
                for (pose, direction), of_pair in self.poses.items()
            ],
            "directions": [{"pose": pose, **of_pair.summary()} for pose, of_pair in self.directions.items()],
            "distances": [
                {"from": first, "to": second, **_direction(direction), **of_pair.summary()}
                for (first, second, direction), of_pair in self.distances.items()
            ],
        }


def assess_cycles(cycles: Sequence[PoseCycles], distances: Iterable[tuple[str, str]] | None = None) -> CyclePerformance:
    """Accuracy and repeatability of poses and of distances between them, and what the direction of approach changes.

    A distance is taken in the cycles that two poses have in common, for each direction that both were approached from.

    Args:
        cycles: the poses, as `read_pose_cycles` returns them.
        distances: pairs of poses; by default each pose and the next, as far as they have commands and common cycles.

    Raises:
        CampaignError: a distance that was asked for has no commands or no cycles in common.
        UnknownName: a pose that was asked for is not there.
    """
    poses = {
        (one.pose, one.direction): assess_pose(
            one.attained, one.commanded, rotations=one.rotations, commanded_rotation=one.commanded_rotation
        )
        for one in cycles
    }
    names = list(dict.fromkeys(one.pose for one in cycles))
    by_pose = {name: [performance for (pose, _), performance in poses.items() if pose == name] for name in names}
    between: dict[tuple[str, str, str], DistancePerformance] = {}
    for first, second in pairwise(names) if distances is None else distances:
        for name in (first, second):
            if name not in names:
                raise UnknownName("pose", name, names)
        of_pair = _between(cycles, first, second)
        if distances is not None and not of_pair:
            raise CampaignError(
                f"poses '{first}' and '{second}' have no distance: it needs both commands (command_x_mm …), and cycles that "
                "were measured at both, from the same direction"
            )
        between |= of_pair
    return CyclePerformance(
        poses=poses,
        directions={name: compare_directions(several) for name, several in by_pose.items() if len(several) > 1},
        distances=between,
    )


def _between(cycles: Sequence[PoseCycles], first: str, second: str) -> dict[tuple[str, str, str], DistancePerformance]:
    """The distance of two poses for each direction that they have in common."""
    out: dict[tuple[str, str, str], DistancePerformance] = {}
    ends = [(a, b) for a in cycles if a.pose == first for b in cycles if b.pose == second]
    for a, b in ends:
        common = [name for name in a.cycles if name in b.cycles]
        if a.direction == b.direction and common and a.commanded is not None and b.commanded is not None:
            out[first, second, a.direction] = assess_distance(
                a.attained[[a.cycles.index(name) for name in common]],
                b.attained[[b.cycles.index(name) for name in common]],
                a.commanded,
                b.commanded,
            )
    return out


def _direction(name: str) -> dict[str, str]:
    return {"direction": name} if name else {}


# Accuracy and repeatability of a path that was passed once or several times: ISO 9283:1998, clauses 8.2 and 8.3.

_CORNER = 2.0
"""In a plane that halves a corner of 60° or more, a path crosses at most so many times its distance away."""

_ROUNDING = 1e-9
"""Metres that an exact pass may seem to leave its path by."""


@short_repr
@dataclass(frozen=True, eq=False, kw_only=True)
class PathPerformance:
    """Performance along a commanded path, in planes normal to it at its points."""

    sections: Int[np.ndarray, " sections"]
    """Which points of the commanded path were evaluated: those whose normal plane every pass crosses."""
    left_out: Int[np.ndarray, " others"]
    """The other points."""
    offsets: Float[np.ndarray, "passes sections 3"]
    """Where each pass crosses the normal plane, less the commanded point, metres."""
    angles: Float[np.ndarray, "passes sections 3"] | None
    """Rotations from the mean attained orientation there to each pass's, about the frame's axes, radians."""
    turn: Float[np.ndarray, "sections 3"] | None
    """Rotation from the commanded to the mean attained orientation, about the frame's axes, radians."""
    deviations: Float[np.ndarray, " samples"]
    """Distance of every sample of all passes from the nearest point of the commanded path, metres."""

    @property
    def cycles(self) -> int:
        """Number of passes."""
        return len(self.offsets)

    @property
    def accuracy_along(self) -> Float[np.ndarray, " sections"]:
        """Distance of the mean of the passes from each commanded point, metres."""
        return np.linalg.norm(self.offsets.mean(axis=0), axis=1)

    @property
    def accuracy(self) -> float:
        """Positioning path accuracy AT_p: the largest of `accuracy_along`, metres (8.2)."""
        return float(self.accuracy_along.max())

    @property
    def orientation_accuracy(self) -> Float[np.ndarray, " 3"] | None:
        """Orientation path accuracy AT_a, AT_b, AT_c, radians (8.2); None where orientations are not known."""
        return None if self.turn is None else np.abs(self.turn).max(axis=0)

    @property
    def repeatability_along(self) -> Float[np.ndarray, " sections"] | None:
        """Repeatability of the passes at each commanded point, metres; None for a single pass."""
        if self.cycles < 2:
            return None
        return mean_and_three_deviations(np.linalg.norm(self.offsets - self.offsets.mean(axis=0), axis=-1))

    @property
    def repeatability(self) -> float | None:
        """Positioning path repeatability RT_p: the largest of `repeatability_along`, metres (8.3)."""
        along = self.repeatability_along
        return None if along is None else float(along.max())

    @property
    def orientation_repeatability(self) -> Float[np.ndarray, " 3"] | None:
        """Orientation path repeatability RT_a, RT_b, RT_c, which is to be read as ±, radians (8.3)."""
        if self.angles is None or self.cycles < 2:
            return None
        return 3.0 * self.angles.std(axis=0, ddof=1).max(axis=0)

    @property
    def maximum(self) -> float:
        """Largest distance of a sample from the path, metres."""
        return float(self.deviations.max())

    @property
    def rms(self) -> float:
        """Root mean square distance of the samples from the path, metres."""
        return float(np.sqrt(np.mean(self.deviations**2)))

    def summary(self) -> dict[str, float | int]:
        """The figures in millimetres and degrees."""
        out: dict[str, float | int] = {"cycles": self.cycles, "sections": len(self.sections)}
        out["AT_p_mm"] = self.accuracy * 1e3
        out |= in_degrees("AT", self.orientation_accuracy)
        if self.repeatability is not None:
            out["RT_p_mm"] = self.repeatability * 1e3
        out |= in_degrees("RT", self.orientation_repeatability)
        return out | {"max_mm": self.maximum * 1e3, "rms_mm": self.rms * 1e3}


def assess_path(
    commanded: Float[np.ndarray, "points 3"],
    attained: Float[np.ndarray, "passes samples 3"] | Sequence[Float[np.ndarray, "_ 3"]],
    *,
    commanded_rotations: Float[np.ndarray, "points 3 3"] | None = None,
    rotations: Float[np.ndarray, "passes samples 3 3"] | Sequence[Float[np.ndarray, "_ 3 3"]] | None = None,
) -> PathPerformance:
    """Accuracy and repeatability of a path (ISO 9283:1998, 8.2 and 8.3), and how far its samples lie off.

    Samples may lie anywhere along the path: between them a pass is taken to be straight. At every commanded point it is cut
    with the plane normal to the path. Where it begins or ends a little short of such a plane, by no more than it lies off
    elsewhere, it is carried on along the path. Samples beyond an end of the path do not count as deviations.

    Args:
        commanded: points of the commanded path in order, which are the sections, metres. The path is straight between
            them; repeat the first at the end for a closed path.
        attained: samples of each pass in order, in the same frame, metres; one pass gives no repeatability.
        commanded_rotations: commanded orientation at each point.
        rotations: attained orientation at each sample.

    Raises:
        CampaignError: there is no path or no pass, a number is not finite, two neighbouring points are the same, the path
            turns back on itself, a pass runs against it, or no section is crossed by every pass.
    """
    passes = list(attained)
    _check(commanded, passes)
    tangents = polyline.tangents(commanded)
    if (back := np.flatnonzero(~tangents.any(axis=1))).size:
        raise CampaignError(f"the commanded path turns back on itself at point {back[0]}; give the parts one by one")
    crossings_by_pass: list[polyline.Crossings] = []
    deviations: list[np.ndarray] = []
    for number, samples in enumerate(passes):
        away, off = polyline.distances(samples, commanded)
        if off.all():
            raise CampaignError(f"pass {number} lies beyond the ends of the commanded path; are both in one frame?")
        deviations.append(away[~off])
        between, beyond = polyline.distances(0.5 * (samples[:-1] + samples[1:]), commanded)
        farthest = max(float(away[~off].max()), float(between[~beyond].max(initial=0.0)))
        within = _CORNER * farthest + _ROUNDING
        ends = [samples[0] - within * tangents[0], samples[-1] + within * tangents[-1]]
        carried_on = np.vstack([ends[:1], samples, ends[1:]])
        crossings = polyline.cross_planes(carried_on, commanded, tangents, within)
        if not ((crossings.segments > 0) & (crossings.segments < len(samples))).any():
            raise CampaignError(f"pass {number} crosses no plane normal to the path; does it run in the path's sense?")
        crossings_by_pass.append(crossings)
    crossed = np.bincount(np.concatenate([c.planes for c in crossings_by_pass]), minlength=len(commanded))
    sections = np.flatnonzero(crossed == len(passes))
    if not len(sections):
        raise CampaignError("no plane normal to the commanded path is crossed by every pass; give passes of one path")
    chosen = [np.searchsorted(c.planes, sections) for c in crossings_by_pass]
    points = np.stack([c.points[rows] for c, rows in zip(crossings_by_pass, chosen, strict=True)])
    angles = turn = None
    if rotations is not None and commanded_rotations is not None:
        turned = [_turned(R, c, rows) for R, c, rows in zip(rotations, crossings_by_pass, chosen, strict=True)]
        mean, angles = mean_orientation(np.stack(turned))
        turn = se3.log(mean @ np.swapaxes(commanded_rotations[sections], 1, 2))
    return PathPerformance(
        sections=sections,
        left_out=np.flatnonzero(crossed < len(passes)),
        offsets=points - commanded[sections],
        angles=angles,
        turn=turn,
        deviations=np.concatenate(deviations),
    )


def _check(commanded: Float[np.ndarray, "points 3"], passes: Sequence[Float[np.ndarray, "_ 3"]]) -> None:
    if len(commanded) < 2:
        raise CampaignError(f"a commanded path needs two points or more, not {len(commanded)}")
    if not passes:
        raise CampaignError("there is no pass along the path")
    if not np.isfinite(commanded).all():
        raise CampaignError("a point of the commanded path is not a number")
    same = np.flatnonzero((np.diff(commanded, axis=0) == 0.0).all(axis=1))
    if len(same):
        raise CampaignError(f"points {same[0]} and {same[0] + 1} of the commanded path are the same; leave one out")
    for number, samples in enumerate(passes):
        if len(samples) < 2:
            raise CampaignError(f"pass {number} has {len(samples)} samples; it needs two or more")
        if not np.isfinite(samples).all():
            raise CampaignError(f"a sample of pass {number} is not a number; leave it out")


def _turned(
    rotations: Float[np.ndarray, "samples 3 3"], crossings: polyline.Crossings, rows: Int[np.ndarray, " sections"]
) -> Float[np.ndarray, "sections 3 3"]:
    """Orientations of a pass at its crossings, turning evenly between samples."""
    last = len(rotations) - 1
    after = crossings.segments[rows]  # one more than the number of the sample before, as the pass was carried on
    before, after = rotations[np.clip(after - 1, 0, last)], rotations[np.clip(after, 0, last)]
    step = se3.log(np.swapaxes(before, 1, 2) @ after)
    return before @ se3.exp(crossings.fractions[rows, None] * step)


# Repeatability from a campaign that measured some poses more than once.

SAME_POSE_RAD = float(np.radians(0.01))
"""Joint positions within this of each other are one pose, radians."""

NORMAL_REPEATABILITY = float(2.0 * np.sqrt(2.0 / np.pi) + 3.0 * np.sqrt(3.0 - 8.0 / np.pi))
"""RP_l of many cycles over the standard deviation of each coordinate, where the noise is normal and the same in all
directions: mean and three standard deviations of the Maxwell distribution, 3.616."""


@short_repr
@dataclass(frozen=True, eq=False, kw_only=True)
class RepeatedPoses:
    """The poses of a campaign that were measured more than once."""

    rows: tuple[tuple[int, ...], ...]
    """Rows of the campaign that each pose was measured in."""
    performances: tuple[tuple[PosePerformance, ...], ...]
    """For each pose, the repeatability of every target that was seen there more than once."""
    joint_spread: Float[np.ndarray, " poses"]
    """Largest difference of a joint between the rows of a pose, radians."""

    def __len__(self) -> int:
        return len(self.rows)

    @property
    def repeatability(self) -> Float[np.ndarray, " poses"]:
        """RP_l of each pose, mean of its targets, metres (ISO 9283:1998, 7.2.2)."""
        return np.array(
            [np.mean([mean_and_three_deviations(target.distances) for target in pose]) for pose in self.performances]
        )

    @property
    def deviation(self) -> float:
        """Standard deviation of a coordinate about its pose's mean, of all poses and targets together, metres."""
        every = [target for pose in self.performances for target in pose]
        squares = sum(float(np.sum(target.distances**2)) for target in every)
        return float(np.sqrt(squares / (3 * sum(target.cycles - 1 for target in every))))

    @property
    def expected_repeatability(self) -> float:
        """RP_l that many cycles would show if each coordinate were normal with `deviation`, metres.

        A pose of few cycles shows less: with two, RP_l is half their distance.
        """
        return NORMAL_REPEATABILITY * self.deviation

    def summary(self) -> dict[str, float | int]:
        """The repeatability in millimetres and degrees."""
        values = self.repeatability * 1e3
        return {
            "poses": len(self),
            "rows": sum(len(rows) for rows in self.rows),
            "RP_l_mean_mm": float(values.mean()),
            "RP_l_median_mm": float(np.median(values)),
            "RP_l_max_mm": float(values.max()),
            "deviation_mm": self.deviation * 1e3,
            "expected_RP_l_mm": self.expected_repeatability * 1e3,
            "joint_spread_deg": float(np.degrees(self.joint_spread.max())),
        }


def group_postures(q: Float[np.ndarray, "n joints"], same: float) -> Int[np.ndarray, " n"]:
    """The posture of every row, counted from 0: rows that differ by `same` at most in every joint, and chains of such rows.

    Args:
        q: joint positions, radians (metres where a joint slides).
        same: in the same units.
    """
    from scipy.sparse import coo_array
    from scipy.sparse.csgraph import connected_components
    from scipy.spatial import KDTree

    pairs = KDTree(q).query_pairs(same, p=np.inf, output_type="ndarray")
    graph = coo_array((np.ones(len(pairs)), (pairs[:, 0], pairs[:, 1])), shape=(len(q), len(q)))
    return connected_components(graph, directed=False)[1]


def pose_repeatability(campaign: Campaign, *, same: float = SAME_POSE_RAD) -> RepeatedPoses:
    """Repeatability at the poses that a campaign measured more than once (ISO 9283:1998, 7.2.2).

    It contains the tracker's noise, and what the recorded joints of a pose differ by.

    Args:
        campaign: measurements; points or poses.
        same: rows belong to one pose if no joint differs by more, radians (metres where a joint slides).

    Raises:
        CampaignError: no pose was measured twice.
    """
    label = group_postures(campaign.q, same)
    if campaign.stations is not None:  # how stations lie to each other is known from the nominal robot alone
        label = np.unique(np.stack([label, campaign.stations.of]), axis=1, return_inverse=True)[1].reshape(-1)
    rows: list[tuple[int, ...]] = []
    performances: list[tuple[PosePerformance, ...]] = []
    joint_ranges: list[float] = []
    for pose in np.flatnonzero(np.bincount(label) > 1):
        chosen = np.flatnonzero(label == pose)
        targets = tuple(
            _of_target(campaign, seen, t)
            for t in range(len(campaign.targets))
            if len(seen := chosen[campaign.valid[chosen, t]]) > 1
        )
        if targets:
            rows.append(tuple(int(row) for row in chosen))
            performances.append(targets)
            joint_ranges.append(float(np.ptp(campaign.q[chosen], axis=0).max()))
    if not rows:
        raise CampaignError(
            f"no two of the {len(campaign)} rows measured one pose, with joints within {np.degrees(same):g}°; "
            "repeatability needs poses that recur"
        )
    return RepeatedPoses(rows=tuple(rows), performances=tuple(performances), joint_spread=np.array(joint_ranges))


def _of_target(campaign: Campaign, rows: np.ndarray, target: int) -> PosePerformance:
    rotations = None if campaign.rotations is None else campaign.rotations[rows]
    return assess_pose(campaign.points[rows, target], rotations=rotations)
