"""What was measured, durable before the robot moves on: an ordinary campaign, and beside it what must be known to go on."""

import csv
import json
import math
import os
import tempfile
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import IO, Any, Literal, get_args

import numpy as np
from jaxtyping import Float, Int

from taskcal.campaigns.campaign import Campaign
from taskcal.errors import FileError, TaskcalError, shown
from taskcal.io.files import take_lock
from taskcal.io.json_file import SEAL, chained, digest_of, unchain
from taskcal.live.lines import KindColumns
from taskcal.observations.base import Measured, written
from taskcal.observations.instrument import Instrument
from taskcal.observations.point import Tracker
from taskcal.reading.options import ReadOptions
from taskcal.reading.pictures import NO_CORNERS, Corners, join_corners, read_corners
from taskcal.reading.reader import read_campaign
from taskcal.reading.writer import corners_text, joints_text
from taskcal.robot.robot import Robot
from taskcal.tables.forms import read_table
from taskcal.tables.table import number_of

Purpose = Literal["chosen", "kept-out", "reference"]
"""Why a row was measured: chosen for the fit, kept out to judge it, or the first pose again."""


@dataclass(frozen=True, eq=False, kw_only=True)
class Row:
    """A row of the campaign."""

    number: int
    """From 1."""
    purpose: Purpose
    station: int
    """Of the tracker, from 1."""
    time_s: float
    """Since the campaign began, seconds."""
    joints: Float[np.ndarray, " joints"]
    point: Float[np.ndarray, " 3"]
    """In the tracker's frame, metres; without a tracker the kind's numbers."""
    fixture: str = ""
    """Without a tracker: at which it was measured."""
    corners: Corners | None = None
    """Of an image, what it shows."""

    @property
    def image(self) -> str:
        """Name of the image; empty where there is none."""
        return "" if self.corners is None else self.corners.images[0]

    @property
    def id(self) -> str:
        """Number and purpose, such as ``15-kept-out``; of chosen rows the number alone."""
        return f"{self.number}" if self.purpose == "chosen" else f"{self.number}-{self.purpose}"


EDITED = "undo the change, or begin another campaign"
"""What to do about a campaign that is not as it was written."""

ANY_TRACKER = Tracker()
"""That sees one reflector at the TCP from everywhere."""

SETTINGS = {"instrument": "instrument, or other places, lengths or options of it", "tolerance_mm": "tolerance in mm"}
"""Settings in words, where their names are not."""


