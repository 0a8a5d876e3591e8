"""Rewriting motions of a path in CSV: their cells, and rows where one motion becomes several."""

import csv
import io
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from robot_programs.core import se3
from robot_programs.core.errors import InputError
from robot_programs.core.program import Move, Target, Waypoint
from robot_programs.core.robot import Robot
from robot_programs.core.source import Edit, Source, numeral, renumbered
from robot_programs.csv_path.table import POSITION, QUATERNION, PathTable

MM, DEGREES, UNITS = 6, 9, 10
"""Decimals written of lengths, of angles, and of quaternions and directions."""


@dataclass(frozen=True, kw_only=True)
class Written:
    """The rows of a motion."""

    row: int
    """Of its end."""
    via: int | None
    """Of the via point, of an arc."""


def rewrite(path_table: PathTable, written: Written, path: Sequence[Waypoint]) -> list[Edit]:
    """Edits that give one motion its waypoints: a row for each, and one more for the via point of an arc."""
    first = written.row if written.via is None else written.via
    ahead = "".join(
        _copied(path_table, row, edits)
        for waypoint in path[:-1]
        for row, edits in _rows_for(path_table, written, waypoint)
    )
    start = path_table.rows[first].start
    out = [Edit(start=start, end=start, text=ahead)] if ahead else []
    if written.via is not None and path[-1].via is None:
        out.append(Edit(start=start, end=path_table.rows[first].next, text=""))
    return out + [edit for _, edits in _rows_for(path_table, written, path[-1]) for edit in edits]


def _copied(path_table: PathTable, row: int, edits: Sequence[Edit]) -> str:
    """A row's line with some of its cells edited."""
    start, end = path_table.rows[row].start, path_table.rows[row].end
    line = replace(path_table.source, text=path_table.source.text[start:end])
    moved = [replace(edit, start=edit.start - start, end=edit.end - start) for edit in edits]
    return line.edited(moved).text + path_table.source.newline


def _rows_for(path_table: PathTable, written: Written, waypoint: Waypoint) -> list[tuple[int, list[Edit]]]:
    """The rows that hold a waypoint, with the edits of their cells."""
    if waypoint.via is None:
        return [(written.row, _edits(path_table, written.row, waypoint, waypoint.kind))]
    if written.via is None:
        raise _lacking(path_table, written.row, "an arc needs a row for the via point")
    return [
        (written.via, _edits(path_table, written.via, waypoint.via, "via")),
        (written.row, _edits(path_table, written.row, waypoint, "circular")),
    ]


def _edits(path_table: PathTable, row: int, waypoint: Waypoint, word: str) -> list[Edit]:
    """Edits of a row's cells that are to hold a waypoint."""
    columns = path_table.columns
    values: dict[str, tuple[float, float, int]] = {}
    if word == "axes":
        if np.isnan(path_table.q[row]).any() or not columns.joints:
            raise _lacking(path_table, row, "the row holds a pose, not joint positions")
        for j, (name, scale) in enumerate(zip(columns.joints, columns.joint_scale, strict=True)):
            decimals = MM if name.lower().endswith("_mm") else DEGREES
            values[name] = path_table.q[row, j] / scale, waypoint.q[j] / scale, decimals
    else:
        if waypoint.T is None or np.isnan(path_table.T[row]).any():
            raise _lacking(path_table, row, "the row holds joint positions, not a pose")
        was, now = path_table.T[row], waypoint.T
        values |= {name: (was[a, 3] * 1e3, now[a, 3] * 1e3, MM) for a, name in enumerate(columns.position)}
        before, after = (_axis(was), _axis(now)) if columns.only_axis else _alike(path_table, row, now)
        values |= {name: (before[a], after[a], UNITS) for a, name in enumerate(columns.rotation)}
    out = [_edit(path_table, row, name, was, now, decimals) for name, (was, now, decimals) in values.items()]
    if word == _word(path_table, row):
        return out
    if "move" not in columns.words:
        raise _lacking(path_table, row, f"without a column 'move' a motion cannot become '{word}'")
    start, end = path_table.cell(row, columns.words["move"])
    return [*out, Edit(start=start, end=end, text=word)]


