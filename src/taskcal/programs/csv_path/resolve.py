"""What the rows of a path table mean: motions, with their tools and frames."""

import numpy as np

from taskcal.programs.csv_path.path_table import PathTable
from taskcal.programs.program import Frame, Move, Target

_YES, _NO = ("1", "yes", "true"), ("", "0", "no", "false")


def unknown_frame(path_table: PathTable, row: int, tool: Frame, part: Frame) -> str:
    """Why a row's tool or frame is not known; empty where both are."""
    for meaning, frame in (("tool", tool), ("frame", part)):
        name = path_table.word(row, meaning)
        if name and name != frame.name:
            return f"{meaning} '{name}' is not known; only '{frame.name}' was given, so the motion stays as it is"
    return ""


def resolve_move(
    path_table: PathTable, row: int, via: int | None, tool: Frame, part: Frame, before: int | None
) -> Move:
    """The motion of which a row holds the end.

    Raises:
        FileError: an arc has no via point, or another motion has one; or whether it stops is not said by yes or no.
    """
    kind = path_table.kind(row)
    if (kind == "circular") != (via is not None):
        message = "a row 'via' with the via point must stand before the end of an arc, and 'circular' at its end"
        raise path_table.error(message, row, "move")
    return Move(
        kind=kind,
        end=_target(path_table, row),
        via=None if via is None else _target(path_table, via),
        tool=tool,
        part=part,
        part_in_hand=False,
        speed=None if np.isnan(path_table.speed[row]) else float(path_table.speed[row]),
        stops=_stops(path_table, row),
        follows=before,
        routine=path_table.source.path.stem,
        place=path_table.place(row),
    )


def _target(path_table: PathTable, row: int) -> Target:
    posed = not np.isnan(path_table.T[row]).any()
    return Target(
        name=path_table.word(row, "name") or path_table.word(row, "id"),
        T=path_table.T[row] if posed else None,
        q=None if posed else path_table.q[row],
        posture=None,
        place=path_table.place(row),
        free_spin=posed and path_table.columns.only_axis,
    )


def _stops(path_table: PathTable, row: int) -> bool:
    word = path_table.word(row, "stop").lower()
    if word not in _YES + _NO:
        raise path_table.error(f"'{word}' is neither yes nor no", row, path_table.columns.words["stop"])
    return word in _YES
