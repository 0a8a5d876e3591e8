"""What a user states of a file of measurements, and of the rows of a campaign."""

from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal

from taskcal.tables.options import AngleForm, TableForm
from taskcal_groundwork.options import Option

if TYPE_CHECKING:
    from taskcal.reading.pictures import Corners
    from taskcal.robot.robot import Robot


@dataclass(frozen=True, kw_only=True)
class ReadOptions:
    """Statements of the user on what a file of measurements leaves open; nothing by default."""

    form: TableForm = field(default_factory=TableForm)
    """Of the table."""
    angles: Annotated[
        AngleForm | None, Option(help="Convention of a pose's three angles, where the column names do not state it.")
    ] = None
    points: Annotated[
        str | Path | None,
        Option(
            metavar="FILE",
            help="Separate file with the measured points, if the campaign holds joints only.",
            kind=Path,
        ),
    ] = None
    distances: Annotated[
        str | Path | None,
        Option(
            metavar="FILE",
            help="Stated distances of sockets: columns socket_a, socket_b, distance_mm, and u_mm where known.",
            kind=Path,
        ),
    ] = None
    wire_scale: Annotated[
        bool, Option(help="Fit the scale of measured lengths (d_mm) too; the robot's size is then nominal.")
    ] = False
    images: Annotated[
        "str | Path | tuple[Corners, ...] | None",
        Option(
            metavar="FOLDER|CORNERS.csv",
            help="Images of boards, one for each row, in a folder for each of several cameras; or the corners found in them.",
            kind=Path,
        ),
    ] = None
    """None where the campaign's own file has the corners."""
    board: Annotated[
        str | Path | None,
        Option(
            metavar="BOARD.toml|FOLDER",
            help="The boards that the images show: a file, or a folder of them.",
            kind=Path,
        ),
    ] = None
    image_times: Annotated[
        str | Path | None,
        Option(
            metavar="names|exif|TIMES.csv",
            help="Pair images with a log of joints by time, where the robot stood; a table of image and time_s, or times in names "
            "or files.",
            kind=Path,
            words={"names": "names", "exif": "exif"},
            suggested=("names", "exif"),
        ),
    ] = None
    camera: Annotated[
        str | Path | None,
        Option(
            metavar="CAMERA.toml|.yaml|FOLDER",
            help="What is known of the camera of the images: Taskcal's TOML, or YAML of ROS (camera_info) or OpenCV; of several "
            "a folder with a file named after each. A plan needs it.",
            kind=Path,
        ),
    ] = None
    camera_exact: Annotated[bool, Option(help="Take the camera's numbers as exact.")] = False
    """Whatever uncertainty the file states."""
    lens: Annotated[Literal["pinhole", "fisheye"], Option(help="Lens of the camera that took the images.")] = "pinhole"
    judged: bool = True
    """Whether images that do not fit the robot are refused, and rotations that do not are left out."""
    counted_by: "Robot | None" = None
    """Robot by whose limits whole turns of joints are counted, where those of the one that is read for are open."""


@dataclass(frozen=True, kw_only=True)
class UsedRows:
    """Which rows, targets and reference points of a campaign are used, and for what."""

    rows: Annotated[
        str | None,
        Option(
            metavar="A:B|FILE",
            help="Rows to use, counted from 0: A:B without B, or a file with one number per line.",
        ),
    ] = None
    targets: Annotated[
        tuple[str, ...] | None,
        Option(
            metavar="NAME,…",
            help="Targets to use; by default all that are not reference points.",
            kind=str,
            several=",",
        ),
    ] = None
    reference_points: Annotated[
        tuple[str, ...] | None,
        Option(
            metavar="NAME,…",
            help="Fixed points beside the robot; by default those whose names begin with 'base'.",
            also="--nests",
            kind=str,
            several=",",
        ),
    ] = None
    drift: Annotated[
        Literal["follow", "ignore"],
        Option(help="Compensate drift by the reference points if they moved by more than their noise, or ignore them."),
    ] = "follow"
