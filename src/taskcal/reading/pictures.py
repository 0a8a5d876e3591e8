"""Pictures of a campaign: the corners that they show, from a folder or a file, and which row each of them belongs to."""

import re
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import NamedTuple

import numpy as np
from jaxtyping import Float, Int

from taskcal.campaigns.campaign import Campaign
from taskcal.errors import CampaignError, FileError, TaskcalError, listed, shown
from taskcal.geometry import se3
from taskcal.geometry.euler import to_angles
from taskcal.observations import ObservedColumns, Pixels, images_of
from taskcal.observations.calibration_board import MAX_SCALE_ERROR, Board
from taskcal.observations.camera import (
    FEWEST_CORNERS,
    KILO,
    LENSES,
    Lens,
    Pictures,
    calibrate_camera,
    determines_pose,
    homography,
    noise_with,
    recalibrate,
)
from taskcal.observations.camera_file import StatedCamera
from taskcal.observations.flatness import find_bend
from taskcal.observations.pixels import FEWEST, Apart
from taskcal.reading.columns import meanings
from taskcal.reading.image_times import Stamp, Times, pair_by_time
from taskcal.reading.readings import Readings
from taskcal.robot.error_model import ErrorModel
from taskcal.robot.robot import Robot
from taskcal.tables.table import Table

CORNER_COLUMNS = ("image", "board", "corner", "u_px", "v_px", "width_px", "height_px")
"""Of a file of corners; joints and other columns of a campaign may follow."""

CAMERA = "camera"
"""The column that names the camera of each corner, where there are several."""

PIXEL_DECIMALS = 4
"""Of corners in a file, to which those that are found are rounded, so that the file has the same: a thousandth of their noise."""

POSE_KINDS = frozenset(("joint", "position", "quaternion", "euler", "matrix"))
"""Meanings of columns that are of a posture, in which all lines of one image agree."""

MAX_NAMED = 6
"""Images that a message names."""

FEWEST_SHIFTED = 6
"""Images from which on a shift, or a move, is looked for: fewer fit too much."""

MIN_TURN_RAD = np.radians(1.0)
"""Median by which poses are off before images are taken for shifted: nominal robots err by a tenth of it, images by less."""

STANDS_BESIDE = 5.0
"""Times that, by which the robot must turn before a board that turns by less is taken to stand before its camera."""

FAR_BETTER = 3.0
"""By how much a shift, or a move, must explain the poses better than none. Sound campaigns gain up to half."""

MIN_JUMP_M = 3e-3
"""Of what stands, that is called a move: nominal robots err by 1 to 2 mm from one part of their range to another."""

SCALE_SIGMAS = 5.0
"""Standard errors by which the robot must contradict the size of a board beside `MAX_SCALE_ERROR`, a tenth."""

MIN_DRIFT, DRIFT_SIGMAS = 1e-3, 6.0
"""Share of the focal length, and standard errors, from which on it is said to drift: refocused lenses change by per cents."""

MAX_NOISE_PX = 3.0
"""Noise of a corner beyond which the board's description is doubted; corners that are found are within 0.3 pixels."""

MAX_NOISE_RATIO = 0.9
"""Noise of the corners with the other lens over that with the stated one, under which the other is named. Of simulated lenses the
wrong model leaves 1.2 to 10 times as much where it matters, and of one that is nearly a pinhole the same to 3 %."""

LOCK = (
    "as with an autofocus, or a camera that warms up: lock the focus, let the camera warm up, and take the images again"
)
"""What changes a focal length, and what to do."""

MAX_APART, MAX_NAMED_NUMBERS = 4.0, 3
"""Standard errors by which a number of a camera that is known may differ from that of the images: one of nine does by
chance in one of 1700 cameras; and how many of such numbers are named."""

MISFIT = 1.5
"""By how much corners may be farther off beside a camera that is known than beside that of the images: more is not noise."""

SURE = 2.0
"""By how much poses of the board fit better with the camera where it is than where it is not."""


@dataclass(frozen=True, eq=False, kw_only=True)
class Corners:
    """Corners of boards as they were seen in images."""

    source: str
    """File or folder."""
    images: tuple[str, ...]
    """All that were looked at."""
    width: int
    """Of an image, pixels."""
    height: int
    image: Int[np.ndarray, " c"]
    """Number of each corner's image."""
    board: tuple[str, ...]
    """Name of each corner's board; empty where there is one."""
    id: Int[np.ndarray, " c"]
    """Number of each corner on its board."""
    pixel: Float[np.ndarray, "c 2"]
    """Where it was seen, the middle of the first pixel at zero."""
    folder: Path | None = None
    """Of the images, where these were looked at."""
    blurred: tuple[str, ...] = ()
    """Images whose edges are far wider than usual."""
    notes: tuple[str, ...] = ()
    camera: str = ""
    """Name of the camera; empty for the only one."""

    @property
    def label(self) -> str:
        """The camera, as unknowns and messages call it."""
        return f"camera {self.camera}".strip()

    def take(self, image: str) -> "Corners":
        """Those of one image."""
        own = np.flatnonzero(self.image == self.images.index(image))
        return replace(
            self,
            images=(image,),
            image=np.zeros(len(own), dtype=int),
            board=tuple(self.board[k] for k in own),
            id=self.id[own],
            pixel=self.pixel[own],
        )

    def table(self) -> dict[str, list[str]]:
        """Columns of a file from which `read_corners` reads the same; an image without a board has a line of its own."""
        without = np.setdiff1d(np.arange(len(self.images)), self.image)
        order = np.argsort(np.concatenate([self.image, without]), kind="stable")
        whole = [str(self.width)] * len(order), [str(self.height)] * len(order)
        rows = {
            "image": [self.images[k] for k in (*self.image, *without)],
            "board": [*self.board, *("" for _ in without)],
            "corner": [*map(str, self.id), *("" for _ in without)],
            "u_px": [*(f"{u:.{PIXEL_DECIMALS}f}" for u in self.pixel[:, 0]), *("" for _ in without)],
            "v_px": [*(f"{v:.{PIXEL_DECIMALS}f}" for v in self.pixel[:, 1]), *("" for _ in without)],
        }
        sorted_rows = {name: [cells[k] for k in order] for name, cells in rows.items()}
        return {**sorted_rows, "width_px": whole[0], "height_px": whole[1]}


