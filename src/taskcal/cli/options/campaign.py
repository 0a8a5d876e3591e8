"""Options of reading a campaign: form of its table, rows, targets, reference points, drift."""

import re
import shlex
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any, ClassVar

import typer

import taskcal
from taskcal.arguments import converted
from taskcal.cli.command import option
from taskcal.cli.output import info
from taskcal.errors import CampaignError, FileError, shown
from taskcal.io.text_file import read_text
from taskcal.reading.options import ReadOptions, UsedRows
from taskcal.tables.options import TableForm
from taskcal_groundwork.options import OptionError, options_of

if TYPE_CHECKING:
    from taskcal.reading.pictures import Corners


@dataclass(frozen=True, kw_only=True)
class TableOptions(ReadOptions, TableForm):
    """Options of reading a table whose file leaves something open."""

    @property
    def image_folder(self) -> Path | None:
        """The images, where a folder of them is named, and not the corners in them."""
        return self.images if isinstance(self.images, Path) and self.images.is_dir() else None

    def find_corners(self) -> "tuple[Corners, ...] | None":
        """Corners in the images of each camera of a folder; None where none is given.

        Raises:
            TaskcalError: images or boards cannot be read, or OpenCV is not installed.
        """
        if self.image_folder is None or self.board is None:
            return None
        from taskcal.observations.calibration_board import read_boards
        from taskcal.reading.detection import corners_of

        return corners_of(self.image_folder, read_boards(self.board))

    @property
    def read_options(self) -> "taskcal.reading.ReadOptions":
        """Stated options, as the reader takes them."""
        if self.images is not None and self.board is None:
            raise OptionError("requires {board}, the file of the boards that they show", "images", "board")
        if self.board is None and self.camera is not None:
            raise OptionError("is of images; requires {board}, too", "camera", "board")
        if self.images is None and self.image_times is not None:
            raise OptionError("requires {images}, which it pairs", "image_times", "images")
        if self.camera is None and self.camera_exact:
            raise OptionError("requires {camera}, whose numbers are exact", "camera_exact", "camera")
        return replace(converted(ReadOptions, self), form=converted(TableForm, self))


@dataclass(frozen=True, eq=False, kw_only=True)
class CampaignRead:
    """A campaign, and which of its rows are to be used."""

    whole: "taskcal.Campaign"
    rows: tuple[int, ...]
    """Numbers of the rows to use, counted from 0."""
    drift: dict[str, Any] | None
    """Compensation by reference points; None where there was none."""

    @property
    def campaign(self) -> "taskcal.Campaign":
        """The rows to use."""
        return self.whole if self.rows == tuple(range(len(self.whole))) else self.whole.take(list(self.rows))


def stations_in_words(campaign: "taskcal.Campaign") -> list[str]:
    """Say how many stations a tracker had, and the rows of each; nothing where none is named."""
    stations = campaign.stations
    if stations is None:
        return []
    count, rows = len(stations.names), zip(stations.names, stations.rows, strict=True)
    named = ", ".join(f"{name} ({number} rows)" for name, number in rows)
    if count == 1:
        return [f"the tracker had one station: {named}"]
    return [f"the tracker had {count} stations, each with a frame of its own: {named}"]


def compensate(
    campaign: "taskcal.Campaign", noise: "taskcal.TrackerNoise | None" = None
) -> tuple["taskcal.Campaign", dict[str, Any] | None]:
    """The campaign in the frame of its reference points, and how far they moved; None where there are none."""
    if not campaign.reference_points:
        return campaign, None

    drift = taskcal.campaigns.compensate_drift(campaign, noise)
    for remark in drift.remarks:
        info(remark)
    summary = {"followed": drift.followed, "largest_mm": drift.largest * 1e3, "noise_mm": drift.noise * 1e3}
    return drift.campaign, {**summary, "remarks": list(drift.remarks)}


