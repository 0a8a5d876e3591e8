"""Images and joints that are paired by time: an image counts only where the robot stood before it and after it."""

import re
from collections.abc import Sequence
from dataclasses import dataclass
from datetime import UTC, datetime
from pathlib import Path

import numpy as np
from jaxtyping import Float, Int

from taskcal.errors import FileError, shown
from taskcal.robot.robot import Robot
from taskcal.tables.forms import read_table
from taskcal.tables.table import Table

OF_NAMES = "names"
"""In place of a file of times: each image's name has its own."""

WINDOW_S = 0.1
"""Before and after an image, in which the robot must stand, seconds: exposure and readout of a rolling shutter take up to 0.05 s,
and clocks that are kept together differ by less."""

STILL_RAD, STILL_M = np.radians(0.01), 2e-5
"""Range of a joint that stands: encoders and their control flicker by a few thousandths of a degree, and 0.01° of the first axis
are 0.17 mm at 1 m."""

_COLUMN = re.compile(
    r"(?:time|t|zeit|stamp|time[ _]?stamp)(?:[ _]*[\[(]?(?P<unit>s|sec|ms|us|µs|ns)[\])]?)?", re.IGNORECASE
)
_UNITS = {"s": 1.0, "sec": 1.0, "ms": 1e-3, "us": 1e-6, "µs": 1e-6, "ns": 1e-9}

_UNIX = re.compile(r"(?<!\d)(?P<whole>\d{10})(?:[._](?P<part>\d{1,9})|(?P<more>\d{3}|\d{6}|\d{9}))?(?!\d)")
"""Seconds since 1970 with a fraction behind a point, or milli-, micro- or nanoseconds."""

_DATE = re.compile(
    r"(?<!\d)(\d{4})-?(\d\d)-?(\d\d)[T _-]?(\d\d)[-:_.h]?(\d\d)[-:_.m]?(\d\d)(?:[._,](?P<part>\d{1,9}))?(?!\d)"
)


def stamp_of(name: str) -> float | None:
    """Seconds since 1970 by a file's name or a date; dates count as UTC. None where it has neither."""
    text = Path(name).stem
    found = _UNIX.search(text)
    if found is not None:
        return float(f"{found['whole']}.{found['part'] or found['more'] or '0'}")
    found = _DATE.search(text)
    if found is None:
        return None
    try:
        when = datetime(*(int(part) for part in found.groups()[:6]), tzinfo=UTC)
    except ValueError:
        return None
    return when.timestamp() + float(f"0.{found['part'] or '0'}")


@dataclass(frozen=True, eq=False, kw_only=True)
class Times:
    """Times of the rows of a table."""

    column: str
    seconds: Float[np.ndarray, " n"]


def times_of(table: Table) -> Times:
    """The column of times: numbers in the unit that its name states, seconds by default, or dates.

    Raises:
        FileError: there is none, or a cell is no time.
    """
    found = [(name, match) for name in table.header if (match := _COLUMN.fullmatch(name.strip()))]
    if not found:
        raise FileError(
            table.path, "has no column of times, by which images are paired: name it time_s, or stamp for dates", line=1
        )
    name, match = found[0]
    texts = table.texts(name)
    if any(re.search(r"\d[-:T]\d", text) for text in texts):
        seconds = [stamp_of(f"{text}.x") for text in texts]
        for row, one in enumerate(seconds):
            if one is None:
                raise table.error(f"'{shown(texts[row])}' is not a date such as 2026-05-03T12:33:10.5", row, name)
        return Times(column=name, seconds=np.array(seconds, dtype=float))
    unit = _UNITS[(match["unit"] or "s").lower()]
    return Times(column=name, seconds=unit * table.numbers(name, largest=np.inf))


def image_times(images: Sequence[str], stated: str | Path) -> Float[np.ndarray, " images"]:
    """When each image was taken.

    Args:
        images: their names.
        stated: a table with the columns ``image`` and a time, or ``names``.

    Raises:
        FileError: the table lacks a column.
        ValueError: an image has no time; the message names it.
    """
    if str(stated) == OF_NAMES:
        found = [stamp_of(name) for name in images]
        missing = [name for name, one in zip(images, found, strict=True) if one is None]
        if missing:
            raise ValueError(
                f"the name {shown(missing[0])} has no time, such as 1777811590.25.png or 2026-05-03_12-33-10.25.png; give a table "
                "of images and times"
            )
        return np.array(found, dtype=float)
    table = read_table(Path(stated))
    if "image" not in table:
        raise FileError(table.path, "has no column image, the names of the files", line=1)
    seconds = times_of(table).seconds
    known = {Path(name).stem.casefold(): float(t) for name, t in zip(table.texts("image"), seconds, strict=True)}
    missing = [name for name in images if Path(name).stem.casefold() not in known]
    if missing:
        raise ValueError(f"{table.path.name} has no image {shown(missing[0])}, and {len(missing) - 1} others")
    return np.array([known[Path(name).stem.casefold()] for name in images])


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
    images: Float[np.ndarray, " images"],
) -> PairedByTime:
    """The joints at which images were taken, of those before and after which the robot stood.

    Args:
        robot: which joints slide.
        q: joints of a log, radians and metres.
        rows: its times, ascending, seconds.
        images: times of the images, of the same clock.
    """
    still = np.where(robot.prismatic, STILL_M, STILL_RAD)
    after = np.searchsorted(rows, images)
    inside = (images >= rows[0]) & (images <= rows[-1])
    taken, nearest, joints, moving = list[int](), list[int](), list[np.ndarray](), list[int]()
    for k in np.flatnonzero(inside).tolist():
        first = min(int(np.searchsorted(rows, images[k] - WINDOW_S)), max(int(after[k]) - 1, 0))
        last = max(int(np.searchsorted(rows, images[k] + WINDOW_S, side="right")), int(after[k]) + 1)
        about = q[first:last]
        if (np.ptp(about, axis=0) > still).any():
            moving.append(k)
            continue
        taken.append(k)
        nearest.append(first + int(np.abs(rows[first:last] - images[k]).argmin()))
        joints.append(np.median(about, axis=0))
    return PairedByTime(
        image=np.array(taken, dtype=int),
        row=np.array(nearest, dtype=int),
        q=np.array(joints).reshape(len(taken), q.shape[1]),
        moving=np.array(moving, dtype=int),
        outside=np.flatnonzero(~inside),
    )