NO_CORNERS = Corners(
    source="",
    images=(),
    width=0,
    height=0,
    image=np.zeros(0, dtype=int),
    board=(),
    id=np.zeros(0, dtype=int),
    pixel=np.zeros((0, 2)),
)


def join_corners(parts: Sequence[Corners]) -> Corners:
    """Corners of one camera, image after image."""
    count = np.cumsum([0, *(len(one.images) for one in parts)])
    return replace(
        parts[0],
        images=tuple(name for one in parts for name in one.images),
        image=np.concatenate([one.image + first for one, first in zip(parts, count[:-1], strict=True)]),
        board=tuple(name for one in parts for name in one.board),
        id=np.concatenate([one.id for one in parts]),
        pixel=np.concatenate([one.pixel for one in parts]),
    )


def tabulate_corners(corners: Sequence[Corners]) -> dict[str, list[str]]:
    """Columns of a file from which `read_corners` reads the same cameras; with the name of each where there are several."""
    tables = [one.table() for one in corners]
    out = {name: [cell for table in tables for cell in table[name]] for name in tables[0]}
    cameras = [one.camera for one, table in zip(corners, tables, strict=True) for _ in table["image"]]
    return {"camera": cameras, **out} if any(cameras) else out


def has_corners(table: Table) -> bool:
    """Whether a file has a row for each corner."""
    return all(name in table for name in ("image", "corner", "u_px", "v_px"))


def read_corners(table: Table) -> tuple[Corners, ...]:
    """Read a file of corners: ``image board corner u_px v_px width_px height_px``, and ``camera`` where there are several.

    Raises:
        FileError: a cell is not what it must be, a corner is there twice, or the sizes of a camera's images differ.
    """
    if CAMERA not in table:
        return (_corners_of_camera(table),)
    cameras = table.texts(CAMERA)
    for row, name in enumerate(cameras):
        if not name:
            raise table.error("the cell is empty; name the camera in every row, or leave the column out", row, CAMERA)
    names = dict.fromkeys(cameras)
    return tuple(
        replace(
            _corners_of_camera(table.take(np.array([one == name for one in cameras]))),
            camera=name if len(names) > 1 else "",
        )
        for name in names
    )


def _corners_of_camera(table: Table) -> Corners:
    """Those of one camera."""
    names = table.texts("image")
    images = tuple(dict.fromkeys(names))
    number = {name: k for k, name in enumerate(images)}
    ids, pixel = table.numbers("corner", empty=True), table.side_by_side(("u_px", "v_px"), empty=True)
    seen = np.isfinite(ids)
    for row in np.flatnonzero(seen & ~np.isfinite(pixel).all(axis=1)):
        raise table.error("a corner that was seen needs u_px and v_px", int(row), "u_px")
    boards = table.texts("board") if "board" in table else [""] * len(names)
    found: dict[tuple[str, str, float], int] = {}
    for row in np.flatnonzero(seen):
        key = names[row], boards[row], float(ids[row])
        if key in found or ids[row] != round(ids[row]):
            line = table.lines[found[key]] if key in found else 0
            what = f"is in line {line} already" if key in found else "is not a whole number"
            raise table.error(f"corner {ids[row]:g} of image '{shown(names[row])}' {what}", int(row), "corner")
        found[key] = int(row)
    sizes = [_size(table, name, pixel[seen, k]) for k, name in enumerate(("width_px", "height_px"))]
    rows = np.flatnonzero(seen)
    return Corners(
        source=table.path.name,
        images=images,
        width=sizes[0],
        height=sizes[1],
        image=np.array([number[names[row]] for row in rows], dtype=int),
        board=tuple(boards[row] for row in rows),
        id=ids[rows].astype(int),
        pixel=pixel[rows],
    )


def _size(table: Table, name: str, pixel: Float[np.ndarray, " c"]) -> int:
    """Of the images; as far as corners are seen where that is not stated."""
    if name not in table:
        return int(np.ceil(pixel.max(initial=1.0) + max(pixel.min(initial=0.0), 0.0)))
    values = table.numbers(name)
    other = np.flatnonzero(values != values[0])
    if len(other):
        raise table.error(
            f"image '{shown(table.texts('image')[other[0]])}' is {values[other[0]]:g} pixels, those before it {values[0]:g}: "
            "a camera has other numbers for another size; calibrate each by itself",
            int(other[0]),
            name,
        )
    return int(values[0])


def one_row_an_image(table: Table, robot: Robot) -> Table:
    """A file of corners as a campaign of a robot: its first line of each image, without what is of single corners.

    Raises:
        FileError: lines of one image differ in their joints or poses.
    """
    rows = without_columns(table, (CAMERA, *CORNER_COLUMNS[1:]))
    cells, first = [tuple(row) for row in rows.rows], dict[str, int]()
    name_of = stem_of if CAMERA in table else str
    units = rows.units or ("",) * len(rows.header)
    known = meanings(rows.header, units, robot.joint_names)
    posed = [k for k, one in enumerate(known) if one is not None and one.kind in POSE_KINDS]
    for row, name in enumerate(table.texts("image")):
        before = first.setdefault(name_of(name), row)
        for k in posed:
            if (cell := cells[row][k]) != (other := cells[before][k]):
                raise table.error(
                    f"'{shown(cell)}' differs from '{shown(other)}' in line {table.lines[before]}, of the same image "
                    f"'{shown(name)}', which is of one posture: name images of another one otherwise",
                    row,
                    rows.header[k],
                )
    there = np.zeros(len(cells), dtype=bool)
    there[list(first.values())] = True
    return rows.take(there)


