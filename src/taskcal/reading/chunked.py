"""A campaign of more rows than are held at once: read in parts, which lie on the disk as they were understood."""

import os
from collections.abc import Generator, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, replace
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np

from taskcal.campaigns.campaign import Campaign
from taskcal.errors import FileError, TaskcalError
from taskcal.reading.options import ReadOptions
from taskcal.reading.reader import read_campaign
from taskcal.robot.robot import Robot
from taskcal.tables.parquet import count_rows, every_row, parts_of

PART_ROWS = 65_536
"""That are held at once."""

FIRST_LINE = 2
"""As a CSV counts the first row below its header."""

KEPT = ("q", "points", "rotations", "uncertainty")
"""Of each part, on the disk."""

SAMPLE_ROWS = 5000
"""At most, that stand for all where all are needed at once."""


@dataclass(frozen=True, eq=False, kw_only=True)
class ChunkedCampaign:
    """A campaign in parts, for as long as it is open."""

    path: Path
    rows: int
    step: int
    """Rows from one of the sample to the next."""
    sample: Campaign
    """Rows 0, step, 2·step …"""
    parts: tuple[tuple[int, Path], ...]
    """The number of each part's first row, and where it lies."""

    def __iter__(self) -> Iterator[tuple[int, Campaign]]:
        """The number of each part's first row, and its rows, without how they were approached; one part is held at a time."""
        for first, place in self.parts:
            with np.load(place, allow_pickle=False) as kept:
                yield (
                    first,
                    Campaign(
                        ids=tuple(map(str, range(first, first + len(kept["q"])))),
                        targets=self.sample.targets,
                        source=self.sample.source,
                        **{name: kept[name] for name in KEPT if name in kept},
                    ),
                )


@contextmanager
def campaign_in_chunks(path: str | Path, robot: Robot) -> Generator[ChunkedCampaign, None, None]:
    """A campaign in a Parquet file, read by parts; the folder that they lie in goes at the end.

    Rows are told apart by their number, from 0. Units have to be stated, and shots of one pose to be averaged, since neither can be
    seen of a part alone.

    Args:
        path: of the file.
        robot: that was measured.

    Raises:
        FileError: it is no Parquet file, or a part of it cannot be read as a campaign.
        CampaignError: something was observed that only all rows tell.
    """
    path = Path(path)
    before = _stamp(path)
    rows = count_rows(path)
    if rows is None:
        raise FileError(path, "is not a Parquet file; taskcal convert writes one")
    step = -(-rows // SAMPLE_ROWS) or 1
    with TemporaryDirectory(prefix="taskcal-parts-") as name:
        folder = Path(name)
        sample = _read(path, folder, every_row(path, step, PART_ROWS), robot, 0)
        numbers = step * np.arange(len(sample))
        sample = replace(sample, rows=numbers, lines=numbers + FIRST_LINE)
        parts: list[tuple[int, Path]] = []
        for first, content in parts_of(path, PART_ROWS):
            place = folder / f"{first}.npz"
            part = _read(path, folder, content, robot, first)
            arrays = {name: getattr(part, name) for name in KEPT}
            _keep(place, {name: array for name, array in arrays.items() if array is not None})
            parts.append((first, place))
        if _stamp(path) != before:
            raise FileError(path, "was changed while it was read in parts; run it again")
        yield ChunkedCampaign(path=path, rows=rows, step=step, sample=sample, parts=tuple(parts))


def _stamp(path: Path) -> tuple[int, int, int] | None:
    """Inode, size and time of a file, which change with it; None where it cannot be asked, and its reader says why."""
    try:
        status = os.stat(path)
    except (OSError, ValueError):
        return None
    return status.st_ino, status.st_size, status.st_mtime_ns


def _keep(place: Path, arrays: dict[str, np.ndarray]) -> None:
    try:
        np.savez(place, **arrays)  # pyright: ignore[reportArgumentType] - names of arrays, none of an option
    except OSError as error:
        raise _full(place, error) from error


def _full(place: Path, error: OSError) -> FileError:
    return FileError(
        place, f"cannot be written: {error.strerror or error}; name a folder with room for the parts in TMPDIR"
    )


def _read(path: Path, folder: Path, content: bytes, robot: Robot, first: int) -> Campaign:
    """The campaign that a part is."""
    place = folder / path.name
    try:
        place.write_bytes(content)
    except OSError as error:
        raise _full(place, error) from error
    count = count_rows(place)
    try:
        campaign = read_campaign(place, robot, options=ReadOptions(judged=False))  # of a part alone that is no answer
    except TaskcalError as error:
        said = str(error).replace(str(place), "a part")
        raise FileError(path, f"read in parts, from row {first} on: {said}") from error
    if len(campaign) != count:
        raise FileError(
            path, "has several shots of one pose; average them first, since a part may hold some of them alone"
        )
    if campaign.reference_points:
        names = ", ".join(campaign.reference_points)
        raise FileError(
            path, f"has reference points ({names}), whose drift only all rows tell; leave out their columns"
        )
    if campaign.stations is not None:
        raise FileError(
            path, "has a column station, and stations are not fitted in parts; leave it out, or fit fewer rows"
        )
    if not campaign.tracked:
        raise FileError(path, "was not measured by a tracker alone; only points and poses are fitted in parts")
    return campaign
