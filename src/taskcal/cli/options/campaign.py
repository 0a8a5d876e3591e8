"""Options of reading a campaign: form of its table, rows, targets, reference points, drift."""

import re
import shlex
from collections.abc import Sequence
from dataclasses import dataclass, fields, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any, ClassVar, Literal

import typer

import taskcal
from taskcal.cli.command import option
from taskcal.cli.options.common import split_names
from taskcal.cli.output import info
from taskcal.errors import CampaignError, FileError, shown
from taskcal.io.text_file import read_text

if TYPE_CHECKING:
    from taskcal.reading.pictures import Corners
    from taskcal.tables.text import DecimalMark


Angles = Literal[
    "abc",
    "wpr",
    "rpy-deg",
    "rpy-rad",
    "fixed-xyz-deg",
    "fixed-xyz-rad",
    "moving-xyz-deg",
    "moving-xyz-rad",
    "rotation-vector-rad",
    "rotation-vector-deg",
    "none",
]
"""Conventions of a pose's three angles."""


@dataclass(frozen=True, kw_only=True)
class TableOptions:
    """Options of reading a table whose file leaves something open."""

    columns: str | None = option(None, "'NAME …'", "Names of the columns, separated by spaces; - for a column to skip.")
    decimal: Literal["point", "comma"] | None = option(
        None, help="Decimal mark, where the numbers alone are ambiguous."
    )
    sheet: str | None = option(None, "NAME", "Sheet to read from a workbook.")
    hidden_rows: Literal["keep", "drop"] | None = option(
        None, help="Read or leave out rows that a workbook hides, as by a filter, or strikes out."
    )
    angles: Angles | None = option(
        None, help="Convention of a pose's three angles, where the column names do not state it."
    )
    points: Path | None = option(
        None, "FILE", "Separate file with the measured points, if the campaign holds joints only."
    )
    distances: Path | None = option(
        None, "FILE", "Stated distances of sockets: columns socket_a, socket_b, distance_mm, and u_mm where known."
    )
    wire_scale: bool = option(
        False, help="Fit the scale of measured lengths (d_mm) too; the robot's size is then nominal."
    )
    images: Path | None = option(
        None,
        "FOLDER|CORNERS.csv",
        "Images of boards, one for each row, in a folder for each of several cameras; or the corners found in them.",
    )
    board: Path | None = option(
        None, "BOARD.toml|FOLDER", "The boards that the images show: a file, or a folder of them."
    )
    image_times: str | None = option(
        None,
        "names|exif|TIMES.csv",
        "Pair images with a log of joints by time, where the robot stood; a table of image and time_s, or times in names or files.",
    )
    camera: Path | None = option(
        None,
        "CAMERA.toml|.yaml|FOLDER",
        "What is known of the camera of the images: Taskcal's TOML, or YAML of ROS (camera_info) or OpenCV; of several "
        "a folder with a file named after each. A plan needs it.",
    )
    camera_exact: bool = option(False, help="Take the camera's numbers as exact.")
    lens: Literal["pinhole", "fisheye"] = option("pinhole", help="Lens of the camera that took the images.")

    def find_corners(self) -> "tuple[Corners, ...] | None":
        """Corners in the images of each camera of a folder; None where none is given.

        Raises:
            TaskcalError: images or boards cannot be read, or OpenCV is not installed.
        """
        if self.images is None or self.board is None or not self.images.is_dir():
            return None
        from taskcal.observations.calibration_board import read_boards
        from taskcal.reading.detection import corners_of

        return corners_of(self.images, read_boards(self.board))

    @property
    def read_options(self) -> "taskcal.reading.ReadOptions":
        """Stated options, as the reader takes them."""
        marks: dict[str | None, DecimalMark | None] = {None: None, "point": ".", "comma": ","}
        columns = None if self.columns is None else tuple(self.columns.split())
        if self.images is not None and self.board is None:
            raise typer.BadParameter("requires --board, the file of the boards that they show", param_hint="--images")
        if self.board is None and self.camera is not None:
            raise typer.BadParameter("is of images; requires --board, too", param_hint="--camera")
        if self.images is None and self.image_times is not None:
            raise typer.BadParameter("requires --images, which it pairs", param_hint="--image-times")
        if self.camera is None and self.camera_exact:
            raise typer.BadParameter("requires --camera, whose numbers are exact", param_hint="--camera-exact")
        return taskcal.reading.ReadOptions(
            form=taskcal.tables.TableForm(
                columns=columns, decimal=marks[self.decimal], sheet=self.sheet, hidden_rows=self.hidden_rows
            ),
            angles=self.angles,
            points=self.points,
            distances=self.distances,
            wire_scale=self.wire_scale,
            board=self.board,
            images=self.images,
            lens=self.lens,
            camera=self.camera,
            image_times=self.image_times,
            camera_exact=self.camera_exact,
        )


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
class CampaignOptions(TableOptions):
    """Options of reading a campaign.

    Raises:
        typer.BadParameter: a list has an empty name, or one that is listed twice.
    """

    rows: str | None = option(
        None, "A:B|FILE", "Rows to use, counted from 0: A:B without B, or a file with one number per line."
    )
    targets: str | None = option(None, "NAME,…", "Targets to use; by default all that are not reference points.")
    reference_points: str | None = option(
        None, "NAME,…", "Fixed points beside the robot; by default those whose names begin with 'base'.", also="--nests"
    )
    drift: Literal["follow", "ignore"] = option(
        "follow",
        help="Compensate drift by the reference points if they moved by more than their noise, or ignore them.",
    )

    def __post_init__(self) -> None:
        split_names(self.targets, "--targets")
        split_names(self.reference_points, "--reference-points")

    def named_images(self, campaign: Sequence[Path]) -> str:
        """Options with which a report shows the images of a campaign, read as they were; empty without images."""
        if self.board is None:
            return ""
        words = ["--campaign", str(campaign[0])]
        for one in fields(CampaignOptions):
            value = getattr(self, one.name)
            if value != one.default:
                words += [f"--{one.name.replace('_', '-')}", *([] if value is True else [str(value)])]
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
            targets=split_names(self.targets, "--targets") or targets,
            reference_points=split_names(self.reference_points, "--reference-points"),
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
        typer.BadParameter: how to read a campaign, and no campaign.
    """

    of_others: ClassVar[tuple[str, ...]] = ()
    """Options that have another meaning too, where a command has it."""

    campaign: Path | None = option(None, "CAMPAIGN.csv", "Measurements to use.")

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.campaign is not None:
            return
        for given in fields(CampaignOptions):
            if getattr(self, given.name) != given.default and given.name not in self.of_others:
                name = f"--{given.name.replace('_', '-')}"
                raise typer.BadParameter(f"{name} requires --campaign", param_hint=name)

    @property
    def inputs(self) -> tuple[str | Path | None, ...]:
        """Files that are read."""
        return self.campaign, self.points, self.rows, self.distances, self.images, self.board, self.camera


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
        raise CampaignError(
            f"rows {text}: {source} has {count} rows, numbered 0 to {count - 1}; write {_nearest(first, count)}"
        )
    return list(range(first, last))


def _nearest(first: int, count: int) -> str:
    return f"{first}:{count}" if first < count else f"0:{count}"


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