def without_columns(table: Table, names: Sequence[str]) -> Table:
    """A table without some of its columns."""
    left = [k for k, name in enumerate(table.header) if name.lower() not in {one.lower() for one in names}]
    cells = [tuple(row[k] for k in left) for row in table.rows]
    units = tuple(table.units[k] for k in left) if table.units else ()
    return replace(table, header=tuple(table.header[k] for k in left), rows=cells, units=units)


# Rows and their images.


def with_images(readings: Readings, robot: Robot, corners: Sequence[Corners]) -> Readings:
    """Readings whose rows name images, and hold nothing else that was measured.

    Positions and rotations beside joints are the controller's own; without joints they are those of a wrist that a robot of three
    slides and three turns can have as its joints.

    Raises:
        FileError: there are neither joints nor poses of such a wrist, or rows and images cannot be paired.
    """
    readings, images = _joints_alone(readings, robot), _names_of_images(corners)
    if readings.observed is not None and "image" in readings.observed:
        return readings.noted(*_unpaired(readings, images))
    ids = readings.ids or ()
    cells, names = ids, {Path(name).stem.casefold() for name in images}
    if not any(Path(text).stem.casefold() in names for text in ids):
        if len(images) != len(readings):
            several = f" of {len(corners)} cameras, those of one posture under one name" if len(corners) > 1 else ""
            raise FileError(
                readings.path,
                f"names no images, and has {len(readings)} rows where {corners[0].source} has {len(images)} images{several}; add a "
                "column image with the name of each row's file",
                line=1,
            )
        cells = tuple(sorted(images, key=natural_order))
        readings = readings.noted(
            f"no column image: rows and images are paired in their order, from {cells[0]} to {cells[-1]}"
        )
    readings = _naming(readings, cells)
    return readings.noted(*_unpaired(readings, images))


def _names_of_images(corners: Sequence[Corners]) -> tuple[str, ...]:
    """Names of the images of all cameras, those of one posture once, whatever their suffix."""
    if len(corners) == 1:
        return corners[0].images
    return tuple({stem_of(name): name for one in reversed(corners) for name in one.images}.values())


def _unpaired(readings: Readings, names: Sequence[str]) -> list[str]:
    """What is to be said of rows that name no image, and of images that no row names."""
    assert readings.observed is not None
    cells = readings.observed.texts("image")
    lines = [str(line) for line, text in zip(readings.lines, cells, strict=True) if not text.strip()]
    named = {stem_of(text) for text in cells}
    images = [name for name in names if stem_of(name) not in named]
    notes = [f"no image is named in line {in_words(lines)}: not used"] if lines else []
    return [*notes, f"no row names {in_words(images)}: not used"] if images else notes


def stem_of(text: str) -> str:
    """Name of an image without its folder and suffix."""
    return Path(text.replace("\\", "/")).stem.casefold()


def at_standstill(
    readings: Readings,
    robot: Robot,
    corners: Corners,
    times: Times,
    images: Sequence[Stamp],
) -> Readings:
    """Readings of a log, a row for each sharp image before and after which the robot stood.

    Args:
        readings: of joints, or of poses of the wrist.
        robot: the robot.
        corners: in the images.
        times: of the readings.
        images: times of the images.

    Raises:
        FileError: times of rows go back, or the robot stood at no image.
    """
    readings = _joints_alone(readings, robot)
    assert readings.q is not None
    rows = times.seconds
    for back in np.flatnonzero(np.diff(rows) < 0.0)[:1]:
        raise FileError(
            readings.path,
            f"its time goes back by {rows[back] - rows[back + 1]:.3g} s; a log must be in the order of time",
            line=int(readings.lines[back + 1]),
        )
    of_rows = [Stamp(one.seconds - times.unsure, one.unsure + times.unsure) for one in images]
    found = pair_by_time(robot, readings.q, rows, of_rows)
    sharp = np.array([corners.images[k] not in corners.blurred for k in found.image], dtype=bool)
    if not sharp.any():
        taken = np.array([one.seconds for one in images])
        first, last = ((float(t.min()), float(t.max())) for t in (rows, taken))
        why = f"{len(found.moving)} while it moved, {len(found.outside)} before or after its rows, {int((~sharp).sum())} blurred"
        raise FileError(
            readings.path,
            f"the robot stood at none of {len(images)} images of {corners.source}: {why}. Its times are {first[0]:.3f} to "
            f"{first[1]:.3f} s, those of the images {last[0]:.3f} to {last[1]:.3f} s; both must be of one clock, "
            "and the name of the column has their unit, such as time_ms",
        )
    names = [tuple(corners.images[k] for k in which) for which in (found.moving, found.outside, found.image[~sharp])]
    reasons = "the robot moved just before or after", "there are no joints before and after", "blurred:"
    notes = [f"{reason} {in_words(own)}: not used" for reason, own in zip(reasons, names, strict=True) if own]
    own = tuple(corners.images[k] for k in found.image[sharp])
    kept = replace(readings.take(found.row[sharp]), q=found.q[sharp], ids=own)
    return _naming(kept, own).noted(f"{len(own)} of {len(images)} images are paired by time", *notes)