class Journal:
    """The campaign's file, and the notes beside it; both are only ever appended to, by one process.

    The notes are a chain of seals: each row's digest is noted before the row is written, so that what was moved, left out or
    put in by others is noticed; a row that a kill prevented is the last that is noted.
    """

    def __init__(
        self,
        path: Path,
        robot: Robot,
        target: str = "tool",
        *,
        observe: Instrument = ANY_TRACKER,
        options: ReadOptions | None = None,
    ):
        """Name the files.

        Args:
            path: of the campaign.
            robot: that is measured.
            target: of a tracker.
            observe: what measures.
            options: what is stated that the file does not say.
        """
        self.path, self.notes_path = path, path.with_suffix(".measure.jsonl")
        self.robot, self._target = robot, "" if target == "tool" else f"{target}_"
        self._observe, self._options = observe, options
        self.rows: tuple[Row, ...] = ()
        self.notes: tuple[Mapping[str, Any], ...] = ()
        self._held: IO[str] | None = None
        """The notes, locked as long as this goes on."""
        self.dropped = False
        """Whether a line that a kill had left half-written was dropped."""
        self.corners_path: Path | None = None
        """Of the corners that images show, where images are taken."""
        if observe.looked_for is not None:
            self.corners_path = path.with_suffix(".corners.csv")
            self._options = replace(options or ReadOptions(), images=self.corners_path)

    def begin(self, settings: Mapping[str, Any]) -> None:
        """Begin a campaign.

        Args:
            settings: with which it has to go on.

        Raises:
            FileError: a file is there already, or cannot be written.
        """
        if self.path.exists():
            raise FileError(self.path, "is there already; go on with it (--resume), or give another name")
        if self.notes_path.exists():
            raise FileError(
                self.notes_path, f"belongs to a campaign {self.path.name} that is gone; remove it, or give another name"
            )
        if self.corners_path is not None and self.corners_path.exists():
            raise FileError(
                self.corners_path,
                f"belongs to a campaign {self.path.name} that is gone; remove it, or give another name",
            )
        self.note({"settings": dict(settings)})
        self._hold()
        if self.corners_path is not None:
            _append(self.corners_path, corners_text([NO_CORNERS]))
        _append(self.path, self._lines([])[0])
        folder = os.open(self.path.resolve().parent, os.O_RDONLY)
        os.fsync(folder)
        os.close(folder)

    def resume(self, settings: Mapping[str, Any]) -> None:
        """Go on with a campaign.

        Raises:
            FileError: there is none, it is of another kind, or it was begun with other settings.
        """
        if not self.path.exists() or not self.notes_path.exists():
            lacking = self.notes_path if self.path.exists() else self.path
            raise FileError(
                lacking, "is not there, so that nothing can be gone on with; begin another one without --resume"
            )
        self._hold()
        try:
            self._read_back(settings)
        except FileError:
            self.close()
            raise

    def _read_back(self, settings: Mapping[str, Any]) -> None:
        """Read the notes and the rows of a campaign that was begun with these settings."""
        self.notes = unchain(self.notes_path, self._whole_lines(self.notes_path), EDITED)
        if not self.notes:
            raise FileError(self.notes_path, "does not state how the campaign was begun; begin another campaign")
        begun = self.notes[0]["settings"]
        for name, value in settings.items():
            if begun.get(name) != value:
                raise FileError(
                    self.notes_path,
                    f"the campaign was begun with another {SETTINGS.get(name, name)}: {_worded(name, begun.get(name))}, "
                    f"not {_worded(name, value)}; give the same, or begin another campaign",
                )
        header, *lines = self._whole_lines(self.path) or [""]
        if f"{header}\n" != self._lines([])[0]:
            raise FileError(self.path, "has other columns than a campaign that is measured with this robot", line=1)
        seen = self._resumed_corners(len(lines))
        self._check_noted(lines, seen)
        self.rows = tuple(self._row(line, number, seen) for number, line in enumerate(lines, 1))

    def _check_noted(self, lines: Sequence[str], seen: Mapping[str, Corners]) -> None:
        """See that the rows are those that were noted, but for a last one that a kill prevented.

        Raises:
            FileError: one is not as it was written, or was put in, or the last ones are gone.
        """
        noted = {note["row"]: note["digest"] for note in self.notes if "row" in note}
        for number, line in enumerate(lines, 1):
            if noted.get(number) != digest_of(line + _corners_in(line, seen)):
                raise FileError(self.path, f"row {number} is not as it was written; {EDITED}", line=number + 1)
        gone = len(noted) - len(lines)
        if gone > 1 or (gone == 1 and self.notes[-1].get("row") != len(noted)):
            raise FileError(self.path, f"lacks the rows from {len(lines) + 1} to {len(noted)}; {EDITED}")

    def _hold(self) -> None:
        """Keep other processes from this campaign.

        Raises:
            FileError: one has it.
        """
        self._held = self.notes_path.open("a+", encoding="utf-8")
        if not take_lock(self._held):
            self.close()
            raise FileError(
                self.path, "is being measured by another process; wait for its end, or begin another campaign"
            )

    def close(self) -> None:
        """Let others go on with the campaign; again does nothing."""
        if self._held is not None:
            self._held.close()
            self._held = None

    def _resumed_corners(self, rows: int) -> Mapping[str, Corners]:
        """What each image shows; corners of an image whose row was not written any more are taken off the file.

        Raises:
            FileError: the file is gone, or is not of these rows.
        """
        if self.corners_path is None:
            return {}
        if not self.corners_path.exists():
            raise FileError(
                self.corners_path, "is not there, where the campaign's corners were; begin another campaign"
            )
        header, *lines = self._whole_lines(self.corners_path) or [""]
        images = [next(csv.reader([line]))[0] for line in lines]
        names = tuple(dict.fromkeys(images))
        if f"{header}\n" != corners_text([NO_CORNERS]) or len(names) < rows:
            raise FileError(
                self.corners_path, "does not have the images of the campaign's rows; begin another campaign"
            )
        if len(names) > rows:
            there = sum(name in names[:rows] for name in images)
            os.truncate(self.corners_path, len("".join(f"{line}\n" for line in [header, *lines[:there]]).encode()))
            self.dropped = True
        if not rows:
            return {}
        (whole,) = read_corners(read_table(self.corners_path))
        return {name: whole.take(name) for name in whole.images}

    @property
    def settings(self) -> Mapping[str, Any]:
        """With which the campaign was begun."""
        return self.notes[0]["settings"]

    def append(self, row: Row) -> None:
        """Write a row; it is on the disk when this returns.

        Raises:
            FileError: the disk refuses.
        """
        line, seen = self._lines([row])[1], dict[str, Corners]()
        corners = "" if self.corners_path is None or row.corners is None else corners_text([row.corners])
        self.note({"row": row.number, "digest": digest_of(line.removesuffix("\n") + corners)})
        if self.corners_path is not None and row.corners is not None:
            _append(self.corners_path, corners.partition("\n")[2])
            cells = row.corners.table()
            pixel = np.array([cells["u_px"], cells["v_px"]], dtype=float).T
            seen[row.image] = replace(row.corners, pixel=pixel)
        _append(self.path, line)
        self.rows = (
            *self.rows,
            self._row(line, row.number, seen),
        )  # as it will be read: resuming must make no difference

    def note(self, what: Mapping[str, Any]) -> None:
        """Write a note; it is on the disk when this returns.

        Raises:
            FileError: the disk refuses.
        """
        line = chained(what, self.notes[-1][SEAL] if self.notes else "")
        _append(self.notes_path, json.dumps(line) + "\n")
        self.notes = (*self.notes, line)

    def noted(self, kind: str) -> tuple[Any, ...]:
        """Values of all notes of a kind."""
        return tuple(note[kind] for note in self.notes if kind in note)

    def campaign(self, rows: Int[np.ndarray, " k"]) -> Campaign:
        """Some rows, in their order, as they are read from the file."""
        header, *lines = self.path.read_text().splitlines(keepends=True)
        with tempfile.TemporaryDirectory() as folder:
            part, options = Path(folder) / self.path.name, self._stated(rows, Path(folder) / "stated.csv")
            if len(rows) == len(self.rows):
                return read_campaign(self.path, self.robot, options=options)
            part.write_text(header + "".join(lines[k] for k in rows))
            return read_campaign(part, self.robot, options=options)

    def _stated(self, rows: Int[np.ndarray, " k"], own: Path) -> ReadOptions | None:
        """What is stated, without distances of fixtures that none of the rows names, as one that is left out; these need a file."""
        options, observe = self._options, self._observe
        if options is None or options.distances is None or "distances" not in observe.shares:
            return options
        of = np.array([observe.fixtures.names.index(self.rows[k].fixture) for k in rows], dtype=np.int64)
        there = observe.observation(of).take(np.arange(len(of)))
        if set(there.named) == set(observe.fixtures.names):
            return options
        own.write_text(there.stated_text() or "", encoding="utf-8")
        return replace(options, distances=own if there.tells_scale else None)

    def beside(self, rows: Sequence[Row], known: Sequence[int]) -> Campaign:
        """Rows, which need not be in the file, as they are read with some of it; images of all of them tell of the camera."""
        numbers = {row.number for row in rows}
        more = [row for k in known if (row := self.rows[k]).number not in numbers]
        own = [*rows, *more]
        corners = join_corners([row.corners for row in own if row.corners is not None])
        with tempfile.TemporaryDirectory() as folder:
            part = Path(folder) / self.path.name
            part.write_text("".join(self._lines(own)))
            options = replace(self._options or ReadOptions(), images=(corners,), judged=False)
            return read_campaign(part, self.robot, options=options).take(np.arange(len(rows)))

    def _lines(self, rows: Iterable[Row]) -> list[str]:
        """The header, and a line for each row."""
        own = list(rows)
        more = {
            "id": [row.id for row in own],
            **self._cells(own),
            "time_s": [f"{row.time_s:.1f}" for row in own],
        }
        joints = np.array([row.joints for row in own]).reshape(-1, len(self.robot.joints))
        return joints_text(joints, self.robot, more).splitlines(keepends=True)

    def _cells(self, rows: Sequence[Row]) -> dict[str, list[str]]:
        """Columns of what was measured."""
        point = np.array([row.point for row in rows]).reshape(-1, 3)
        if self._observe.kind.in_tracker:
            return {
                **{f"{self._target}{axis}_mm": written(point[:, k] * 1e3) for k, axis in enumerate("xyz")},
                "station": [str(row.station) for row in rows],
            }
        if self.corners_path is not None:
            return {"image": [row.image for row in rows]}
        # those of all fixtures before them, so that the columns are the same whatever the rows name
        names = self._observe.fixtures.names
        of = np.array([*range(len(names)), *(names.index(row.fixture) for row in rows)], dtype=np.int64)
        kind = self._observe.observation(of)
        blank = kind.blank(len(names))
        cells = kind.cells(Measured(np.concatenate([blank.points, point]))) or {}
        return {name: texts[len(names) :] for name, texts in cells.items()}

    def _measured(self, cells: Sequence[str], number: int, seen: Mapping[str, Corners]) -> dict[str, Any]:
        """Fields of a row that state what was measured."""
        if self._observe.kind.in_tracker:
            *xyz, station = cells
            return {"station": int(station), "point": np.array([_number(cell) for cell in xyz]) * 1e-3}
        if self.corners_path is not None:
            return {
                "station": 1,
                "point": np.zeros(3),
                "fixture": self._observe.fixtures.names[0],
                "corners": seen[cells[0]],
            }
        line, kind = Path(f"{self.path}:{number + 1}"), self._observe.kind
        found = KindColumns.of(kind, tuple(self._cells([]))).read(cells, line)
        if found is None:
            raise ValueError(cells)
        names = found.observation.named
        return {"station": 1, "point": found.points[0], "fixture": names[0] if names else ""}

    def _row(self, line: str, number: int, seen: Mapping[str, Corners]) -> Row:
        """A row as it was written."""
        try:
            text, *cells, time_s = next(csv.reader([line]))
            own, _, purpose = text.partition("-")
            if int(own) != number or (purpose or "chosen") not in get_args(Purpose):
                raise ValueError(text)
            n = len(self.robot.joints)
            joints = np.array([_number(cell) for cell in cells[:n]]) * np.where(
                self.robot.prismatic, 1e-3, np.pi / 180.0
            )
            return Row(
                number=number,
                purpose=purpose or "chosen",  # pyright: ignore[reportArgumentType]
                time_s=_number(time_s),
                joints=joints,
                **self._measured(cells[n:], number, seen),
            )
        except (ValueError, StopIteration, LookupError, TaskcalError) as error:
            raise FileError(
                self.path,
                f"row {number} is not as it was written; {EDITED}",
                line=number + 1,
            ) from error

    def _whole_lines(self, path: Path) -> list[str]:
        """Lines of a file; a half-written last one is taken off the file."""
        content = path.read_bytes()
        whole = content.rfind(b"\n") + 1
        if whole < len(content):
            os.truncate(path, whole)
            self.dropped = True
        return content[:whole].decode("utf-8", "replace").splitlines()


def _corners_in(line: str, seen: Mapping[str, Corners]) -> str:
    """Text of the corners of the image that a row names; empty where it names none."""
    name = next((cell for cell in next(csv.reader([line]), []) if cell in seen), None)
    return "" if name is None else corners_text([seen[name]])


def _worded(name: str, value: Any) -> str:
    """A setting's value in a message."""
    none = "a tracker" if name == "instrument" else "none"
    return {"None": none, "True": "yes", "False": "no"}.get(str(value), shown(str(value)))


def _append(path: Path, line: str) -> None:
    """Append a line; return once it is on the disk.

    Raises:
        FileError: the disk refuses.
    """
    try:
        with path.open("ab") as file:
            file.write(line.encode())
            file.flush()
            os.fsync(file.fileno())
    except OSError as error:
        raise FileError(path, f"cannot be written: {error.strerror or error}; mend that, and resume") from error


def _number(cell: str) -> float:
    """A number that was written.

    Raises:
        ValueError: it is none.
    """
    number = number_of(cell)
    if not math.isfinite(number):
        raise ValueError(cell)
    return number