def _word(path_table: PathTable, row: int) -> str:
    """What a row's column 'move' says, or means where it is empty."""
    return path_table.word(row, "move").lower() if path_table.kind(row) == "circular" else path_table.kind(row)


def _axis(T: np.ndarray) -> np.ndarray:
    return -T[:3, 2]


def _alike(path_table: PathTable, row: int, T: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """The quaternion in the file, of unit length, and that of a pose with its sign."""
    cells = [path_table.rows[row].texts[path_table.table.header.index(name)] for name in path_table.columns.rotation]
    was = np.array([float(cell) for cell in cells])
    now = se3.to_quaternion(T[:3, :3])
    return was / np.linalg.norm(was), now if now @ was >= 0 else -now


def _edit(path_table: PathTable, row: int, column: str, was: float, now: float, decimals: int) -> Edit:
    start, end = path_table.cell(row, column)
    return Edit(start=start, end=end, text=renumbered(path_table.source.text[start:end], was, now, decimals))


def _lacking(path_table: PathTable, row: int, message: str) -> InputError:
    return InputError(f"{path_table.place(row)}: {message}; write the program in another language")


# A new path in CSV of given motions.


def compose_csv_path(name: str, robot: Robot, moves: Sequence[Move], *, notes: Sequence[str] = ()) -> Source:
    """A path of its own, ``name.csv``, a row for each motion and for the via point of each arc.

    Args:
        name: of the file.
        robot: the robot.
        moves: its motions, all with one tool and in one part's frame, which the file does not say.
        notes: names of targets that have none.

    Raises:
        InputError: there are several tools or frames.
    """
    for k, move in enumerate(moves):
        if (
            not (_alike_moves(move.tool.T, moves[0].tool.T) and _alike_moves(move.part.T, moves[0].part.T))
            or move.part_in_hand
        ):
            raise InputError(f"motion {k} has another tool or frame than the first; a path in CSV has one of each")
    posed = any(move.end.T is not None for move in moves)
    jointed = not posed or any(move.end.q is not None for move in moves)
    units = ["mm" if slides else "deg" for slides in robot.prismatic]
    joints = [f"{joint}_{unit}" for joint, unit in zip(robot.joint_names, units, strict=True)] if jointed else []
    pose = [*POSITION, *QUATERNION] if posed else []
    rows: list[list[str]] = []
    for k, move in enumerate(moves):
        targets = [(move.end, move.kind)] if move.via is None else [(move.via, "via"), (move.end, move.kind)]
        for target, word in targets:
            note = target.name or (notes[k] if notes else "")
            speed = "" if move.speed is None else numeral(move.speed * 1e3, MM)
            cells = _pose(target, len(pose)) + _joints(target, robot, len(joints))
            rows.append([note, word, *cells, speed, "yes" if move.stops else "no"])
    text = io.StringIO()
    csv.writer(text, lineterminator="\n").writerows([["name", "move", *pose, *joints, "speed_mm_s", "stop"], *rows])
    return Source(path=Path(f"{name}.csv"), text=text.getvalue(), encoding="utf-8")


def _alike_moves(a: np.ndarray, b: np.ndarray) -> bool:
    return np.allclose(a, b, rtol=0.0, atol=1e-9)


def _pose(target: Target, columns: int) -> list[str]:
    if target.T is None or not columns:
        return [""] * columns
    position = [numeral(float(v), MM) for v in target.T[:3, 3] * 1e3]
    return position + [numeral(float(v), UNITS) for v in se3.to_quaternion(target.T[:3, :3])]


def _joints(target: Target, robot: Robot, columns: int) -> list[str]:
    if target.q is None or not columns:
        return [""] * columns
    shown = np.where(robot.prismatic, target.q * 1e3, np.degrees(target.q))
    decimals = np.where(robot.prismatic, MM, DEGREES)
    return [numeral(float(v), int(d)) for v, d in zip(shown, decimals, strict=True)]