def _joints_alone(readings: Readings, robot: Robot) -> Readings:
    if readings.q is None:
        readings = _wrist_as_joints(readings, robot)
    return replace(readings, points={}, rotations={}, uncertainty={}, open_angles=None, length_unit_stated=True)


def _naming(readings: Readings, images: tuple[str, ...]) -> Readings:
    """Readings whose rows name images."""
    observed = ObservedColumns(
        path=readings.path,
        lines=readings.lines,
        cells={"image": images},
        headers={"image": "id"},
        units={"image": None},
    )
    return replace(readings, observed=observed)


def natural_order(name: str) -> list[tuple[int, int, str]]:
    """In the order in which people count: 2 before 10."""
    return [
        (0, int(part), "") if part.isdigit() else (1, 0, part) for part in re.split(r"(\d+)", name.casefold()) if part
    ]


def _wrist_as_joints(readings: Readings, robot: Robot) -> Readings:
    """Poses of a wrist as the joints of a robot that has three slides and turns about z, y and x."""
    free = list(robot.prismatic) == [True] * 3 + [False] * 3
    if not free or not readings.rotations or len(readings.points) != 1:
        what = (
            "poses of the wrist need qx qy qz qw, beside x y z"
            if free
            else "joints are lacking; with poses of the wrist alone take --robot wrist"
        )
        raise FileError(readings.path, what, line=1)
    (points,), (rotations,) = readings.points.values(), list(readings.rotations.values())[:1]
    q = np.concatenate([points, to_angles("rpy", rotations)[:, ::-1]], axis=1)
    return replace(readings, q=q, joint_unit_stated=True)


def with_pictures(
    campaign: Campaign,
    corners: Sequence[Corners],
    boards: Sequence[Board],
    robot: Robot,
    model: str,
    given: Sequence[StatedCamera | None] = (None,),
    *,
    targets: Sequence[str] = (),
    judged: bool = True,
) -> Campaign:
    """A campaign whose rows name images, with what these show.

    Args:
        campaign: as read.
        corners: in the images of each camera.
        boards: that were printed.
        robot: whose nominal poses tell which cameras and boards move.
        model: of the lenses, ``pinhole`` or ``fisheye``.
        given: what is known of each camera, with an uncertainty.
        targets: of a calibration, among which what is on the wrist is to be; by default it is what most images show.
        judged: whether pictures that do not fit the robot are refused.

    Raises:
        CampaignError: images are not there, too few show a board, one board is in none, they do not fit the robot, or a camera that
            is known does not.
    """
    found = images_of(campaign.observations)
    assert found is not None
    blank = found[1]
    number, missing = _numbers(campaign, blank, corners)
    shapes = [_shapes(own, of, boards) for own, of in zip(corners, number, strict=True)]
    rows = np.unique([shape.row for own in shapes for shape in own]).astype(int)
    _refuse_unseen(shapes, corners, boards)
    parts = [
        _picture(own, found, rows, boards, model, known)
        for own, found, known in zip(corners, shapes, given, strict=True)
    ]
    notes = [note for _, own in parts for note in own]
    if missing:
        notes.append(f"{corners[0].source} has no image {in_words(missing)}: the rows are not used")
    named = (number >= 0).any(axis=0)
    few = [blank.images[blank.of[row]] for row in np.flatnonzero(named) if blank.of is not None and row not in rows]
    if few:
        notes.append(f"no board is seen in {in_words(few)}")
    of = np.full(len(campaign), -1)
    of[rows] = np.arange(len(rows))
    kind = Pixels(
        images=tuple(next(shape.image for own in shapes for shape in own if shape.row == row) for row in rows),
        of=of,
        boards=tuple(board.name for board in boards),
        u_scale=tuple(board.u_scale for board in boards),
        cameras=tuple(own.label for own in corners),
        lenses=tuple(pictures.lens for pictures, _ in parts),
        given=tuple(given),
        pictures=tuple(pictures for pictures, _ in parts),
    )
    T = ErrorModel(robot).poses(campaign.q)
    pairs = BoardPoses.each(kind, T)
    kind = replace(kind, moving=find_mounts(kind, pairs, campaign.source))
    kind = replace(kind, moving=_with_target_first(kind, targets, campaign.source))
    kind = replace(kind, start=kind.on_robot(T))
    notes += [
        f"{'' if len(corners) == 1 else f'{own.label}: '}{said}"
        for own, (pictures, _) in zip(corners, parts, strict=True)
        if (said := focus_drift(pictures)) is not None
    ]
    M = np.tile(np.eye(4), (len(campaign), 1, 1))
    M[:, :3, 3] = np.nan
    assert kind.start is not None
    M[rows] = kind.views(kind.start).moving.T
    sources = _sources(corners)
    pictured = replace(
        campaign,
        targets=(kind.target,),
        points=M[:, None, :3, 3],
        rotations=np.ascontiguousarray(M[:, :3, :3]),
        observations=(kind,),
        source=f"{campaign.source} with {sources}" if sources != campaign.source else campaign.source,
        notes=(*campaign.notes, *notes),
    )
    if judged:
        for pair in pairs:
            _refuse_misfit(kind, pair, campaign.source)
    return pictured


def _sources(corners: Sequence[Corners]) -> str:
    """Files or folders of the corners of all cameras."""
    return ", ".join(dict.fromkeys(own.source for own in corners))


class Shape(NamedTuple):
    """A board in an image."""

    image: str
    """Its name."""
    row: int
    board: int
    """Number of the board."""
    corner: Float[np.ndarray, "c 3"]
    pixel: Float[np.ndarray, "c 2"]


