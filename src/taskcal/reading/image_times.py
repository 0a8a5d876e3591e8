"""Images and joints that are paired by time: an image counts only where the robot stood before it and after it."""

import re
import struct
from collections.abc import Sequence
from dataclasses import dataclass
from datetime import UTC, datetime
from pathlib import Path
from typing import NamedTuple

import numpy as np
from jaxtyping import Float, Int

from taskcal.errors import FileError, shown
from taskcal.reading.columns import find_word, split_unit
from taskcal.robot.robot import Robot
from taskcal.tables.forms import read_table
from taskcal.tables.table import TIMES, Table

OF_NAMES, OF_EXIF = "names", "exif"
"""In place of a file of times: each image has its own, in its name or, as cameras write it, inside the file."""

WINDOW_S = 0.1
"""Before and after an image, in which the robot must stand, seconds: exposure and readout of a rolling shutter take up to 0.05 s,
and clocks that are kept together differ by less."""

STILL_RAD, STILL_M = np.radians(0.01), 2e-5
"""Range of a joint that stands: encoders and their control flicker by a few thousandths of a degree, and 0.01° of the first axis
are 0.17 mm at 1 m."""

_UNITS = {**TIMES, "sec": 1.0, "us": 1e-6, "μs": 1e-6, "ns": 1e-9}
"""Of times of clocks, seconds: cameras count microseconds, and ROS nanoseconds."""

_UNIX = re.compile(r"(?<!\d)(?P<whole>\d{10})(?:[._](?P<part>\d{1,9})|(?P<more>\d{3}|\d{6}|\d{9}))?(?!\d)")
"""Seconds since 1970 with a fraction behind a point, or milli-, micro- or nanoseconds."""

_DATE = re.compile(
    r"(?<!\d)(\d{4})-?(\d\d)-?(\d\d)[T _-]?(\d\d)[-:_.h]?(\d\d)[-:_.m]?(\d\d)(?:[._,](?P<part>\d{1,9}))?"
    r"(?: ?(?:Z|(?P<zone>\+\d\d:?\d\d|-\d\d:\d\d)))?(?!\d)"
)


class Stamp(NamedTuple):
    """When an image was taken."""

    seconds: float
    """Since 1970, or any day."""
    unsure: float = 0.0
    """For how long after it the image may have been taken: one of the last digit."""


def stamp_of(text: str) -> Stamp | None:
    """The time in a text, such as a file's name: seconds since 1970, or a date, as UTC unless it states an offset; None without."""
    found = _UNIX.search(text)
    if found is not None:
        part = found["part"] or found["more"] or ""
        return Stamp(float(f"{found['whole']}.{part or '0'}"), 10.0 ** -len(part))
    found = _DATE.search(text)
    if found is None:
        return None
    try:
        when = datetime(*(int(part) for part in found.groups()[:6]), tzinfo=UTC)
    except ValueError:
        return None
    part, zone = found["part"] or "", found["zone"] or "+0000"
    ahead = float(f"{zone[0]}60") * (60 * int(zone[1:3]) + int(zone[-2:]))
    return Stamp(when.timestamp() - ahead + float(f"0.{part or '0'}"), 10.0 ** -len(part))


EXIF_HEADS = {b"II*\0": "<", b"MM\0*": ">"}
"""First bytes of the block, and the order of bytes in it."""

EXIF_IFD, TAKEN, TAKEN_PART, TAKEN_ZONE = 0x8769, 0x9003, 0x9291, 0x9011
"""Tags of EXIF 2.32: where its own are, DateTimeOriginal, its fraction of a second, and its offset from UTC."""

EXIF_WITHIN = 1 << 20
"""First bytes of a file in which the block is looked for."""


def exif_stamp(data: bytes) -> Stamp | None:
    """When a JPEG, PNG or TIFF says inside that it was taken; a date without a zone counts as UTC. None where it does not."""
    at = next((data.find(mark) + len(mark) for mark in (b"Exif\0\0", b"eXIf") if mark in data), 0)
    block = data[at:]
    order = EXIF_HEADS.get(block[:4])
    if order is None:
        return None

    def entries(first: int) -> dict[int, tuple[int, int]]:
        """Count, and place, of each tag's value."""
        (count,) = struct.unpack_from(f"{order}H", block, first)
        every = (struct.unpack_from(f"{order}HHI", block, first + 2 + 12 * k) for k in range(count))
        return {tag: (size, first + 10 + 12 * k) for k, (tag, _, size) in enumerate(every)}

    def text(tag: int) -> str:
        size, place = own.get(tag, (0, 0))
        if size > 4:
            (place,) = struct.unpack_from(f"{order}I", block, place)
        return block[place : place + size].split(b"\0")[0].decode("ascii", "replace").strip()

    try:
        main = entries(struct.unpack_from(f"{order}I", block, 4)[0])
        own = entries(struct.unpack_from(f"{order}I", block, main[EXIF_IFD][1])[0]) if EXIF_IFD in main else {}
        date, part, zone = text(TAKEN), text(TAKEN_PART), text(TAKEN_ZONE)
    except struct.error:
        return None
    return stamp_of(f"{date.replace(':', '-', 2)}{'.' if part else ''}{part}{zone}")


@dataclass(frozen=True, eq=False, kw_only=True)
class Times:
    """Times of the rows of a table."""

    column: str
    seconds: Float[np.ndarray, " n"]
    unsure: float
    """As `Stamp.unsure`: a second where none has a fraction."""