@dataclass(frozen=True, kw_only=True)
class CampaignOptions(UsedRows, TableOptions):
    """Options of reading a campaign."""

    def named_images(self, campaign: Sequence[Path]) -> str:
        """Options with which a report shows the images of a campaign, read as they were; empty without images."""
        if self.board is None:
            return ""
        words = ["--campaign", str(campaign[0])]
        for one in options_of(CampaignOptions):
            value = getattr(self, one.field)
            if value != one.default:
                words += [f"--{one.name}", *([] if value is True else [str(one.written(value))])]
        return f" {shlex.join(words)}"

    def read(
        self,
        path: Path | Sequence[Path],
        robot: "taskcal.Robot",
        *,
        targets: Sequence[str] | None = None,
        noise: "taskcal.TrackerNoise | None" = None,
        corners: "tuple[Corners, ...] | None" = None,
    ) -> CampaignRead:
        """Read a campaign of a robot.

        Args:
            path: its file, or those of several stations.
            robot: that was measured.
            targets: those to read where the user names none; None for all that are not reference points.
            noise: the tracker's, by which reference points are judged.
            corners: in the images of each camera, where they are found already.

        Raises:
            FileError: it cannot be read, or does not have what was asked for.
            CampaignError: it does not have such a row.
        """
        whole = taskcal.read_campaign(
            path,
            robot,
            targets=self.targets or targets,
            reference_points=self.reference_points,
            options=self.read_options if corners is None else replace(self.read_options, images=corners),
        )
        name = whole.source or "campaign"
        for note in (*whole.notes, *stations_in_words(whole)):
            info(f"{name}: {note}")
        whole, drift = compensate(whole, noise) if self.drift == "follow" else (whole, None)
        rows = range(len(whole)) if self.rows is None else choose_rows(self.rows, len(whole), Path(name))
        return CampaignRead(whole=whole, rows=tuple(rows), drift=drift)


@dataclass(frozen=True, kw_only=True)
class MeasuredOptions(CampaignOptions):
    """A campaign that may be given, and how it is read.

    Raises:
        OptionError: how to read a campaign, and no campaign.
    """

    of_others: ClassVar[tuple[str, ...]] = ()
    """Options that have another meaning too, where a command has it."""

    campaign: Path | None = option(None, "CAMPAIGN.csv", "Measurements to use.")

    def __post_init__(self) -> None:
        if self.campaign is not None:
            return
        for given in options_of(CampaignOptions):
            if getattr(self, given.field) != given.default and given.field not in self.of_others:
                raise OptionError(f"{{{given.field}}} requires --campaign", given.field)


# Rows of a campaign, as the command line chooses them: a:b, or a file of row numbers; counted from 0.

_RANGE = re.compile(r"(\d{0,15}):(\d{0,15})$", re.ASCII)


def choose_rows(text: str, count: int, source: Path) -> list[int]:
    """Row numbers of a campaign with `count` rows.

    Raises:
        typer.BadParameter: what looks like a range is none.
        FileError: the file of row numbers is missing, or a line is not a row number or stands twice.
        CampaignError: the campaign does not have such a row.
    """
    path = Path(text)
    match = _RANGE.match(text)
    if path.exists() or not (match or _looks_like_range(text)):
        return _from_file(path, count, source)
    if not match:
        raise typer.BadParameter(
            f"'{shown(text)}' is not a range of rows; write a:b with a < b, such as 0:60", param_hint="--rows"
        )
    first, last = int(match[1] or 0), int(match[2] or count)
    if first >= last and match[2]:
        raise typer.BadParameter(
            f"'{text}' is empty; write a:b with a < b, counted from 0, without b", param_hint="--rows"
        )
    if last > count or first >= count:
        begin = first if first < count else 0
        raise CampaignError(f"rows {text}: {source} has {count} rows, numbered 0 to {count - 1}; write {begin}:{count}")
    return list(range(first, last))


def _looks_like_range(text: str) -> bool:
    return bool(re.match(r"[-+\d.,\s]*$", text) or re.match(r"[^/\\.]*:[^/\\.]*$", text))


def _from_file(path: Path, count: int, source: Path) -> list[int]:
    if not path.exists():
        raise FileError(path, "cannot be read: there is no such file; --rows takes a:b or a file of row numbers")
    lines = read_text(path, otherwise="is not a text file; write one row number per line, counted from 0").splitlines()
    found: dict[int, int] = {}
    for number, line in enumerate(lines, start=1):
        text = line.split("#", 1)[0].strip()
        if not text:
            continue
        if not re.fullmatch(r"\d{1,15}", text, re.ASCII):
            raise FileError(
                path, f"'{shown(text)}' is not a row number; write one per line, counted from 0", line=number
            )
        row = int(text)
        if row >= count:
            raise FileError(path, f"row {row}: {source} has {count} rows, numbered 0 to {count - 1}", line=number)
        if row in found:
            raise FileError(path, f"row {row} is in line {found[row]} already; name each row once", line=number)
        found[row] = number
    if not found:
        raise FileError(path, "names no row; write one row number per line, counted from 0")
    return list(found)