def _shapes(corners: Corners, number: Int[np.ndarray, " n"], boards: Sequence[Board]) -> list[Shape]:
    """Boards of which enough corners are in the images that rows name."""
    by_name = {board.name: k for k, board in enumerate(boards)}
    shown_board = np.array([_board(name, by_name, corners) for name in corners.board], dtype=int)
    places = [(dict(zip(board.ids().tolist(), board.corners(), strict=True))) for board in boards]
    out: list[Shape] = []
    for row in np.flatnonzero(number >= 0).tolist():
        whole, name = corners.image == number[row], corners.images[number[row]]
        for b, board in enumerate(boards):
            own = np.flatnonzero(whole & (shown_board == b))
            for k in own:
                if int(corners.id[k]) not in places[b]:
                    raise CampaignError(
                        f"{corners.source}: corner {corners.id[k]} in image '{name}' is not on board '{board.name}', whose "
                        f"corners are {min(places[b])} to {max(places[b])}; check rows and columns of the board"
                    )
            corner = np.array([places[b][int(k)] for k in corners.id[own]]).reshape(-1, 3)
            if determines_pose(corner[:, :2]):
                out.append(Shape(name, row, b, corner, corners.pixel[own]))
    return out


def _refuse_unseen(shapes: Sequence[Sequence[Shape]], corners: Sequence[Corners], boards: Sequence[Board]) -> None:
    """See that each camera sees a board, and each board is seen."""
    for own, found in zip(corners, shapes, strict=True):
        if not found:
            of = f" of {own.label}" if own.camera else ""
            raise CampaignError(
                f"{own.source}: no image{of} that a row names shows {FEWEST_CORNERS} corners of a board; check the board's file"
            )
    unseen = [board.name for b, board in enumerate(boards) if all(shape.board != b for own in shapes for shape in own)]
    if unseen:
        raise CampaignError(
            f"{_sources(corners)}: no image of the rows shows {FEWEST_CORNERS} corners of board {in_words(unseen)}; leave it out "
            "of --board, or check its description"
        )


def _picture(
    corners: Corners,
    shapes: Sequence[Shape],
    rows: Int[np.ndarray, " views"],
    boards: Sequence[Board],
    model: str,
    given: StatedCamera | None,
) -> tuple[Pictures, list[str]]:
    """What the images of a camera show, with the camera that they have, and what is to be said of it."""
    lens = Lens(model=model if given is None else given.lens.model, width=corners.width, height=corners.height)
    if given is not None and given.lens != lens:
        raise CampaignError(
            f"{given.source} is of images of {given.lens.width} × {given.lens.height} pixels, and those of {corners.source} have "
            f"{lens.width} × {lens.height}: a camera has other numbers for another size; leave out --camera, or give the one of "
            "this size"
        )
    pictures = _calibrate(lens, shapes, rows, corners, boards)
    notes = list(corners.notes)
    other = next(name for name in LENSES if name != lens.model)
    noise = noise_with(pictures, other)
    if noise < MAX_NOISE_RATIO * pictures.noise:
        notes.append(
            f"a lens of the model {other} leaves {noise:.2f} px of the corners, where {lens.model} leaves {pictures.noise:.2f} px: "
            f"take --lens {other}"
        )
    pictures, bent, untold = find_bend(pictures)
    notes += [
        f"board '{boards[one.board].name}' is bent by {one.height * 1e3:.2f} ± {one.error * 1e3:.2f} mm, as left-out images prove; "
        "its corners are taken as they lie; mount it on a flat plate"
        for one in bent
    ]
    notes += [
        f"board '{boards[board].name}' is taken for flat: its images do not tell whether it is" for board in untold
    ]
    if given is not None:
        assert given.uncertainty is not None
        alone, pictures = pictures, recalibrate(pictures, (given.numbers, given.uncertainty))
        notes += _compare_cameras(given, alone, pictures)
    return pictures, [f"{corners.label}: {note}" for note in notes] if corners.camera else notes


def _calibrate(
    lens: Lens, shapes: Sequence[Shape], rows: Int[np.ndarray, " views"], corners: Corners, boards: Sequence[Board]
) -> Pictures:
    """The camera that the images alone have."""
    try:
        pictures = calibrate_camera(
            lens,
            tuple(shape.image for shape in shapes),
            np.array([shape.board for shape in shapes]),
            np.concatenate([[0], np.cumsum([len(shape.corner) for shape in shapes])]),
            np.concatenate([shape.corner for shape in shapes]),
            np.concatenate([shape.pixel for shape in shapes]),
            np.searchsorted(rows, [shape.row for shape in shapes]),
        )
    except CampaignError:
        _refuse_swapped_counts(shapes, corners, boards)
        raise
    if pictures.noise > MAX_NOISE_PX:
        _refuse_swapped_counts(shapes, corners, boards)
    return pictures


def _refuse_swapped_counts(shapes: Sequence[Shape], corners: Corners, boards: Sequence[Board]) -> None:
    """See that corners do not lie on a plane far better where columns and rows of a board are exchanged."""
    number = {name: k for k, name in enumerate(corners.images)}

    def off(board: Board, images: Sequence[str]) -> float:
        places = dict(zip(board.ids().tolist(), board.drawn_corners(), strict=True))
        of_board = np.array([name in ("", board.name) for name in corners.board])
        out: list[float] = []
        for name in images:
            there = of_board & (corners.image == number[name])
            own = [c for c in np.flatnonzero(there) if int(corners.id[c]) in places]
            if len(own) > FEWEST_CORNERS:  # four lie on any plane
                plane, pixel = np.stack([places[int(c)] for c in corners.id[own]]), corners.pixel[own]
                seen = np.column_stack([plane, np.ones(len(own))]) @ homography(plane, pixel).T
                out.append(float(np.linalg.norm(seen[:, :2] / seen[:, 2:] - pixel, axis=1).mean()))
        return float(np.median(out)) if out else np.inf

    for b, board in enumerate(boards):
        swapped = replace(board, columns=board.rows, rows=board.columns)
        images = [shape.image for shape in shapes if shape.board == b]
        if FAR_BETTER * off(swapped, images) < off(board, images):
            raise CampaignError(
                f"{corners.source}: columns and rows of board '{board.name}' are swapped: its corners lie on a plane if it has "
                f"{swapped.columns} columns and {swapped.rows} rows; correct the board's file"
            )