def times_of(table: Table) -> Times:
    """The column of times: numbers in the unit that its name states, seconds by default, or dates.

    Raises:
        FileError: there is none, or a cell is no time.
    """
    parted = [(name, *split_unit(name)) for name in table.header]
    found = [(name, unit, word[1]) for name, text, unit in parted if (word := find_word(text, "clock"))]
    found = [(name, unit or match["unit"] or "s") for name, unit, match in found if unit is None or unit in TIMES]
    if not found:
        raise FileError(
            table.path, "has no column of times, by which images are paired: name it time_s, or stamp for dates", line=1
        )
    name, unit = found[0]
    texts = table.texts(name)
    if any(re.search(r"\d[-:T]\d", text) for text in texts):
        stamps = [stamp_of(text) if _DATE.fullmatch(text.strip()) else None for text in texts]
        for row, one in enumerate(stamps):
            if one is None:
                raise table.error(f"'{shown(texts[row])}' is not a date such as 2026-05-03T12:33:10.5+02:00", row, name)
        dates = [one for one in stamps if one is not None]
        return Times(
            column=name,
            seconds=np.array([one.seconds for one in dates]),
            unsure=min(one.unsure for one in dates),  # some programs leave the fraction out where it is zero
        )
    seconds = _UNITS[unit] * table.numbers(name, largest=np.inf)
    return Times(column=name, seconds=seconds, unsure=float((seconds == np.floor(seconds)).all()))


def image_times(images: Sequence[str], stated: str | Path, folder: Path | None = None) -> list[Stamp]:
    """When each image was taken.

    Args:
        images: their names.
        stated: a table with the columns ``image`` and a time, or ``names``, or ``exif``.
        folder: of the images; None where only their corners are there.

    Raises:
        FileError: the table lacks a column.
        ValueError: an image has no time; the message names it.
    """
    if str(stated) in (OF_NAMES, OF_EXIF):
        if str(stated) == OF_NAMES:
            found = [stamp_of(Path(name).stem) for name in images]
        elif folder is None:
            raise ValueError("times inside images need these; give the folder of the images, not their corners")
        else:
            found = list[Stamp | None]()
            for name in images:
                with (folder / name).open("rb") as file:
                    found.append(exif_stamp(file.read(EXIF_WITHIN)))
        stamps = [one for one in found if one is not None]
        missing = [name for name, one in zip(images, found, strict=True) if one is None]
        if missing and str(stated) == OF_EXIF:
            raise ValueError(
                f"{shown(missing[0])} has no time inside (EXIF DateTimeOriginal), like {len(missing) - 1} others"
            )
        if missing:
            raise ValueError(
                f"the name {shown(missing[0])} has no time, such as 1777811590.25.png or 2026-05-03_12-33-10.25.png; give a table "
                "of images and times"
            )
        return stamps
    table = read_table(Path(stated))
    if "image" not in table:
        raise FileError(table.path, "has no column image, the names of the files", line=1)
    times, known = times_of(table), dict[str, Stamp]()
    for row, (name, seconds) in enumerate(zip(table.texts("image"), times.seconds.tolist(), strict=True)):
        one = known.setdefault(Path(name).stem.casefold(), Stamp(seconds, times.unsure))
        if one.seconds != seconds:
            raise table.error(f"image '{shown(name)}' has two times; an image is taken at one", row, "image")
    missing = [name for name in images if Path(name).stem.casefold() not in known]
    if missing:
        raise ValueError(f"{table.path.name} has no image {shown(missing[0])}, and {len(missing) - 1} others")
    return [known[Path(name).stem.casefold()] for name in images]


@dataclass(frozen=True, eq=False, kw_only=True)
class PairedByTime:
    """Images of standing robots."""

    image: Int[np.ndarray, " k"]
    """Numbers of the images."""
    row: Int[np.ndarray, " k"]
    """The nearest row of each."""
    q: Float[np.ndarray, "k joints"]
    """Median of the rows about each."""
    moving: Int[np.ndarray, " m"]
    """Images before and after which joints differ."""
    outside: Int[np.ndarray, " o"]
    """Images before the first row or after the last."""


def pair_by_time(
    robot: Robot,
    q: Float[np.ndarray, "n joints"],
    rows: Float[np.ndarray, " n"],
    images: Sequence[Stamp],
) -> PairedByTime:
    """The joints at which images were taken, of those before and after which the robot stood.

    Args:
        robot: which joints slide.
        q: joints of a log, radians and metres.
        rows: its times, ascending, seconds.
        images: times of the images, of the same clock.
    """
    still = np.where(robot.prismatic, STILL_M, STILL_RAD)
    begins = np.array([one.seconds for one in images])
    ends = begins + np.array([one.unsure for one in images])
    inside = (begins >= rows[0]) & (ends <= rows[-1])
    taken, nearest, joints, moving = list[int](), list[int](), list[np.ndarray](), list[int]()
    for k in np.flatnonzero(inside).tolist():
        before, behind = int(np.searchsorted(rows, begins[k], side="right")) - 1, int(np.searchsorted(rows, ends[k]))
        first = min(int(np.searchsorted(rows, begins[k] - WINDOW_S)), before)
        last = max(int(np.searchsorted(rows, ends[k] + WINDOW_S, side="right")), behind + 1)
        about = q[first:last]
        if (np.ptp(about, axis=0) > still).any():
            moving.append(k)
            continue
        taken.append(k)
        nearest.append(first + int(np.abs(rows[first:last] - 0.5 * (begins[k] + ends[k])).argmin()))
        joints.append(np.median(about, axis=0))
    return PairedByTime(
        image=np.array(taken, dtype=int),
        row=np.array(nearest, dtype=int),
        q=np.array(joints).reshape(len(taken), q.shape[1]),
        moving=np.array(moving, dtype=int),
        outside=np.flatnonzero(~inside),
    )