def _compare_cameras(given: StatedCamera, alone: Pictures, pictures: Pictures) -> list[str]:
    """What is to be said of a camera that is known, beside the one that the images alone have."""
    assert given.uncertainty is not None
    pixels = np.repeat([KILO, 1.0], [4, len(given.numbers) - 4])
    information = alone.settle(alone.camera).of_camera[0].sum(axis=0) + np.diag(alone.lens.deviations**-2.0)
    error = np.sqrt(np.diag(np.linalg.inv(information)) + given.uncertainty**2)
    apart = (given.numbers - alone.camera) / error
    far = np.argsort(-np.abs(apart))
    far = far[np.abs(apart[far]) > MAX_APART][:MAX_NAMED_NUMBERS]
    named = ", ".join(
        f"{alone.lens.unknowns[k]} {given.numbers[k] * pixels[k]:.6g} (the images: {alone.camera[k] * pixels[k]:.6g} ± "
        f"{error[k] * pixels[k]:.2g})"
        for k in far
    )
    if len(far) and pictures.noise > MISFIT * alone.noise:
        raise CampaignError(
            f"{given.source} is not of the camera that took these images: beside it corners are off by {pictures.noise:.2g} px, "
            f"and by {alone.noise:.2g} px with the camera that the images have; {named}. Leave out --camera, or check focus, zoom "
            "and size of the images"
        )
    known = "exact" if not given.uncertainty.any() else "known with its uncertainty"
    out = [f"the camera of {given.source} is taken as {known}"]
    return [*out, f"{given.source} and the images differ by more than their uncertainty: {named}"] if len(far) else out


def _numbers(
    campaign: Campaign, blank: Pixels, corners: Sequence[Corners]
) -> tuple[Int[np.ndarray, "cameras n"], list[str]]:
    """Number of each row's image among those of each camera, −1 where it names none of them; and names that no camera has.

    Raises:
        CampaignError: no camera has an image, while no row names others, so that the name may be wrong; two rows name the same; or
            rows name none of a camera.
    """
    assert blank.of is not None
    out, missing = np.full((len(corners), len(campaign)), -1), list[str]()
    whole = [{name.casefold(): k for k, name in enumerate(one.images)} for one in corners]
    stems = [{Path(name).stem.casefold(): k for k, name in enumerate(one.images)} for one in corners]
    for row in np.flatnonzero(blank.of >= 0):
        text = blank.images[blank.of[row]]
        name = Path(text.replace("\\", "/")).name.casefold()
        for c in range(len(corners)):
            out[c, row] = whole[c].get(text.casefold(), whole[c].get(name, stems[c].get(Path(name).stem, -1)))
        if (out[:, row] < 0).all():
            missing.append(text)
    if missing and any(len(np.unique(own[own >= 0])) < len(one.images) for own, one in zip(out, corners, strict=True)):
        others = shown(listed(sorted(corners[0].images, key=natural_order), 3), 80)
        raise CampaignError(
            f"{campaign.source}: {_sources(corners)} has no image {in_words(missing)}; its images are {others}: correct the "
            "column image, or leave out the rows"
        )
    for own, of in zip(corners, out, strict=True):
        _refuse_unnamed(campaign, own, of, [blank.images[k] for k in blank.of[of >= 0]])
    return out, missing


def _refuse_unnamed(campaign: Campaign, corners: Corners, number: Int[np.ndarray, " n"], texts: Sequence[str]) -> None:
    """See that rows name images of a camera, and each of them once."""
    named, count = np.unique(number[number >= 0], return_counts=True)
    if not len(named):
        raise CampaignError(
            f"{campaign.source}: no row names an image of {corners.label}, whose images are {in_words(corners.images)}: images of "
            "one posture have one name in the folders of all cameras, that of the row"
        )
    for k in np.flatnonzero(count > 1)[:1]:
        own = np.flatnonzero(number[number >= 0] == named[k])
        one, other = (texts[j] for j in own[:2])
        raise CampaignError(
            f"{campaign.source}: the rows with images '{shown(one)}' and '{shown(other)}' both name "
            f"'{corners.images[named[k]]}' of {corners.label}: give each posture one row, whose image is the name that it has in "
            "the folders of all cameras"
        )


def in_words(names: Sequence[str]) -> str:
    """Some names for a message, and how many more."""
    return shown(listed(names, MAX_NAMED), 200)


def _board(name: str, numbers: dict[str, int], corners: Corners) -> int:
    if name in numbers:
        return numbers[name]
    if not name and len(numbers) == 1:
        return 0
    raise TaskcalError(
        f"{corners.source}: names a board '{shown(name)}', where the file of boards has {', '.join(numbers)}"
    )


# Whether pictures and robot belong together, told by poses alone: before a fit, and for sure.


class BoardPoses(NamedTuple):
    """Rows in which one camera sees one board, in their order, as the nominal robot and the pictures have them."""

    camera: int
    """Number of the camera."""
    board: int
    """Number of the board."""
    rows: Int[np.ndarray, " n"]
    T: Float[np.ndarray, "n 4 4"]
    """Of the tool."""
    mounts: tuple[Float[np.ndarray, "n 4 4"], Float[np.ndarray, "n 4 4"]]
    """What moves in the frame of what stands, with the camera on the wrist, and with the camera beside the robot."""
    names: tuple[str, ...]
    """Of the images."""

    @classmethod
    def each(cls, kind: Pixels, T: Float[np.ndarray, "n 4 4"]) -> list["BoardPoses"]:
        """Of every camera and board of some images, and the nominal poses of the tool; those of most rows first."""
        assert kind.of is not None
        assert kind.pictures is not None
        row, out = np.full(len(kind.images), -1), list[BoardPoses]()
        row[kind.of[kind.of >= 0]] = np.flatnonzero(kind.of >= 0)
        for c, pictures in enumerate(kind.pictures):
            at = pictures.settle(pictures.camera).T_camera_board
            for b in np.unique(pictures.board).tolist():
                own = np.flatnonzero((pictures.board == b) & (row[pictures.view] >= 0))
                own = own[np.argsort(row[pictures.view[own]])]
                rows, names = row[pictures.view[own]], tuple(pictures.names[k] for k in own)
                out.append(cls(c, b, rows, T[rows], (se3.inverse(at[own]), at[own]), names))
        return sorted(out, key=lambda one: -len(one.rows))

    @property
    def stands(self) -> bool:
        """Whether camera and board keep their pose to each other while the robot turns."""
        M, tool = (
            np.linalg.norm(se3.log(P[:, :3, :3] @ P[:1, :3, :3].swapaxes(1, 2)), axis=1)
            for P in (self.mounts[1], self.T)
        )
        return bool(np.median(M) < MIN_TURN_RAD and np.median(tool) > STANDS_BESIDE * MIN_TURN_RAD)

    def in_rows_of(self, campaign: Campaign, kind: Pixels) -> Campaign:
        """A campaign of what moves, as a tracker in what stands would have measured it; rows without it show nothing."""
        M = np.tile(np.eye(4), (len(campaign), 1, 1))
        M[:, :3, 3] = np.nan
        M[self.rows] = self.mounts[0 if kind.on_wrist[self.camera] else 1]
        return replace(campaign, points=M[:, None, :3, 3], rotations=np.ascontiguousarray(M[:, :3, :3]))

    @property
    def apart(self) -> tuple[Apart, Apart]:
        """With either mount."""
        wrist, base = (Apart.of(self.T, M) for M in self.mounts)
        return wrist, base


def find_mounts(kind: Pixels, pairs: Sequence[BoardPoses], source: str) -> tuple[str, ...]:
    """Cameras and boards that are on the wrist, the one that most images show first.

    Args:
        kind: what images show.
        pairs: of all cameras and boards that see each other, those of most rows first.
        source: the file a message is about.

    Raises:
        CampaignError: a camera and a board that see each other are both on the wrist, or both stand; or some are in too few images,
            and see none of the others.
    """
    moves, group = dict[str, bool](), {name: k for k, name in enumerate(kind.bodies)}
    most = dict[int, int]()
    for pair in pairs:
        camera, board = kind.cameras[pair.camera], f"board {kind.boards[pair.board]}"
        if pair.stands:
            raise CampaignError(
                f"{source}: {camera} sees {board} in the same pose in {in_words(pair.names)} while the robot turns: both stand, or "
                "both are on the wrist, and such images tell nothing of the robot; leave them out, or check that rows and images "
                "belong together"
            )
        if camera not in moves and board not in moves:
            wrist, base = pair.apart if len(pair.rows) >= FEWEST else (None, None)
            moves[camera] = wrist is None or base is None or wrist.turn < base.turn
        moves[camera] = moves.get(camera, not moves.get(board, False))
        moves.setdefault(board, not moves[camera])
        if moves[camera] == moves[board]:
            raise CampaignError(
                f"{source}: {camera} sees {board} in {in_words(pair.names)}, and as other images have it both "
                f"{'are on the wrist' if moves[board] else 'stand'}: such images tell nothing of the robot; leave them out, or "
                "check that rows and images belong together"
            )
        one, other = sorted((group[camera], group[board]))
        group = {name: one if k == other else k for name, k in group.items()}
        most[one] = max(most.get(one, 0), most.pop(other, 0), len(pair.rows))
    for k, count in most.items() if len(most) > 1 else ():
        if count < FEWEST:
            names = " and ".join(name for name in moves if group[name] == k)
            raise CampaignError(
                f"{source}: {names} see each other in {count} images, and none of the others: that does not tell where they are; "
                f"take {FEWEST} images of them or more, better 20, or leave them out"
            )
    camera, board = kind.cameras[pairs[0].camera], f"board {kind.boards[pairs[0].board]}"
    first = camera if moves[camera] else board
    return (first, *(name for name in kind.bodies if moves[name] and name != first))


def _with_target_first(kind: Pixels, targets: Sequence[str], source: str) -> tuple[str, ...]:
    """Cameras and boards on the wrist, that first which is the target of a calibration."""
    orders = [(name, *(other for other in kind.moving if other != name)) for name in kind.moving]
    found = [order for order in orders if replace(kind, moving=order).target in targets]
    if targets and not found:
        raise CampaignError(
            f"{source}: these images have {', '.join(kind.moving)} on the wrist, the calibration {', '.join(targets)}: they "
            "are of other cameras or boards; name the folder, and the boards' file, as they were calibrated"
        )
    return (found or orders)[0]


def _refuse_misfit(kind: Pixels, poses: BoardPoses, source: str) -> None:
    """See that robot and pictures fit each other.

    Raises:
        CampaignError: they do not; or they fit if images are shifted by one row, boards have another size, or something moved
            between two images.
    """
    if len(poses.rows) < FEWEST:
        return
    moves, alone = kind.on_wrist[poses.camera], len(kind.bodies) == 2
    (wrist, base), one = poses.apart, poses.apart[0 if moves else 1]
    camera, board = kind.cameras[poses.camera], "board" if alone else f"board {kind.boards[poses.board]}"
    of = f" of {camera}" if len(kind.cameras) > 1 else ""
    _refuse_shifted(poses, min(wrist.turn, base.turn), source, of)
    least = min(wrist.turn, base.turn)
    if (alone or least > MIN_TURN_RAD) and max(wrist.turn, base.turn) < SURE * least:
        raise CampaignError(
            f"{source}: the poses of the {board} in the images{of} follow the robot neither with the camera on the wrist (off "
            f"by {np.degrees(wrist.turn):.2g}°, median) nor beside the robot ({np.degrees(base.turn):.2g}°): check that rows and "
            "images belong together, and the joints' units and signs; or turn the wrist more from image to image"
        )
    if is_of_other_size(one):
        raise CampaignError(
            f"{source}: the robot moves {one.scale:.3g} times as far as {'boards' if alone else board} of the stated size say; "
            "check the unit of square_mm (millimetres, not inches or metres), and that one square is stated and not the whole board"
        )
    moved = find_move(poses.T, poses.mounts[0 if moves else 1])
    if moved is not None:
        raise CampaignError(
            f"{source}: the {board if moves else camera} moved by about {moved.jump * 1e3:.0f} mm between "
            f"{poses.names[moved.first - 1]} and {poses.names[moved.first]}; fit the rows before and after by themselves (--rows)"
        )


def is_of_other_size(one: Apart) -> bool:
    """Whether the robot contradicts the stated size of the board."""
    return abs(one.scale - 1.0) > max(MAX_SCALE_ERROR, SCALE_SIGMAS * one.scale_error)


def _refuse_shifted(poses: BoardPoses, turn: float, source: str, of: str) -> None:
    """See that images do not fit far better with the row before or after their own."""
    if turn < MIN_TURN_RAD or len(poses.T) < FEWEST_SHIFTED:
        return
    for shift, which in ((1, "after"), (-1, "before")):
        kept = np.flatnonzero(np.isin(poses.rows + shift, poses.rows))
        if len(kept) < FEWEST_SHIFTED - 1:
            continue
        moved = np.searchsorted(poses.rows, poses.rows[kept] + shift)
        found = min(Apart.of(poses.T[moved], M[kept]).turn for M in poses.mounts)
        if found < min(turn / FAR_BETTER, MIN_TURN_RAD):
            raise CampaignError(
                f"{source}: images{of} are shifted against joints by one row: with each image taken for the row {which} its own, "
                f"the board is off by {np.degrees(found):.2g}° instead of {np.degrees(turn):.2g}° (median), from {poses.names[0]} "
                "on; pair them by the column image"
            )


class Move(NamedTuple):
    """What stands was in two places."""

    first: int
    """Number of the first row of the second place."""
    jump: float
    """Metres."""
    before: float
    """Mean distance of each row's place from the median one, metres."""
    after: float
    """The same, of the places before and after by themselves."""


def find_move(T: Float[np.ndarray, "n 4 4"], M: Float[np.ndarray, "n 4 4"]) -> Move | None:
    """The move of what stands, of poses of the tool and of what moves in the frame of what stands; None of sound ones."""

    def off(place: np.ndarray) -> float:
        return float(np.linalg.norm(place - np.median(place, axis=0), axis=1).sum())

    n, best = len(T), None
    if n < 2 * (FEWEST_SHIFTED // 2):
        return None
    before = off(Apart.of(T, M).place)
    least = before / FAR_BETTER
    for k in range(FEWEST_SHIFTED // 2, n - FEWEST_SHIFTED // 2 + 1):
        larger = slice(0, k) if 2 * k >= n else slice(k, None)
        place = Apart.of(T, M, larger).place
        total, between = off(place[:k]) + off(place[k:]), np.median(place[:k], axis=0) - np.median(place[k:], axis=0)
        if total < least:
            least, best = total, Move(k, float(np.linalg.norm(between)), before / n, total / n)
    return best if best is not None and best.jump > MIN_JUMP_M else None


def focus_drift(pictures: Pictures) -> str | None:
    """What to say of focal lengths that change steadily from the first image to the last; None of sound ones."""
    information, gradient = pictures.settle(pictures.camera).of_camera
    n, k = gradient.shape
    if n < FEWEST_SHIFTED:
        return None
    time, by_focus = np.linspace(-0.5, 0.5, n), np.zeros(k)
    by_focus[:2] = pictures.camera[:2]
    both = np.concatenate(
        [np.tile(np.eye(k), (n, 1, 1)), time[:, None, None] * np.tile(by_focus[:, None], (n, 1, 1))], axis=2
    )
    H = (np.swapaxes(both, 1, 2) @ information @ both).sum(axis=0)
    g = (np.swapaxes(both, 1, 2) @ gradient[:, :, None]).sum(axis=0)[:, 0]
    C = np.linalg.pinv(H, rcond=1e-12, hermitian=True)
    drift, error = float(C[-1] @ g), float(np.sqrt(max(C[-1, -1], 0.0)))
    if abs(drift) < max(MIN_DRIFT, DRIFT_SIGMAS * error):
        return None
    return (
        f"the focal length changes by {drift * 100:+.2f} ± {error * 100:.2f} % from {pictures.names[0]} to "
        f"{pictures.names[-1]}, {LOCK}"
    )
